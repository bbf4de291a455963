/* Tests of integrator = auto when motion becomes faster than it was initially: steps are verified,
 * and planes are taken into account once they are close. */
#include <math.h>

#include "checkpoints.h"
#include "event_options.h"
#include "sim/frames.h"
#include "sim/sim.h"

static msim_options options_of(const char *method, double tol, double t_end) {
  msim_options opt;
  msim_options_init(&opt, sizeof opt);
  opt.integrator = method, opt.tol = tol, opt.t_end = t_end;
  return opt;
}

/*------------------------------------- scenes ---------------------------------------------------*/

/* A particle passes the other end of its spring, at a distance of d, in the middle of the run. */
static msim_scene *flyby(double d, double speed) {
  const double x[6] = {0, 0, 0, 1, d, 0}, v[6] = {0, 0, 0, -speed, 0, 0}, mass[2] = {1, 1};
  const double k = 1, rest = 1;
  const int32_t ij[2] = {0, 1}, first = 0;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  assert_ok(msim_scene_pin(scene, 1, &first, err));
  return scene;
}

/* A vibrating net of 25 particles, pinned at its corners, and a particle on a spring to its middle,
 * which it passes closely late in the run. */
static msim_scene *net_with_passing_particle(double d) {
  const double gap = 0.2, k = 100, mass = 0.1, v[3] = {0, 0, -2.5}, x[3] = {0.4 + d, 0.4, 1.5};
  const double soft = 1, rest = 0.5;
  const int32_t corners[4] = {0, 4, 20, 24}, to[2] = {12, 25};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int i = 0; i < 25; i++) {
    const double at[3] = {gap * (i % 5), gap * (i / 5), 0.01 * sin(i)};
    assert_ok(msim_scene_add_particles(scene, 1, at, NULL, &mass, err));
  }
  assert_ok(msim_scene_add_particles(scene, 1, x, v, &mass, err));
  for (int32_t i = 0; i < 25; i++) {
    const int32_t right[2] = {i, i + 1}, down[2] = {i, i + 5};
    if (i % 5 < 4) assert_ok(msim_scene_add_springs(scene, 1, right, &k, &gap, NULL, err));
    if (i < 20) assert_ok(msim_scene_add_springs(scene, 1, down, &k, &gap, NULL, err));
  }
  assert_ok(msim_scene_add_springs(scene, 1, to, &soft, &rest, NULL, err));
  assert_ok(msim_scene_pin(scene, 4, corners, err));
  return scene;
}

/* A block slides down a slope of 20 degrees, slows down and stops. */
static msim_scene *sliding(void) {
  enum { ALL = 27 };
  const double angle = 0.35, g[3] = {9.81 * sin(angle), 0, -9.81 * cos(angle)};
  const msim_lattice block = {.size = sizeof block,
                              .n = {3, 3, 3},
                              .extent = {0.2, 0.2, 0.2},
                              .mass = 1,
                              .k = 2000,
                              .damping = 0.5};
  msim_scene_view of = {.size = sizeof of};
  double v[3 * ALL] = {0};
  msim_scene *recipe, *scene;
  assert_ok(msim_scene_create(NULL, &recipe, err));
  assert_ok(msim_scene_add_lattice(recipe, &block, err));
  msim_scene_get(recipe, &of);
  for (int i = 0; i < ALL; i++) v[3 * i] = 0.4;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, ALL, of.x, v, of.mass, err));
  assert_ok(msim_scene_add_springs(scene, of.nsprings, of.ij, of.k, of.rest, of.damping, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  plane(scene, 0, 0, 1, 0, 0, 0.6);
  msim_scene_destroy(recipe);
  return scene;
}

/* side^3 particles fall on a tilted plane, which they hit after a while. */
static msim_scene *falling_block(int32_t side) {
  const double g[3] = {0, 0, -9.81};
  const msim_lattice block = {.size = sizeof block,
                              .n = {side, side, side},
                              .origin = {0, 0, 0.02},
                              .extent = {0.2, 0.2, 0.2},
                              .mass = 1,
                              .k = 2000};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &block, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  plane(scene, 0.1, 0.05, 1, 0, 0.8, 0);
  return scene;
}

static msim_scene *net_over(double floor) {
  msim_scene *scene = hanging_cloth(5, 100, 0);
  if (isfinite(floor)) plane(scene, 0, 0, 1, floor, 0.5, 0);
  return scene;
}

/*------------------------------------- errors ---------------------------------------------------*/

enum { MOST = 3 * 26 };

/* The largest error of a coordinate at the end, over tol */
static double error_of(const msim_scene *scene, double tol, double t_end) {
  const msim_options opt = options_of("auto", tol, t_end);
  const msim_options exact = options_of("dop853", 1e-13, t_end);
  msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &exact);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_ok(msim_sim_run(other, NULL, NULL, err));
  const msim_state s = state_of(sim), t = state_of(other);
  const double most = largest_difference(s.x, t.x, 3 * s.n);
  print_message("  tol %.0e  %-15s error/tol %.2g, %lld evaluations, %lld steps rejected\n", tol,
                sim->config.integrator->entry.name, most / tol,
                (long long)stats_of(sim).force_evaluations,
                (long long)stats_of(sim).rejected_steps);
  msim_sim_destroy(sim), msim_sim_destroy(other);
  return most / tol;
}

