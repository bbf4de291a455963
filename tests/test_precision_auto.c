/* Tests of precision = auto: floats only where integrator = auto keeps tol with them, by an
 * estimate that measured errors confirm; the reason; threads, checkpoints, changes, obstacles and
 * memory. */
#include <float.h>
#include <math.h>

#include "auto_scenes.h"
#include "checkpoints.h"
#include "choose/precision_choice.h"
#include "failing_sims.h"
#include "methods/methods.h"
#include "physics/scales.h"

static msim_scene *cloth(void) { return hanging_cloth(16, 300, 0); }
static msim_scene *damped_net(void) { return hanging_cloth(12, 300, 0.02); }
static msim_scene *block(void) { return pinned_block(6, 0.5, 2000, 0); }
static msim_scene *rope(void) { return swinging_rope(160, 2e4, 0); }

static msim_scene *fall(void) {
  const double g[3] = {0, 0, -9.81};
  const msim_lattice lattice = {
      .size = sizeof lattice, .n = {5, 5, 5}, .extent = {1, 1, 1}, .mass = 2, .k = 500};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

static const struct {
  const char *name;
  msim_scene *(*make)(void);
  double t_end;
} cases[] = {{"cloth", cloth, 0.6},
             {"damped net", damped_net, 0.4},
             {"block", block, 0.3},
             {"rope", rope, 0.1},
             {"fall", fall, 0.5}};
enum { CASES = sizeof cases / sizeof *cases, MOST_NUMBERS = 3 * 400 };

static int is_single(const msim_sim *sim) { return sim->islands->model.single != NULL; }

static const char *explanation(msim_sim *sim) {
  const char *text;
  assert_ok(msim_sim_explain(sim, &text, err));
  return text;
}

/* The estimate for a run; INFINITY: not possible */
static double estimate_of(const msim_scene *scene, double t_end) {
  const msim_options opt = options_of("auto", 1e-3, t_end);
  msim_sim *sim = make_sim(scene, &opt);
  const double error = sim->config.choice.single_error;
  msim_sim_destroy(sim);
  return error;
}

/*------------------------------------- errors ---------------------------------------------------*/

typedef struct end_state {
  double x[MOST_NUMBERS], v[MOST_NUMBERS];
} end_state;

static void run_to_end(const msim_scene *scene, const msim_options *opt, end_state *end) {
  msim_sim *sim = make_sim(scene, opt);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  const msim_state now = state_of(sim);
  assert_true(3 * now.n <= MOST_NUMBERS);
  memcpy(end->x, now.x, 3 * (size_t)now.n * sizeof *now.x);
  memcpy(end->v, now.v, 3 * (size_t)now.n * sizeof *now.v);
  msim_sim_destroy(sim);
}

/* E^2 = 1/(2 m) sum_i m_i (|dx_i|^2/L^2 + |dv_i|^2/U^2) */
static double error_between(const msim_scene *scene, double t_end, const end_state *a,
                            const end_state *b) {
  const ms_scene *s = scene->data;
  ms_scales scales;
  double sum = 0;
  assert_ok(ms_scales_compute(s, s->x, s->v, t_end, &scales, err));
  for (int i = 0; i < 3 * s->nparticles; i++) {
    const double dx = (a->x[i] - b->x[i]) / scales.extent, dv = (a->v[i] - b->v[i]) / scales.speed;
    if (!s->pinned[i / 3]) sum += s->mass[i / 3] * (dx * dx + dv * dv);
  }
  return sqrt(sum / (2 * scales.mass));
}

/* Runs with floats and with doubles differ by at most what the theory of rounding says, and not by
 * far less, with steps of any length. */
static void errors_are_those_of_the_estimate(void **state) {
  (void)state;
  static end_state single, exact;
  for (int i = 0; i < CASES; i++) {
    msim_scene *scene = cases[i].make();
    const double most = estimate_of(scene, cases[i].t_end);
    for (int finer = 0; finer < 2; finer++) {
      msim_options opt = options_of("velocity-verlet", 0, cases[i].t_end);
      opt.h = MSIM_H_AUTO;
      msim_sim *sim = make_sim(scene, &opt);
      if (finer) opt.h = state_of(sim).h / 4;
      msim_sim_destroy(sim);
      opt.precision = MSIM_PRECISION_SINGLE;
      run_to_end(scene, &opt, &single);
      opt.precision = MSIM_PRECISION_DOUBLE;
      run_to_end(scene, &opt, &exact);
      const double error = error_between(scene, cases[i].t_end, &single, &exact);
      if (!(error <= most && error >= most / 50))
        fail_msg("%s: error %g, estimate %g", cases[i].name, error, most);
    }
    msim_scene_destroy(scene);
  }
}

/* The formula of precision_choice.h for a scene of one island with reach R */
static double formula(const msim_scene *scene, double T, double R) {
  const ms_scene *s = scene->data;
  const double u = 0x1p-24;
  ms_scales of;
  ms_bounds bounds;
  double A2 = 0;
  assert_ok(ms_scales_compute(s, s->x, s->v, T, &of, err));
  assert_ok(ms_bounds_compute(s, 1, &bounds, err));
  for (int e = 0; e < s->nsprings; e++)
    for (int end = 0; end < 2; end++) {
      const int p = s->ij[2 * e + end];
      const double F = s->k[e] * R + s->damping[e] * of.speed;
      if (!s->pinned[p]) A2 += F * F / s->mass[p] / of.mass;
    }
  const double w = bounds.omega, tau = 1 / w + u * R / of.speed, x = w * R / of.extent;
  return u * (w * T + sqrt(tau * T / 2) * sqrt((x * x + A2 / (of.speed * of.speed)) / 2));
}

/* Pinned scenes stay within their extent; others move by v T + g T^2/2; one that is far away or
 * larger, at the same frequencies, has the same relative error. Velocities of 1e-5 m/s are so slow
 * that roundings last longer than vibrations. */
static void the_estimate_follows_from_theory(void **state) {
  (void)state;
  msim_scene *held = cloth(), *damped = damped_net(), *falling = fall(), *big, *slow;
  const double g[3] = {0, 0, -9810}, T = 0.2, g0[3] = {0};
  const int32_t corners[2] = {0, 15};
  double x[MOST_NUMBERS], v[MOST_NUMBERS] = {0};
  const ms_scene *s = held->data;
  assert_close(estimate_of(held, T), formula(held, T, 1), 1e-12);
  assert_close(estimate_of(damped, T), formula(damped, T, 1), 1e-12);
  assert_close(estimate_of(falling, T), formula(falling, T, 1 + 9.81 * T * T / 2), 1e-12);
  for (int i = 0; i < falling->data->nparticles; i++) falling->data->v[3 * i] = 30;
  assert_close(estimate_of(falling, T), formula(falling, T, 1 + 30 * T + 9.81 * T * T / 2), 1e-12);
  for (int i = 0; i < 3 * s->nparticles; i++) x[i] = 1000 * s->x[i] + 1e8;
  for (int k = 0; k < 2; k++) {
    if (k == 1) memcpy(x, s->x, 3 * (size_t)s->nparticles * sizeof *x), v[5] = v[100] = 1e-5;
    msim_scene **to = k ? &slow : &big;
    assert_ok(msim_scene_create(NULL, to, err));
    assert_ok(msim_scene_add_particles(*to, s->nparticles, x, v, s->mass, err));
    assert_ok(msim_scene_add_springs(*to, s->nsprings, s->ij, s->k, NULL, NULL, err));
    assert_ok(msim_scene_pin(*to, 2, corners, err));
    assert_ok(msim_scene_set_gravity(*to, k ? g0 : g, err));
  }
  const double e = estimate_of(held, T);
  assert_close(estimate_of(big, T), e, 1e-6 * e);
  const double still = estimate_of(slow, T);
  assert_close(still, formula(slow, T, 1), 1e-9 * still);
  assert_true(still > 1e3 * e);
  msim_scene_destroy(held), msim_scene_destroy(falling), msim_scene_destroy(damped);
  msim_scene_destroy(big), msim_scene_destroy(slow);
}

/* Explicit methods up to order 4 that take one step for all springs */
static void only_some_methods_take_floats(void **state) {
  (void)state;
  const struct {
    const ms_integrator *method;
    int takes;
  } expected[] = {{&ms_verlet, 1}, {&ms_velocity_verlet, 1}, {&ms_takahashi_imada, 1},
                  {&ms_rk4, 1},    {&ms_force_gradient, 1},  {&ms_rkc, 1},
                  {&ms_rkn6, 0},   {&ms_dop853, 0},          {&ms_respa, 0},
                  {&ms_tr_bdf2, 0}};
  for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) {
    ms_candidate c = {.method = expected[i].method, .collision = MSIM_COLLISION_REFLECT};
    assert_int_equal(ms_precision_choice_takes(&c), expected[i].takes);
    c.collision = MSIM_COLLISION_EVENT;
    assert_false(ms_precision_choice_takes(&c));
  }
}

