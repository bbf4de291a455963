/* Tests of the pilot run of integrator = auto: how far it goes without planes and to an impact,
 * from where methods are tried, and which scenes have many particles. */
#include <math.h>

#include "auto_scenes.h"
#include "choose/pilot_run.h"
#include "contact/impact_location.h"
#include "methods/methods.h"

#define GRAVITY 9.81

/* A run of so many steps of the pilot run. Its parts have round(STEPS/64) = 5 steps, and its half
 * round(STEPS/16) = 19, no multiple. */
enum { STEPS = 300, PART = 5, HALF = 19 };

/* The step of the pilot run of a dumbbell of two particles of 1 kg: omega^2 = 2 k */
#define STEP (MS_STABLE_FRACTION * 2 / sqrt(2 * 1000.))

typedef struct fall {
  msim_scene *scene;
  msim_sim *sim;
  ms_pilot_run run;
} fall;

/* The pilot run of a level dumbbell that starts at height z with velocity v and falls
 * onto the plane z = 0 */
static void set_up(double z, double v, fall *f) {
  const double x[6] = {0, 0, z, 1, 0, z}, speed[6] = {0, 0, v, 0, 0, v}, mass[2] = {1, 1};
  const double k = 1000, rest = 1, g[3] = {0, 0, -GRAVITY};
  const int32_t ij[2] = {0, 1};
  const msim_options opt = options_of("auto", 1e-2, STEPS * STEP);
  assert_ok(msim_scene_create(NULL, &f->scene, err));
  assert_ok(msim_scene_add_particles(f->scene, 2, x, speed, mass, err));
  assert_ok(msim_scene_add_springs(f->scene, 1, ij, &k, &rest, NULL, err));
  assert_ok(msim_scene_set_gravity(f->scene, g, err));
  plane(f->scene, 0, 0, 1, 0, 0.5, 0);
  f->sim = make_sim(f->scene, &opt);
  const msim_state start = state_of(f->sim);
  assert_ok(ms_pilot_run_begin(f->sim, opt.tol, 0, &start, &f->run, err));
  assert_ok(ms_pilot_run_make(&f->run, err));
}

static void tear_down(fall *f) {
  ms_pilot_run_end(&f->run);
  msim_sim_destroy(f->sim);
  msim_scene_destroy(f->scene);
}

static void assert_steps(double time, int steps) { assert_close(time, steps * STEP, 1e-9); }

/* It ends with the part of the impact. Methods are tried from the start of that part. */
static void it_ends_with_the_part_of_an_impact(void **state) {
  (void)state;
  /* the first at a time that is a multiple of HALF, too, and before the part ends */
  const int impacts[] = {3 * HALF - 1, 66};
  for (size_t i = 0; i < sizeof impacts / sizeof *impacts; i++) {
    const double t = (impacts[i] - 0.5) * STEP, z = GRAVITY * t * t / 2;
    const int began = impacts[i] / PART * PART, end = began + PART;
    fall f;
    set_up(z, 0, &f);
    assert_true(f.run.met_plane && f.run.planes_count);
    assert_steps(f.run.duration, end);
    assert_steps(f.run.span - f.run.remaining, began);
    const double fallen = GRAVITY * pow(began * STEP, 2) / 2;
    assert_close(f.run.end.x[2], z - fallen, 1e-9 * z);
    assert_close(f.run.end.v[2], -GRAVITY * began * STEP, 1e-9 * GRAVITY * t);
    assert_true(f.run.middle.v[2] > f.run.end.v[2]); /* after the impact */
    tear_down(&f);
  }
}

/* A plane that is close at the start counts: the pilot run goes on to an impact in mid-run. */
static void it_goes_on_to_an_impact_where_a_plane_is_close(void **state) {
  (void)state;
  const int impact = STEPS / 2;
  fall f;
  set_up(1e-6, GRAVITY * impact * STEP / 2, &f);
  assert_true(f.run.met_plane && f.run.planes_count);
  assert_true(f.run.duration > impact * STEP && f.run.duration < (impact + 2 * PART) * STEP);
  tear_down(&f);
}