/* In a scene of 1 m */
static void few_particles_that_pass_are_accurate(void **state) {
  (void)state;
  const double d[] = {1e-2, 1e-3, 1e-4, 1e-6}, speed[] = {1.2, 2, 3.5};
  for (int i = 0; i < 4; i++)
    for (int k = 0; k < 3; k++) {
      msim_scene *scene = flyby(d[i], speed[k]);
      for (double tol = 1e-3; tol > 1e-9; tol /= 100)
        assert_true(error_of(scene, tol, 2.4 / speed[k]) <= 10);
      msim_scene_destroy(scene);
    }
}

/* With many particles steps are fixed, and some are rejected. */
static void late_events_are_verified(void **state) {
  (void)state;
  const double d[] = {0.02, 0.005, 0.001};
  for (int i = 0; i < 3; i++) {
    msim_scene *scene = net_with_passing_particle(d[i]);
    for (double tol = 1e-4; tol > 1e-8; tol /= 10) assert_true(error_of(scene, tol, 1) <= 10);
    msim_scene_destroy(scene);
  }
}

/* In m, of a block of 0.2 m */
static void a_block_that_lands_keeps_tol(void **state) {
  (void)state;
  msim_scene *scene = falling_block(5);
  for (double tol = 1e-4; tol > 3e-9; tol /= 10) assert_true(error_of(scene, tol, 0.1) <= 2);
  msim_scene_destroy(scene);
}

/* ... or stays on the plane by bounces, which long steps would miss */
static void a_block_that_bounces_keeps_tol(void **state) {
  (void)state;
  msim_scene *scene = bouncing_block();
  for (double tol = 1e-4; tol > 3e-6; tol /= 10) assert_true(error_of(scene, tol, 0.25) <= 2);
  msim_scene_destroy(scene);
}

/*------------------------------------- indicators -----------------------------------------------*/

/* A net of 23 free particles at step 31, which is no multiple of 80, by a method so expensive that
 * the indicators of all steps are computed; velocities times `faster` */
static msim_sim *resume_faster(const msim_scene *scene, const msim_options *opt,
                               const checkpoint *c, double faster) {
  msim_sim *sim = resume(scene, opt, c);
  ms_island_sim *m = sim->islands;
  assert_string_equal(sim->config.integrator->entry.name, "rkn6");
  for (int32_t i = 0; i < m->model.unknowns.dims * m->model.unknowns.stride; i++)
    m->stepper.v[i] *= faster;
  return sim;
}

/* 1 if the next step is verified when steps verified before had these indicators: it then takes
 * three times as many evaluations. */
static int is_verified(msim_sim *sim, double defect, double turn) {
  const int64_t before = stats_of(sim).force_evaluations;
  sim->islands->verification.indicator[0] = defect, sim->islands->verification.indicator[1] = turn;
  assert_ok(msim_sim_step(sim, 1, err));
  const int64_t count = stats_of(sim).force_evaluations - before;
  msim_sim_destroy(sim);
  return count > 20;
}

/* A step is verified if an indicator is three times as large as in steps verified before
 * (rotations: only beyond 0.005 = 1 - cos 6 degrees), and always beyond 0.3 = 1 - cos 45 degrees */