/* With floats, which a large estimate excludes, the error is at most 2 tol, as that of verlet is
 * estimated once; without, runs have the bits of precision = double. The choice is explained. */
static void tol_decides_and_is_kept(void **state) {
  (void)state;
  static end_state end, exact, nearly_exact;
  int used[2] = {0};
  for (int i = 0; i < CASES; i++) {
    msim_scene *scene = cases[i].make();
    msim_options opt = options_of("dop853", 1e-10, cases[i].t_end);
    opt.watch = MSIM_WATCH_OFF;
    run_to_end(scene, &opt, &nearly_exact);
    for (double tol = 1e-1; tol > 5e-7; tol /= 10) {
      opt = options_of("auto", tol, cases[i].t_end);
      msim_sim *sim = make_sim(scene, &opt);
      const int single = is_single(sim);
      used[single]++;
      assert_non_null(
          strstr(explanation(sim), single ? "chosen by auto" : "precision     double: "));
      if (sim->config.choice.single_error > tol / 4) assert_false(single);
      const ms_candidate *best = &sim->config.choice.candidates[sim->config.choice.best];
      if (strcmp(best->method->entry.name, "verlet") == 0)
        assert_close(best->cost_rate * best->h, single ? 0.5 : 1, 1e-12);
      msim_sim_destroy(sim);
      run_to_end(scene, &opt, &end);
      opt.precision = MSIM_PRECISION_DOUBLE;
      if (!single) run_to_end(scene, &opt, &exact);
      const double error =
          error_between(scene, cases[i].t_end, &end, single ? &nearly_exact : &exact);
      if (!(error <= (single ? 2 * tol : 0)))
        fail_msg("%s, tol %g: error %g", cases[i].name, tol, error);
    }
    msim_scene_destroy(scene);
  }
  assert_true(used[0] >= 5 && used[1] >= 5);
}