/* A plane that is far counts only if the impact is in the first third of the run. */
static void far_planes_do_not_count(void **state) {
  (void)state;
  const double t = STEPS * STEP / 2, z = GRAVITY * t * t / 2;
  fall f;
  set_up(z, 0, &f);
  assert_true(!f.run.met_plane && !f.run.planes_count);
  assert_steps(f.run.duration, 2 * HALF);
  assert_close(f.run.remaining, f.run.span, 0);
  const double half = HALF * STEP;
  assert_close(f.run.middle.x[2], z - GRAVITY * half * half / 2, 1e-9 * z);
  assert_close(f.run.end.x[2], z - 2 * GRAVITY * half * half, 1e-9 * z);
  tear_down(&f);
}

/* Fewer than 12 free particles are few, 64 are many. */
static void free_particles_are_counted(void **state) {
  (void)state;
  static const struct {
    int n, few, many;
  } row[] = {{12, 1, 0}, {13, 0, 0}, {64, 0, 0}, {65, 0, 1}}; /* one is pinned */
  for (size_t i = 0; i < sizeof row / sizeof *row; i++) {
    msim_scene *scene = swinging_rope(row[i].n, 500, 0);
    const msim_options opt = options_of("velocity-verlet", 0, 0.01);
    msim_sim *sim = make_sim(scene, &opt);
    const msim_state start = state_of(sim);
    ms_pilot_run run;
    assert_ok(ms_pilot_run_begin(sim, 1e-2, 0, &start, &run, err));
    assert_int_equal(run.few, row[i].few);
    assert_int_equal(run.many, row[i].many);
    ms_pilot_run_end(&run);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* Error control is tried after an impact, or else from the end. */
static void error_control_starts_late(void **state) {
  (void)state;
  const double t = STEPS * STEP / 2, z = GRAVITY * t * t / 2;
  for (int impact = 0; impact < 2; impact++) {
    fall f;
    set_up(impact ? 1e-3 * z : z, 0, &f);
    assert_int_equal(f.run.planes_count, impact);
    const ms_trial trial = {
        .method = &ms_dop853, .collision = MSIM_COLLISION_EVENT, .tol = 1e-3, .h = STEP};
    msim_sim *sim;
    assert_ok(ms_pilot_run_start_late(&f.run, &trial, &sim, err));
    assert_close(state_of(sim).x[2], (impact ? f.run.middle : f.run.end).x[2], 0);
    assert_close(sim->run.control.tol, 1e-3, 0);
    assert_close(sim->run.control.span, f.run.span, 0);
    tear_down(&f);
  }
}

/* Evaluations that the paths of both particles cost in a step: each is computed twice, and is as
 * expensive as 80 springs. */
enum { PATHS = 2 * 2 * 80 };

/* A trial ends with the first of its steps of h that exceeds the evaluations it may take. */
static void expensive_trials_end(void **state) {
  (void)state;
  const ms_trial whole = {&ms_velocity_verlet, MSIM_COLLISION_EVENT, 2, 0, STEP, 0};
  double error, step_cost;
  fall f;
  set_up(1e-3, 0, &f);
  const double steps = ms_pilot_run_trial_steps(&f.run, STEP);
  const double most[] = {0, 1e6, 5};
  for (int limit = 0; limit < 3; limit++) {
    const double before = f.run.cost;
    ms_trial trial = whole;
    trial.most = most[limit];
    assert_ok(ms_pilot_run_try_method(&f.run, &trial, &error, &step_cost, err));
    const double cost = f.run.cost - before;
    if (limit < 2) assert_true(error < INFINITY && cost >= 3 * steps);
    else assert_true(error == INFINITY && cost > 5 && cost <= 5 + 2 + PATHS);
  }
  tear_down(&f);
}

/* The end of a step of rk4 that is too long to be divided at impacts is corrected along the path of
 * each particle that meets the plane. */
static void paths_of_other_methods_count(void **state) {
  (void)state;
  fall f;
  set_up(GRAVITY * STEP * STEP / 8, 0, &f);
  msim_options opt = options_of("rk4", 0, STEP);
  opt.h = STEP, opt.collision = MSIM_COLLISION_EVENT;
  assert_true(STEP > ms_impact_location_longest_step(&ms_rk4, sqrt(2 * 1000.)));
  msim_sim *sim = make_sim(f.scene, &opt);
  assert_ok(msim_sim_step(sim, 1, err));
  assert_int_equal(stats_of(sim).contacts, 2);
  assert_int_equal(sim->islands->stepper.paths, 2);
  msim_sim_destroy(sim);
  tear_down(&f);
}

/* Two particles rest on the plane. */
static void paths_count(void **state) {
  (void)state;
  fall f;
  set_up(0, 0, &f);
  msim_options opt = options_of("velocity-verlet", 0, STEP);
  opt.h = STEP, opt.collision = MSIM_COLLISION_EVENT;
  msim_sim *sim = make_sim(f.scene, &opt);
  assert_ok(msim_sim_step(sim, 1, err));
  assert_int_equal(sim->islands->stepper.paths, 2 * 2);
  const double sweeps = (double)stats_of(sim).spring_evaluations;
  assert_close(ms_pilot_run_count_work(sim), sweeps + PATHS, 0);
  msim_sim_destroy(sim);
  tear_down(&f);
}

static ms_pilot_run make_run(const msim_scene *scene) {
  const msim_options opt = options_of("velocity-verlet", 0, 0.3);
  msim_sim *sim = make_sim(scene, &opt);
  const msim_state start = state_of(sim);
  ms_pilot_run run;
  assert_ok(ms_pilot_run_begin(sim, 1e-2, 0, &start, &run, err));
  assert_ok(ms_pilot_run_make(&run, err));
  ms_pilot_run_end(&run);
  msim_sim_destroy(sim);
  return run;
}

/* The growth of errors counts twice unless damping is strong, and errors of order 2 do so again. */
static void errors_grow_most_where_damping_is_weak(void **state) {
  (void)state;
  const double damping[] = {0, 1e-9, 3};
  double growth[3];
  for (int i = 0; i < 3; i++) {
    msim_scene *scene = hanging_cloth(9, 93, damping[i]);
    const ms_pilot_run run = make_run(scene);
    growth[i] = ms_pilot_run_growth(&run, 4);
    assert_close(ms_pilot_run_growth(&run, 2), 2 * growth[i], 1e-12);
    msim_scene_destroy(scene);
  }
  print_message("  growth %.3g, weakly damped %.3g, strongly %.3g\n", growth[0], growth[1],
                growth[2]);
  assert_true(growth[0] > 4);
  assert_close(growth[1], growth[0], 0.01);
  assert_true(growth[2] > 2 && growth[2] <= 4);
}

/* Where the motion has just begun it counts once for orders above 2, and is at most fourfold. */
static void errors_of_high_order_grow_less_at_a_start_from_rest(void **state) {
  (void)state;
  msim_scene *started = hanging_cloth(9, 1e4, 0), *starts = hanging_cloth(9, 1e5, 0);
  const ms_pilot_run first = make_run(started), last = make_run(starts);
  assert_false(first.has_just_begun);
  assert_true(first.step_growth > 3 && first.step_growth < 4);
  assert_close(ms_pilot_run_growth(&first, 3), pow(first.step_growth, 2), 1e-12);
  assert_true(last.has_just_begun);
  assert_close(ms_pilot_run_growth(&last, 2), 2 * 4 * 4, 0);
  assert_close(ms_pilot_run_growth(&last, 3), 4, 0);
  assert_close(ms_pilot_run_growth(&last, 8), 4, 0);
  msim_scene_destroy(started), msim_scene_destroy(starts);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(it_ends_with_the_part_of_an_impact),
      cmocka_unit_test(it_goes_on_to_an_impact_where_a_plane_is_close),
      cmocka_unit_test(far_planes_do_not_count),
      cmocka_unit_test(free_particles_are_counted),
      cmocka_unit_test(error_control_starts_late),
      cmocka_unit_test(expensive_trials_end),
      cmocka_unit_test(paths_of_other_methods_count),
      cmocka_unit_test(paths_count),
      cmocka_unit_test(errors_grow_most_where_damping_is_weak),
      cmocka_unit_test(errors_of_high_order_grow_less_at_a_start_from_rest)};
  return cmocka_run_group_tests_name("pilot_run", tests, NULL, NULL);
}
