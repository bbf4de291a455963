/* Tests of the energy monitor: what it accepts, what it ends, and the state that remains. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "scenes.h"
#include "sim/sim.h"

enum { SIDE = 8, N = SIDE * SIDE };

static double moving_energy(msim_sim *sim) {
  msim_energy e = {.size = sizeof e};
  msim_sim_energy(sim, &e);
  return e.kinetic + e.elastic;
}

/* Two particles 1 m apart whose spring is stretched or compressed; omega = 1/s. */
static msim_scene *pair(double rest) {
  const double x[6] = {0, 0, 0, 1, 0, 0}, mass[2] = {2, 2}, k = 1;
  const int32_t ij[2] = {0, 1};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  return scene;
}

/*------------------------------------- unstable runs --------------------------------------------*/

/* Steps until the status is not 0. first: the first step with more than 100 times the initial
 * energy, -1: none. */
static msim_status run_out(msim_sim *sim, int most, int64_t *first, int64_t *reported,
                           msim_error *why) {
  const double allowed = 100 * moving_energy(sim);
  msim_status status = MSIM_OK;
  *first = -1;
  for (int i = 0; i < most && !status; i++) {
    const int64_t step = state_of(sim).step;
    *reported = step + 1;
    status = msim_sim_step(sim, 1, why);
    if (!status && *first < 0 && moving_energy(sim) > allowed) *first = state_of(sim).step;
  }
  return status;
}