/*------------------------------------- the same bits --------------------------------------------*/

static msim_options single_options_of(double t_end) { return options_of("auto", 1e-2, t_end); }

/* A method that is named computes with doubles; its checkpoints serve both options. */
static void named_methods_compute_with_doubles(void **state) {
  (void)state;
  static const char *const names[] = {"velocity-verlet", "force-gradient",
                                      "linearly-implicit-euler", "dop853"};
  msim_scene *scene = cloth();
  for (int i = 0; i < 4; i++)
    for (int has_tol = 0; has_tol < 2; has_tol++) {
      if (i == 2 && has_tol) continue;
      msim_options opt = options_of(names[i], has_tol ? 1e-1 : 0, 0.02);
      opt.h = 1e-3;
      if (i == 3 && !has_tol) opt.steps = 20, opt.t_end = -1;
      assert_int_equal(opt.precision, MSIM_PRECISION_AUTO);
      msim_sim *sim = make_sim(scene, &opt);
      assert_false(is_single(sim));
      assert_ok(msim_sim_step(sim, 2, err));
      const checkpoint c = save(sim);
      opt.precision = MSIM_PRECISION_DOUBLE;
      msim_sim *other = resume(scene, &opt, &c);
      expect_same(sim, other, names[i]);
      expect_same_save(sim, other, names[i]);
      free(c.bytes);
      msim_sim_destroy(sim), msim_sim_destroy(other);
    }
  msim_scene_destroy(scene);
}

static void runs_resume_to_the_bit(void **state) {
  (void)state;
  for (int i = 0; i < CASES; i++) {
    msim_scene *scene = cases[i].make();
    const msim_options opt = single_options_of(cases[i].t_end);
    msim_sim *sim = make_sim(scene, &opt);
    const int64_t steps = sim->config.plan.steps > 0 ? sim->config.plan.steps : 10,
                  at[] = {1, steps / 2, steps - 1};
    msim_sim_destroy(sim);
    expect_resumable(scene, &opt, steps, 3, at, cases[i].name);
    msim_scene_destroy(scene);
  }
}