static void indicators_select_verified_steps(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(5, 30, 0);
  const msim_options opt = options_of("auto", 1e-7, 0.6);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 30, err));
  const checkpoint c = save(sim);
  int little = 0, more = 0, large = 0;
  for (double faster = 0.1; faster < 10; faster *= 1.2) {
    ms_step_measurement next;
    msim_sim *same = resume_faster(scene, &opt, &c, faster);
    assert_ok(
        ms_step_verification_measure(same, &same->config.choice.verification.scales, &next, err));
    msim_sim_destroy(same);
    const double defect = next.indicator[0], turn = next.indicator[1];
    if (turn < 0.28) {
#define VERIFIED(d, t) is_verified(resume_faster(scene, &opt, &c, faster), d, t)
      assert_true(VERIFIED(0.33 * defect, INFINITY));
      assert_false(VERIFIED(0.34 * defect, INFINITY));
      assert_int_equal(VERIFIED(INFINITY, 0), turn > 0.005);
      if (turn > 0.005) assert_true(VERIFIED(INFINITY, 0.33 * turn));
      assert_false(VERIFIED(INFINITY, 0.34 * turn));
    } else if (turn > 0.31) assert_true(VERIFIED(INFINITY, INFINITY));
    little += turn > 0.0025 && turn<0.005, more += turn> 0.005 && turn < 0.01;
    large += turn > 0.31 && turn < 0.6;
  }
  assert_true(little && more && large);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  free(c.bytes);
}

/* With steps at the stability limit, the error that they may add is a share of tol, and less than
 * the quarter that an event may add. */
static void what_steps_may_add_goes_like_tol(void **state) {
  (void)state;
  double share[2];
  msim_scene *scene = hanging_cloth(5, 3e4, 0);
  for (int i = 0; i < 2; i++) {
    const double tol = i ? 1e-4 : 1e-2;
    const msim_options opt = options_of("auto", tol, 0.2);
    msim_sim *sim = make_sim(scene, &opt);
    assert_string_equal(sim->config.integrator->entry.name, "velocity-verlet");
    share[i] = sim->config.choice.verification.allowed / tol;
    assert_in_range(share[i] * 1e6, sim->run.h / 0.2 * 1e6, 0.1e6);
    msim_sim_destroy(sim);
  }
  assert_close(share[0], share[1], 1e-9);
  msim_scene_destroy(scene);
}

/*------------------------------------- costs ----------------------------------------------------*/

static int64_t evaluations_of(const msim_scene *scene, const char *method, double tol,
                              double t_end) {
  const msim_options opt = options_of(method, tol, t_end);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  const int64_t count = stats_of(sim).force_evaluations;
  msim_sim_destroy(sim);
  return count;
}

/* Evaluations for the choice, compared with those of a run of some hundred steps */
static void choosing_costs_little(void **state) {
  (void)state;
  const double damping[] = {0, 0.1};
  for (int i = 0; i < 2; i++) {
    msim_scene *scene = hanging_cloth(12, 1000, damping[i]);
    for (double tol = 1e-2; tol > 1e-9; tol /= 100) {
      const msim_options opt = options_of("auto", tol, 0.15);
      msim_sim *sim = make_sim(scene, &opt);
      assert_ok(msim_sim_run(sim, NULL, NULL, err));
      const double price = sim->config.choice.total_cost,
                   work = (double)stats_of(sim).force_evaluations;
      print_message("  tol %.0e  %-15s %3.0f evaluations, for a run of %.0f\n", tol,
                    sim->config.integrator->entry.name, price, work);
      assert_true(price <= 0.22 * work);
      msim_sim_destroy(sim);
    }
    msim_scene_destroy(scene);
  }
}

static void costs_what_control_costs(const msim_scene *scene, const char *name, double tol,
                                     double t_end, double most) {
  const int64_t chosen = evaluations_of(scene, "auto", tol, t_end);
  const int64_t controlled = evaluations_of(scene, "dop853", tol, t_end);
  print_message("  %s, tol %.0e: %lld evaluations, %lld with error control\n", name, tol,
                (long long)chosen, (long long)controlled);
  assert_true((double)chosen <= most * (double)controlled);
}

/* The step that the fastest moment needs is not used all the time. */
static void bursts_cost_as_much_as_error_control(void **state) {
  (void)state;
  for (int32_t n = 6; n <= 20; n += 7)
    for (double tol = 1e-2; tol > 1e-7; tol /= 100) {
      msim_scene *scene = folded_rope(n);
      costs_what_control_costs(scene, "folded rope", tol, 0.6, 1.5);
      msim_scene_destroy(scene);
    }
}

/* Once the end of such a rope has whipped, its fast vibrations are large: the steps of velocity
 * Verlet, at the limit of their stability, are inaccurate from then on. A tolerance of 0.1 is too
 * large for the errors of steps to add up as small ones do. */
