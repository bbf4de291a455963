/* Tests that rkc under error control counts its stages by the damping in the present state. */
#include <math.h>

#include "auto_scenes.h"
#include "checkpoints.h"
#include "methods/methods.h"
#include "methods/rkc.h"

static const double G = 9.81;

/* h: the first step; 0: that of the library */
static msim_options controlled(double tol, double h, double t_end) {
  msim_options opt = options_of("rkc", tol, t_end);
  if (h > 0) opt.h = h;
  return opt;
}

/* A particle between n pinned ones at the distance 1, in the directions of `at`, with springs of 1
 * N/m and the damping c, of which two lie along the x axis. It falls along that by g, as fast as
 * these let it. */
static msim_scene *make_star(int32_t n, const double *at, double mass, double c, double g) {
  msim_scene *scene;
  const double origin[3] = {0}, k = 1, gravity[3] = {g}, v[3] = {g * mass / (2 * c)};
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 1, origin, v, &mass, err));
  for (int32_t i = 1; i <= n; i++) {
    const int32_t ij[2] = {0, i};
    assert_ok(msim_scene_add_particles(scene, 1, at + 3 * (i - 1), NULL, &mass, err));
    assert_ok(msim_scene_pin(scene, 1, &i, err));
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, NULL, &c, err));
  }
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  return scene;
}

static const double axes[18] = {1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1};

/* The evaluations of a step of the sim, and what they are with that rate of damping: its stages, of
 * which the error estimate of the last step has the first, one for that of its own, and `more` */
static void expect_evaluations(msim_sim *sim, double rate, int more) {
  const msim_stats before = stats_of(sim);
  const ms_stepper *s = &sim->islands->stepper;
  const int is_first = s->cached_stage == 0;
  assert_ok(msim_sim_step(sim, 1, err));
  const int32_t stages =
      ms_rkc_count_stages(s->h, (ms_bounds){.omega = s->bounds.omega, .rate = rate});
  assert_int_equal(stats_of(sim).rejected_steps, before.rejected_steps);
  assert_int_equal(stats_of(sim).force_evaluations - before.force_evaluations,
                   stages + is_first + more);
}

/* The rate that the last measurement found: the length of the second vector that rkc carries on */
static double measured_rate(const msim_sim *sim) {
  const ms_stepper *s = &sim->islands->stepper;
  const double *image = s->work[ms_rkc.carried_at + ms_rkc.carried * (s->cached_stage == 2) + 1];
  return sqrt(ms_vector_dot(s->model->state_shape, image, image));
}

/* Six springs along three axes: the rate is at most 6 c/m in any state, 2 c/m in this one, in every
 * direction, so that one step shows it and the next that it does not grow. In a new state it is
 * measured anew. */