static void observers_and_threads_change_no_bit(void **state) {
  (void)state;
  msim_scene *scene = cloth();
  msim_options opt = single_options_of(0.3);
  opt.threads = 1;
  msim_sim *alone = make_sim(scene, &opt);
  opt.threads = 2, opt.watch = MSIM_WATCH_OFF;
  msim_sim *other = make_sim(scene, &opt);
  assert_true(is_single(alone) && is_single(other));
  assert_ok(msim_sim_step(alone, 60, err));
  for (int i = 0; i < 60; i++) {
    msim_energy energy = {.size = sizeof energy};
    assert_ok(msim_sim_step(other, 1, err));
    msim_sim_energy(other, &energy);
    explanation(other);
  }
  expect_same(alone, other, "observed");
  msim_sim_destroy(alone), msim_sim_destroy(other);
  msim_scene_destroy(scene);
}

/* A collider that is far away first: the choice is made anew when it is near, to the bit. */
static void colliders_may_come_near(void **state) {
  (void)state;
  msim_scene *scene = fall();
  const msim_collider ball = {.size = sizeof ball,
                              .type = MSIM_COLLIDER_SPHERE,
                              .center = {0.5, 0.5, -1.6},
                              .radius = 0.8,
                              .restitution = 0.4};
  assert_ok(msim_scene_add_collider(scene, &ball, err));
  const msim_options opt = single_options_of(0.8);
  msim_sim *sim = make_sim(scene, &opt);
  assert_true(is_single(sim) && sim->config.choice.verification.planes_far);
  const int64_t steps = sim->config.plan.steps, at[] = {1, steps / 2, steps - 1};
  assert_ok(msim_sim_step(sim, steps, err));
  assert_false(sim->config.choice.verification.planes_far);
  assert_true(stats_of(sim).contacts > 0);
  msim_sim_destroy(sim);
  expect_resumable(scene, &opt, steps, 3, at, "collider");
  msim_scene_destroy(scene);
}

/*------------------------------------- changes and obstacles ------------------------------------*/

/* What floats do not support is never an error, but a reason for doubles. */
static void obstacles_mean_doubles(void **state) {
  (void)state;
  static const char *const reasons[] = {"angular springs", "range of floats", "growth of errors",
                                        "growth of errors"};
  const double angle_k = 1e-6, far[3] = {9, 9, 9}, heavy = 1e30;
  const int32_t ijk[3] = {0, 1, 2};
  for (int i = 0; i < 4; i++) {
    msim_scene *scene = i == 3 ? soft_cloth() : cloth();
    if (i == 0) assert_ok(msim_scene_add_angles(scene, 1, ijk, &angle_k, NULL, NULL, err));
    if (i == 1) assert_ok(msim_scene_add_particles(scene, 1, far, NULL, &heavy, err));
    if (i == 2) plane(scene, 0, 0, 1, -9, 0.5, 0);
    const msim_options opt = single_options_of(0.1);
    msim_sim *sim = make_sim(scene, &opt);
    assert_false(is_single(sim));
    if (!strstr(explanation(sim), reasons[i])) fail_msg("%s: %s", reasons[i], explanation(sim));
    msim_sim_destroy(sim), msim_scene_destroy(scene);
  }
}

static void requests_are_followed(void **state) {
  (void)state;
  msim_scene *scene = cloth();
  msim_options opt = single_options_of(0.1);
  msim_error why;
  msim_sim *sim = make_sim(scene, &opt), *other;
  const checkpoint c = save(sim);
  opt.precision = MSIM_PRECISION_DOUBLE;
  other = make_sim(scene, &opt);
  assert_true(is_single(sim) && !is_single(other));
  const ms_norm_body *norm = sim->islands->norm.body, *same = other->islands->norm.body;
  assert_true(norm->extent == same->extent && norm->speed == same->speed);
  assert_null(strstr(explanation(other), "precision  "));
  assert_true(msim_sim_load(other, c.bytes, c.length, &why) != MSIM_OK);
  assert_non_null(strstr(why.text, "precision"));
  msim_sim_destroy(sim), msim_sim_destroy(other);
  opt.precision = MSIM_PRECISION_SINGLE;
  assert_int_equal(msim_sim_create(scene, &opt, &sim, &why), MSIM_ERR_UNSUPPORTED);
  assert_non_null(strstr(why.text, "precision = auto"));
  free(c.bytes);
  msim_scene_destroy(scene);
}