/* Just above the limit z = 2, and far above. */
static void growth_is_found_soon(void **state) {
  (void)state;
  const double z[] = {2.0001, 2.01, 2.1, 2.5, 3};
  for (size_t i = 0; i < sizeof z / sizeof *z; i++) {
    msim_scene *scene = pair(0.5);
    msim_options opt = options("velocity-verlet", z[i]);
    msim_sim *sim = make_sim(scene, &opt);
    msim_error why;
    int64_t first, reported;
    assert_int_equal(run_out(sim, 5000, &first, &reported, &why), MSIM_UNSTABLE);
    assert_true(first > 0 && reported - first <= 160);
    char where[64];
    snprintf(where, sizeof where, "step %lld, t = ", (long long)reported);
    assert_true(strncmp(why.text, where, strlen(where)) == 0);
    assert_non_null(strstr(why.text, "particle "));
    assert_non_null(strstr(why.text, "energy"));
    const msim_state s = state_of(sim);
    assert_true(s.step < first && s.step % 160 == 0);
    assert_true(moving_energy(sim) <= 100 * 0.125);
    snprintf(where, sizeof where, "the state of step %lld was restored", (long long)s.step);
    assert_non_null(strstr(why.text, where));
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

static void assert_shown(msim_sim *sim, const double *x, const double *v) {
  const msim_state s = state_of(sim);
  assert_int_equal(s.step, 0);
  assert_memory_equal(s.x, x, 3 * N * sizeof *x);
  assert_memory_equal(s.v, v, 3 * N * sizeof *v);
}

/* The last good state is returned, the same steps end in the same way, and a shorter step goes
 * on. */
static void the_last_good_state_is_restored(void **state) {
  (void)state;
  for (int32_t m = 0; method_at(m); m++) {
    if (is_implicit(method_at(m))) continue;
    msim_scene *scene = hanging_cloth(SIDE, 1e6, takes_positions_only(method_at(m)) ? 0 : 1);
    msim_options opt = options(method_at(m), 0.05);
    msim_error why, again;
    msim_sim *sim = make_sim(scene, &opt);
    double x[3 * N], v[3 * N];
    memcpy(x, state_of(sim).x, sizeof x);
    memcpy(v, state_of(sim).v, sizeof v);
    const msim_status status = msim_sim_step(sim, 1000, &why);
    assert_true(status == MSIM_UNSTABLE || status == MSIM_NOT_FINITE);
    assert_non_null(strstr(why.text, "the state of step 0 was restored"));
    assert_shown(sim, x, v);
    assert_int_equal(msim_sim_step(sim, 1000, &again), status);
    assert_string_equal(why.text, again.text);
    assert_shown(sim, x, v);
    assert_ok(msim_sim_set_step(sim, 1e-6, err));
    assert_ok(msim_sim_step(sim, 10, err));
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* A jump that is over after one step, which occasional checks would miss. */
static void each_implicit_step_is_checked(void **state) {
  (void)state;
  const double x[6] = {-0.5, 0, 0, 0.5, 0, 0}, v[6] = {0, -2.5, 0, 0, 2.5, 0}, mass[2] = {1, 1};
  const double k = 1e6;
  const int32_t ij[2] = {0, 1};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, NULL, NULL, err));
  msim_options opt = options("linearly-implicit-euler", 0.2);
  opt.watch = MSIM_WATCH_OFF;
  msim_sim *sim = make_sim(scene, &opt);
  const double start = moving_energy(sim);
  assert_ok(msim_sim_step(sim, 1, err));
  assert_true(moving_energy(sim) > 100 * start);
  assert_ok(msim_sim_step(sim, 200, err));
  assert_true(moving_energy(sim) < start);
  msim_sim_destroy(sim);
  opt.watch = MSIM_WATCH_ON;
  sim = make_sim(scene, &opt);
  assert_int_equal(msim_sim_step(sim, 200, NULL), MSIM_UNSTABLE);
  assert_int_equal(state_of(sim).step, 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static int look(msim_sim *sim, void *user) {
  double *most = user;
  *most = fmax(*most, moving_energy(sim));
  return 0;
}

/* A callback for frames never receives a state that is reported afterwards. */
static void frames_are_good(void **state) {
  (void)state;
  const int every[] = {1, 7, 50, 1000};
  for (size_t i = 0; i < sizeof every / sizeof *every; i++) {
    msim_scene *scene = pair(0.5);
    msim_options opt = options("velocity-verlet", 2.1);
    opt.steps = 1000, opt.every = every[i];
    msim_sim *sim = make_sim(scene, &opt);
    const double start = moving_energy(sim);
    double most = 0;
    assert_int_equal(msim_sim_run(sim, look, &most, NULL), MSIM_UNSTABLE);
    assert_true(most > 0 && most <= 100 * start);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* The end of a run is checked, too. */
static void the_end_of_a_run_is_checked(void **state) {
  (void)state;
  msim_scene *scene = pair(0.5);
  msim_options opt = options("velocity-verlet", 4);
  opt.steps = 5;
  msim_sim *sim = make_sim(scene, &opt);
  assert_int_equal(msim_sim_step(sim, 5, NULL), MSIM_UNSTABLE);
  assert_int_equal(state_of(sim).step, 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A method that displaces the first unknown along x in the step of that number */
static struct {
  const ms_integrator *real;
  int64_t at, steps;
  double by;
} jump;

static msim_status jumping_step(ms_stepper *s, msim_error *err) {
  const msim_status status = jump.real->step(s, err);
  if (++jump.steps == jump.at) s->x_next[0] += jump.by, s->finite = 0;
  return status;
}

static ms_integrator make_jump(msim_sim *sim, int64_t at, double by) {
  ms_integrator method = *sim->config.integrator;
  jump.real = sim->config.integrator, jump.at = at, jump.by = by, jump.steps = 0;
  method.step = jumping_step;
  return method;
}

/* Without springs this does not change the energy. The extent L0 = 1 m may become 100 (L0 + 2 t
 * sqrt(2 S/m)) = 900 m, with S = 2 J of one of the masses m = 1 kg and t = 2 s after the start,
 * whatever the time of the start. */
static void a_jump_without_energy_is_found(void **state) {
  (void)state;
  const double x[6] = {0, 0, 0, 0, 1, 0}, v[6] = {0, 2, 0}, mass[2] = {1, 1};
  const double start[2] = {0, 64};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
  for (int i = 0; i < 4; i++) {
    const int is_far = i % 2;
    const msim_state from = {.size = sizeof from, .t = start[i / 2], .n = 2, .x = x, .v = v};
    msim_options opt = options("velocity-verlet", 0.5);
    opt.steps = 4;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_set_state(sim, &from, err));
    const ms_integrator method = make_jump(sim, 2, is_far ? 901 : 899);
    msim_error why = {0};
    sim->config.integrator = &method;
    assert_int_equal(msim_sim_step(sim, 4, &why), is_far ? MSIM_UNSTABLE : MSIM_OK);
    if (is_far)
      assert_non_null(
          strstr(why.text, "particle 0: the run is unstable: the extent of the scene is "));
    if (is_far) assert_memory_equal(state_of(sim).x, x, sizeof x);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

/* The next steps are those of a new sim from the state that was returned. */
static void an_implicit_run_goes_on_from_there(void **state) {
  (void)state;
  for (int32_t m = 0; method_at(m); m++) {
    double x[3 * N], v[3 * N];
    if (!is_implicit(method_at(m))) continue;
    msim_scene *scene = hanging_cloth(SIDE, 100, 0);
    msim_options opt = options(method_at(m), 0.01);
    opt.solver = "pcg";
    msim_sim *sim = make_sim(scene, &opt), *fresh = make_sim(scene, &opt);
    const ms_integrator method = make_jump(sim, 5, 1e6);
    sim->config.integrator = &method;
    assert_int_equal(msim_sim_step(sim, 10, NULL), MSIM_UNSTABLE);
    msim_state s = state_of(sim);
    assert_int_equal(s.step, 4);
    memcpy(x, s.x, sizeof x), memcpy(v, s.v, sizeof v);
    s.x = x, s.v = v;
    assert_ok(msim_sim_set_state(fresh, &s, err));
    assert_ok(msim_sim_step(sim, 6, err));
    assert_ok(msim_sim_step(fresh, 6, err));
    assert_memory_equal(state_of(sim).x, state_of(fresh).x, sizeof x);
    assert_memory_equal(state_of(sim).v, state_of(fresh).v, sizeof v);
    msim_sim_destroy(sim), msim_sim_destroy(fresh);
    msim_scene_destroy(scene);
  }
}

/* A start without energy: rounding is accepted, growth from it is not. */
static void a_start_without_energy_stays_bounded(void **state) {
  (void)state;
  const char *const methods[] = {"velocity-verlet", "linearly-implicit-euler", "dop853"};
  for (int m = 0; m < 3; m++)
    for (int too_long = 0; too_long < 2; too_long++) {
      const double turned[6] = {0.1, 0.2, 0.3, 0.7, 1.3, 2.1}, mass[2] = {2, 2}, k = 1;
      const double rest = 1.96723155729060109 * (1 + 1e-15);
      const int32_t ij[2] = {0, 1};
      msim_scene *scene;
      assert_ok(msim_scene_create(NULL, &scene, err));
      assert_ok(msim_scene_add_particles(scene, 2, turned, NULL, mass, err));
      assert_ok(msim_scene_add_springs(scene, 1, ij, &k, m ? NULL : &rest, NULL, err));
      msim_options opt = options(methods[m], too_long ? 2.5 : 1.5);
      msim_sim *sim = make_sim(scene, &opt);
      const msim_status status = msim_sim_step(sim, 2000, NULL);
      assert_int_equal(status, too_long && m == 0 ? MSIM_UNSTABLE : MSIM_OK);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

/*------------------------------------- accepted motion ------------------------------------------*/

/* Falling, bouncing, hanging, folding and thrown bodies are accepted. */
static void exact_motion_passes(void **state) {
  (void)state;
  const double at[3] = {0, 0, 0}, up[3] = {0, 0, 3}, fast[3] = {1e6, 0, 0}, still[3] = {0};
  const double *const starts[] = {still, up, fast};
  for (int i = 0; i < 6; i++) {
    msim_scene *scene = make_single_particle(at, starts[i % 3], 9.81);
    if (i >= 3) plane(scene, 0, 0, 1, -2, 1, 0);
    msim_options opt = options("velocity-verlet", 1e-3);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 100000, err));
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
  msim_scene *scene = hanging_cloth(SIDE, 100, 0);
  msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 20000, err));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Springs that are set anew may add energy. */
static void new_springs_are_a_new_start(void **state) {
  (void)state;
  const double stiff = 1e6;
  msim_scene *scene = pair(0.999);
  msim_options opt = options("velocity-verlet", 1e-4);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 1, err));
  assert_ok(msim_sim_set_springs(sim, &stiff, NULL, NULL, err));
  assert_ok(msim_sim_step(sim, 10000, err));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* The monitor changes no bit, and its message does not depend on threads. */
static void bits_are_the_same(void **state) {
  (void)state;
  static double x[3 * N], v[3 * N];
  for (int32_t m = 0; method_at(m); m++) {
    msim_error first = {0};
    for (int i = 0; i < 4; i++) {
      msim_scene *scene = hanging_cloth(SIDE, 1000, 0);
      const int unstable = i >= 2;
      msim_options opt = options(method_at(m), unstable ? 0.05 : 1e-4);
      opt.watch = i == 1 ? MSIM_WATCH_OFF : MSIM_WATCH_ON, opt.threads = i % 2 ? 2 : 1;
      msim_sim *sim = make_sim(scene, &opt);
      msim_error why;
      const msim_status status = msim_sim_step(sim, 300, &why);
      const msim_state s = state_of(sim);
      if (!unstable) assert_int_equal(status, MSIM_OK);
      if (i % 2) {
        assert_memory_equal(x, s.x, sizeof x), assert_memory_equal(v, s.v, sizeof v);
        if (unstable) assert_string_equal(first.text, why.text);
      }
      memcpy(x, s.x, sizeof x), memcpy(v, s.v, sizeof v), first = why;
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
  }
}

/*------------------------------------- NaN and infinity -----------------------------------------*/

/* Detected in the step in which it occurs; the message names the offending spring. */
static void a_spring_is_named(void **state) {
  (void)state;
  const double x[9] = {0, 0, 0, 1, 0, 0, 2, 0, 0}, mass[3] = {1, 1, 1}, k[2] = {1, 1e300};
  const double rest[2] = {1, 0.5};
  const int32_t ij[4] = {0, 1, 1, 2}, held = 2;
  for (int32_t m = 0; method_at(m); m++) {
    msim_scene *scene;
    assert_ok(msim_scene_create(NULL, &scene, err));
    assert_ok(msim_scene_add_particles(scene, 3, x, NULL, mass, err));
    assert_ok(msim_scene_add_springs(scene, 2, ij, k, rest, NULL, err));
    assert_ok(msim_scene_pin(scene, 1, &held, err));
    msim_options opt = options(method_at(m), 0.1);
    msim_sim *sim;
    msim_error why;
    msim_status status = msim_sim_create(scene, &opt, &sim, &why);
    if (!status && !is_implicit(method_at(m)) && strcmp(method_at(m), "takahashi-imada")) {
      assert_int_equal(msim_sim_step(sim, 1, &why), MSIM_NOT_FINITE);
      assert_true(strncmp(why.text, "step 1, t = 0.1 s, particle ", 28) == 0);
      assert_int_equal(stats_of(sim).rejected_steps, 0); /* no retries in parts */
      if (strstr(why.text, "particle 1")) assert_non_null(strstr(why.text, "particle 1, spring 1"));
    }
    assert_memory_equal(state_of(sim).x, x, sizeof x);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(growth_is_found_soon),
                                     cmocka_unit_test(the_last_good_state_is_restored),
                                     cmocka_unit_test(each_implicit_step_is_checked),
                                     cmocka_unit_test(frames_are_good),
                                     cmocka_unit_test(the_end_of_a_run_is_checked),
                                     cmocka_unit_test(a_jump_without_energy_is_found),
                                     cmocka_unit_test(an_implicit_run_goes_on_from_there),
                                     cmocka_unit_test(a_start_without_energy_stays_bounded),
                                     cmocka_unit_test(exact_motion_passes),
                                     cmocka_unit_test(new_springs_are_a_new_start),
                                     cmocka_unit_test(bits_are_the_same),
                                     cmocka_unit_test(a_spring_is_named)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