static void six_springs_have_a_third_of_their_bound(void **state) {
  (void)state;
  const double c = 50, mass = 0.01;
  msim_scene *scene = make_star(6, axes, mass, c, G);
  const msim_options opt = controlled(0.1, 0.05, 20);
  msim_sim *sim = make_sim(scene, &opt);
  assert_close(sim->islands->stepper.bounds.rate, 6 * c / mass, 1e-9);
  expect_evaluations(sim, 6 * c / mass, 1);
  for (int i = 0; i < 4; i++) expect_evaluations(sim, 1.2 * 2 * c / mass, 1);
  const msim_state now = state_of(sim);
  assert_ok(msim_sim_set_state(sim, &now, err));
  expect_evaluations(sim, 6 * c / mass, 1);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Where the bound is reached, to 1.2, no more is measured; with few stages nothing is. The second
 * measurement is in the direction of the springs. */
static void a_reached_bound_is_not_measured_again(void **state) {
  (void)state;
  const double at[6] = {1, 0, 0, -1, 0, 0}, c = 50, mass = 0.01;
  msim_scene *scene = make_star(2, at, mass, c, G);
  msim_options opt = controlled(0.1, 0.05, 20);
  msim_sim *sim = make_sim(scene, &opt);
  expect_evaluations(sim, 2 * c / mass, 1);
  expect_evaluations(sim, 2 * c / mass, 1.2 * measured_rate(sim) < 2 * c / mass);
  for (int i = 0; i < 3; i++) expect_evaluations(sim, 2 * c / mass, 0);
  assert_close(measured_rate(sim), 2 * c / mass, 0.2 * 2 * c / mass);
  msim_sim_destroy(sim);
  opt.h = 0.01, opt.t_end = 0.01;
  sim = make_sim(scene, &opt);
  expect_evaluations(sim, 2 * c / mass, 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* The particles 3 and 4 go from the y axis to the x axis in T. */
static void turn_springs(msim_scene *scene, double T) {
  enum { N = 3 };
  const int32_t particles[2] = {3, 4};
  double t[N], x[6 * N] = {0};
  for (int i = 0; i < N; i++) {
    const double angle = acos(0) * (1 - i / (N - 1.));
    t[i] = T * i / (N - 1);
    x[6 * i] = cos(angle), x[6 * i + 1] = sin(angle);
    x[6 * i + 3] = -cos(angle), x[6 * i + 4] = -sin(angle);
  }
  const msim_motion motion = {.size = sizeof motion,
                              .n = 2,
                              .particles = particles,
                              .nt = N,
                              .t = t,
                              .x = x,
                              .interpolation = MSIM_MOTION_CUBIC};
  assert_ok(msim_scene_add_motion(scene, &motion, err));
}

/* Springs without length damp nothing: there is no rate to go on from. */
static void vanishing_damping_is_left_out(void **state) {
  (void)state;
  const double at[6] = {0}, c = 50, mass = 0.01;
  const int64_t first = 1;
  msim_scene *scene = make_star(2, at, mass, c, 0);
  msim_options opt = controlled(0.1, 0.05, 20);
  opt.skip_off = MSIM_SKIP_AT_REST;
  msim_sim *sim = make_sim(scene, &opt);
  for (int i = 0; i < 2; i++) expect_evaluations(sim, 2 * c / mass, 1);
  expect_resumable(scene, &opt, 2, 1, &first, "rkc");
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Two of six springs turn until four lie along one axis: the rate grows from 2 c/m to 4 c/m, of a
 * bound of 6 c/m. Where its direction changes, it is followed late, and steps are rejected. */
static void the_rate_is_followed_where_springs_turn(void **state) {
  (void)state;
  const double c = 50, mass = 0.01, T = 40;
  msim_scene *scene = make_star(6, axes, mass, c, G);
  turn_springs(scene, T);
  const msim_options opt = controlled(1e-3, 0.02, T);
  msim_sim *sim = make_sim(scene, &opt);
  double by_bound = 0, most = 0;
  while (state_of(sim).t < T) {
    assert_ok(msim_sim_step(sim, 1, err));
    const ms_stepper *s = &sim->islands->stepper;
    if (s->cached_stage) most = fmax(most, measured_rate(sim));
    by_bound += ms_rkc_count_stages(s->h, s->bounds);
  }
  const msim_stats stats = stats_of(sim);
  print_message(
      "  %lld steps, %lld rejected, rates up to %.4g c/m, %lld evaluations instead of %g\n",
      (long long)stats.steps, (long long)stats.rejected_steps, most * mass / c,
      (long long)stats.force_evaluations, by_bound);
  assert_close(most * mass / c, 4, 1e-3);
  assert_true(10 * stats.rejected_steps <= stats.steps);
  assert_true((double)stats.force_evaluations < 0.95 * by_bound);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static msim_scene *felt_block(void) {
  const int32_t corner = 0;
  const double g[3] = {0, 0, -G};
  const msim_lattice block = {.size = sizeof block,
                              .n = {6, 6, 6},
                              .extent = {0.3, 0.3, 0.3},
                              .mass = 1,
                              .k = 2000,
                              .damping = 100,
                              .npinned = 1,
                              .pinned = &corner};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &block, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

static msim_scene *felt_sheet(void) { return hanging_cloth(12, 1000, 30); }

/* Bodies that swing on what is pinned. All accepted steps have their stages by the bound in
 * `by_bound`. Without waiting until the rate grows slowly, some more are rejected. */
static void bodies_need_fewer_stages(void **state) {
  (void)state;
  const struct {
    msim_scene *(*make)(void);
    double most; /* evaluations over those by the bound */
    int64_t most_rejected;
  } body[] = {{felt_block, 0.7, 7}, {felt_sheet, 0.85, 0}};
  const double tol = 0.01, T = 0.5;
  for (int i = 0; i < 2; i++) {
    msim_scene *scene = body[i].make();
    const msim_options accurate = options_of("ssprk104", 1e-3 * tol, T);
    const msim_options opt = controlled(tol, 0, T);
    msim_sim *sim = make_sim(scene, &opt), *exact = make_sim(scene, &accurate);
    double by_bound = 0;
    while (state_of(sim).t < T) {
      assert_ok(msim_sim_step(sim, 1, err));
      by_bound += ms_rkc_count_stages(sim->islands->stepper.h, sim->islands->stepper.bounds);
    }
    assert_ok(msim_sim_run(exact, NULL, NULL, err));
    const msim_stats stats = stats_of(sim);
    const double share = (double)stats.force_evaluations / by_bound,
                 off = largest_difference(state_of(sim).x, state_of(exact).x, 3 * state_of(sim).n);
    print_message(
        "  %d particles: %lld evaluations, %.3g of those by the bound, %lld of %lld "
        "steps rejected, error/tol %.2g\n",
        state_of(sim).n, (long long)stats.force_evaluations, share, (long long)stats.rejected_steps,
        (long long)stats.steps, off / tol);
    assert_true(share < body[i].most);
    assert_true(stats.rejected_steps <= body[i].most_rejected);
    assert_true(off < tol);
    msim_sim_destroy(sim), msim_sim_destroy(exact);
    msim_scene_destroy(scene);
  }
}

static void resumed_runs_are_the_same(void **state) {
  (void)state;
  const int64_t at[] = {1, 2, 10, 30};
  msim_scene *scene = felt_block();
  const msim_options opt = controlled(0.01, 0, 0.5);
  expect_resumable(scene, &opt, 50, 4, at, "rkc");
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(six_springs_have_a_third_of_their_bound),
                                     cmocka_unit_test(a_reached_bound_is_not_measured_again),
                                     cmocka_unit_test(vanishing_damping_is_left_out),
                                     cmocka_unit_test(the_rate_is_followed_where_springs_turn),
                                     cmocka_unit_test(bodies_need_fewer_stages),
                                     cmocka_unit_test(resumed_runs_are_the_same)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