/* Springs, states and edits make a new choice, which may leave floats and return to them. */
static void changes_choose_anew(void **state) {
  (void)state;
  msim_scene *scene = cloth();
  const msim_options opt = single_options_of(0.1);
  msim_sim *sim = make_sim(scene, &opt);
  const int32_t ijk[3] = {0, 1, 2}, n = scene->data->nsprings, middle = 1;
  const double angle_k = 1e-6;
  double k[1400], rest[1400];
  assert_true(n <= 1400 && is_single(sim));
  assert_ok(msim_sim_step(sim, 5, err));
  for (int stiff = 0; stiff < 2; stiff++) { /* floats would be too inaccurate, or overflow */
    for (int32_t e = 0; e < n; e++) k[e] = stiff ? 3e5 : 300, rest[e] = scene->data->rest[e];
    if (!stiff) k[0] = 0, rest[0] = 1e19;
    assert_ok(msim_sim_set_springs(sim, k, rest, NULL, err));
    assert_false(is_single(sim));
    assert_ok(msim_sim_step(sim, 2, err));
    assert_ok(msim_sim_set_springs(sim, scene->data->k, scene->data->rest, NULL, err));
    assert_true(is_single(sim));
  }
  double v[MOST_NUMBERS];
  unsigned seed = 3;
  msim_state now = state_of(sim), fast = now;
  for (int i = 0; i < 3 * now.n; i++)
    v[i] = scene->data->pinned[i / 3] ? 0 : 243 * (uniform(&seed) - 0.5);
  now.x = memcpy(rest, now.x, 3 * (size_t)now.n * sizeof *now.x), now.v = scene->data->v;
  fast.v = v;
  assert_ok(msim_sim_set_state(sim, &fast, err));
  assert_true(sim->config.choice.candidates[8].tried); /* dop853, under error control */
  assert_ok(msim_sim_set_state(sim, &now, err));
  assert_true(is_single(sim));
  assert_ok(msim_sim_step(sim, 5, err));
  const msim_edit add = {.size = sizeof add, .nangles = 1, .ijk = ijk, .angle_k = &angle_k};
  assert_ok(msim_sim_edit(sim, &add, err));
  assert_false(is_single(sim));
  assert_ok(msim_sim_step(sim, 1, err));
  const msim_edit drop = {
      .size = sizeof drop, .nremoved_particles = 1, .removed_particles = &middle};
  assert_ok(msim_sim_edit(sim, &drop, err));
  assert_true(is_single(sim));
  assert_ok(msim_sim_step(sim, 5, err));
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

/*------------------------------------- memory ---------------------------------------------------*/

/* Each allocation of a new sim fails in turn, and no step allocates. */
static void memory_may_run_out(void **state) {
  (void)state;
  static const double g[3] = {0, 0, -9.81};
  const msim_lattice lattice = {
      .size = sizeof lattice, .n = {4, 4, 4}, .extent = {1, 1, 1}, .mass = 2, .k = 500};
  msim_scene *scene;
  assert_ok(msim_scene_create(failing_allocator_get(), &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  msim_options opt = single_options_of(0.05);
  opt.threads = 1;
  expect_creation_survives_failures(scene, &opt, 3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_true(is_single(sim));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(errors_are_those_of_the_estimate),
                                     cmocka_unit_test(the_estimate_follows_from_theory),
                                     cmocka_unit_test(only_some_methods_take_floats),
                                     cmocka_unit_test(tol_decides_and_is_kept),
                                     cmocka_unit_test(named_methods_compute_with_doubles),
                                     cmocka_unit_test(runs_resume_to_the_bit),
                                     cmocka_unit_test(observers_and_threads_change_no_bit),
                                     cmocka_unit_test(colliders_may_come_near),
                                     cmocka_unit_test(obstacles_mean_doubles),
                                     cmocka_unit_test(requests_are_followed),
                                     cmocka_unit_test(changes_choose_anew),
                                     cmocka_unit_test(memory_may_run_out)};
  return cmocka_run_group_tests_name("precision_auto", tests, NULL, NULL);
}