static void whips_keep_tol(void **state) {
  (void)state;
  for (int32_t n = 14; n <= 28; n += 7)
    for (double tol = 0.1; tol > 1e-4; tol /= 100) {
      msim_scene *scene = swinging_rope(n, 3e5, 0);
      costs_what_control_costs(scene, "swinging rope", tol, 1.2, 4);
      assert_true(error_of(scene, tol, 1.2) <= 1);
      msim_scene_destroy(scene);
    }
}

/* Almost every step has an event of some particles at the bottom. */
static void sliding_costs_as_much_as_error_control(void **state) {
  (void)state;
  msim_scene *scene = sliding();
  for (double tol = 1e-4; tol > 3e-9; tol /= 10)
    costs_what_control_costs(scene, "sliding block", tol, 0.4, 1.75);
  msim_scene_destroy(scene);
}

/* Steps of velocity Verlet with impacts are of order 2 as all others, so that none is repeated:
 * halves of h quarter the error, which the trial of the choice foresees. */
static void impacts_of_verlet_are_not_repeated(void **state) {
  (void)state;
  msim_scene *scene = falling_block(5);
  for (double tol = 1e-3; tol > 3e-5; tol /= 10) {
    const msim_options opt = options_of("auto", tol, 0.1);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_run(sim, NULL, NULL, err));
    const msim_stats s = stats_of(sim);
    assert_string_equal(sim->config.integrator->entry.name, "velocity-verlet");
    assert_int_equal(sim->config.opt.collision, MSIM_COLLISION_EVENT);
    assert_true(s.contacts > 50);
    assert_int_equal(s.rejected_steps, 0);
    assert_true(s.force_evaluations <= s.steps * sim->config.choice.substeps + 2);
    msim_sim_destroy(sim);
    assert_true(error_of(scene, tol, 0.1) <= 2);
  }
  msim_scene_destroy(scene);
}

/* A step of dop853 that locates impacts takes three times as many evaluations as others. The trial
 * of its error control ends once that costs more than the next best method is expected to. */
static void a_trial_that_costs_too_much_ends(void **state) {
  (void)state;
  msim_scene *scene = falling_block(8);
  const msim_options opt = options_of("auto", 1e-4, 0.2);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  print_message("  %.0f evaluations, for a run of %lld\n", sim->config.choice.total_cost,
                (long long)stats_of(sim).force_evaluations);
  assert_true(sim->config.choice.total_cost < (double)stats_of(sim).force_evaluations);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- planes ---------------------------------------------------*/

/* A plane that is never reached changes no bit. */
static void far_planes_cost_nothing(void **state) {
  (void)state;
  for (double tol = 1e-2; tol > 1e-7; tol /= 100) {
    msim_scene *scene = net_over(-5), *without = net_over(-INFINITY);
    const msim_options opt = options_of("auto", tol, 1);
    msim_sim *sim = make_sim(scene, &opt), *other = make_sim(without, &opt);
    assert_ok(msim_sim_run(sim, NULL, NULL, err));
    assert_ok(msim_sim_run(other, NULL, NULL, err));
    expect_same(sim, other, "far plane");
    msim_sim_destroy(sim), msim_sim_destroy(other);
    msim_scene_destroy(scene), msim_scene_destroy(without);
  }
}

/* Close: reached within a step at twice the speed, 2 h (U + g h) = gap, U the speed scale of the
 * scene or that of the fastest particle, if that is larger */
static void a_plane_is_close_within_a_step(void **state) {
  (void)state;
  const double x[3] = {0, 0, 1}, v[3] = {0, 0, 3}, g = 9.81, fast[3] = {0, 0, 50};
  for (int is_fast = 0; is_fast < 2; is_fast++) {
    msim_scene *scene = make_single_particle(x, v, g);
    const msim_options opt = options_of("auto", 1e-4, 1);
    plane(scene, 0, 0, 1, 0.25, 0.5, 0);
    msim_sim *sim = make_sim(scene, &opt);
    const ms_island_sim *m = sim->islands;
    if (is_fast) ms_unknowns_set(&m->model.unknowns, fast, 0, m->stepper.v);
    const double U = is_fast ? 50 : sim->config.choice.verification.scales.speed;
    const double h = (sqrt(U * U + 2 * g * 0.75) - U) / (2 * g);
    assert_true(U >= 3);
    assert_false(ms_step_verification_is_plane_close(sim, 0.999 * h));
    assert_true(ms_step_verification_is_plane_close(sim, 1.001 * h));
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

typedef struct frames {
  int n;
  double t[300];
} frames;

static int note(msim_sim *sim, void *user) {
  frames *f = user;
  f->t[f->n++] = state_of(sim).t;
  return 0;
}

/* A ball falls, and its impact with the floor is located; frames are at the planned times. */
static void near_planes_count(void **state) {
  (void)state;
  const double x[3] = {0, 0, 1}, v[3] = {0}, g = 9.81, t_end = 0.8, fall = sqrt(2 / g);
  msim_scene *scene = make_single_particle(x, v, g);
  plane(scene, 0, 0, 1, 0, 0.5, 0);
  const msim_options opt = options_of("auto", 1e-6, t_end);
  msim_sim *sim = make_sim(scene, &opt);
  const int64_t planned = ms_frames_count(&sim->config.plan, &sim->config.opt, 300);
  frames here = {0};
  assert_true(sim->config.choice.verification.planes_far);
  assert_ok(msim_sim_run(sim, note, &here, err));
  assert_false(sim->config.choice.verification.planes_far);
  assert_int_equal(stats_of(sim).contacts, 1);
  const double left = t_end - fall;
  assert_close(state_of(sim).x[2], left * (g * fall / 2 - g / 2 * left), 1e-6);
  assert_int_equal(here.n, planned);
  for (int i = 0; i < here.n; i++) assert_close(here.t[i], i * here.t[1], 1e-12);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- bits -----------------------------------------------------*/

/* The whole run, step by step, and resumed in between */
static void expect_one_run(const msim_scene *scene, double tol, double t_end, const char *label) {
  enum { PIECES = 24 };
  const msim_options opt = options_of("auto", tol, t_end);
  msim_sim *whole = make_sim(scene, &opt), *by_step = make_sim(scene, &opt);
  assert_ok(msim_sim_run(whole, NULL, NULL, err));
  const int64_t steps = state_of(whole).step;
  for (int64_t i = 0; i < steps; i++) {
    assert_ok(msim_sim_step(by_step, 1, err));
    if (i % (1 + steps / PIECES)) continue;
    const checkpoint c = save(by_step);
    msim_sim *resumed = resume(scene, &opt, &c);
    assert_ok(msim_sim_run(resumed, NULL, NULL, err));
    expect_same(whole, resumed, label);
    msim_sim_destroy(resumed);
    free(c.bytes);
  }
  expect_same(whole, by_step, label);
  msim_sim_destroy(whole), msim_sim_destroy(by_step);
}

static void pieces_make_the_same_run(void **state) {
  (void)state;
  const double x[3] = {0, 0, 1}, v[3] = {0};
  msim_scene *const scenes[] = {net_with_passing_particle(0.005), net_over(-0.5),
                                make_single_particle(x, v, 9.81)};
  plane(scenes[2], 0, 0, 1, 0, 0.5, 0);
  for (int i = 0; i < 3; i++) {
    for (double tol = 1e-2; tol > 1e-7; tol /= 100) expect_one_run(scenes[i], tol, 0.8, "auto");
    msim_scene_destroy(scenes[i]);
  }
  msim_scene *slides = sliding(); /* most steps in parts */
  expect_one_run(slides, 1e-7, 0.1, "sliding");
  msim_scene_destroy(slides);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(few_particles_that_pass_are_accurate),
                                     cmocka_unit_test(late_events_are_verified),
                                     cmocka_unit_test(a_block_that_lands_keeps_tol),
                                     cmocka_unit_test(a_block_that_bounces_keeps_tol),
                                     cmocka_unit_test(indicators_select_verified_steps),
                                     cmocka_unit_test(what_steps_may_add_goes_like_tol),
                                     cmocka_unit_test(choosing_costs_little),
                                     cmocka_unit_test(bursts_cost_as_much_as_error_control),
                                     cmocka_unit_test(whips_keep_tol),
                                     cmocka_unit_test(sliding_costs_as_much_as_error_control),
                                     cmocka_unit_test(impacts_of_verlet_are_not_repeated),
                                     cmocka_unit_test(a_trial_that_costs_too_much_ends),
                                     cmocka_unit_test(far_planes_cost_nothing),
                                     cmocka_unit_test(a_plane_is_close_within_a_step),
                                     cmocka_unit_test(near_planes_count),
                                     cmocka_unit_test(pieces_make_the_same_run)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
