/* Tests of wrong calls: one message names the offending argument, and nothing changes. */
#include <math.h>
#include <string.h>

#include "scenes.h"

static void assert_says(const msim_error *why, const char *sentence) {
  if (!strstr(why->text, sentence)) fail_msg("\"%s\" lacks \"%s\"", why->text, sentence);
}

/*------------------------------------- states ---------------------------------------------------*/

enum { N = 3 };

/* Each of these states is refused; particle 0 is pinned. */
static void want_no_particle(msim_state *s) { s->n--; }
static void want_no_x(msim_state *s) { s->x = NULL; }
static void want_no_v(msim_state *s) { s->v = NULL; }
static void want_no_time(msim_state *s) { s->t = INFINITY; }
static void want_an_early_step(msim_state *s) { s->step = -1; }
static void want_endless_work(msim_state *s) { s->work = INFINITY; }
static void want_nan(msim_state *s) { ((double *)s->x)[5] = NAN; }
static void want_infinity(msim_state *s) { ((double *)s->v)[8] = -INFINITY; }
static void want_moved_pins(msim_state *s) { ((double *)s->x)[1] += 1e-9; }
static void want_moving_pins(msim_state *s) { ((double *)s->v)[2] = 1; }

static void states_that_cannot_be(void **state) {
  (void)state;
  static const struct {
    void (*spoil)(msim_state *);
    const char *sentence;
  } cases[] = {{want_no_particle, "the state has 2 particles, but the scene has 3"},
               {want_no_x, "the state has no x or no v"},
               {want_no_v, "the state has no x or no v"},
               {want_no_time, "the state's t must be finite and its step >= 0"},
               {want_an_early_step, "the state's t must be finite and its step >= 0"},
               {want_endless_work, "the state's work is inf; it must be finite"},
               {want_nan, "x, v or v_half of particle 1 is not finite, or too large"},
               {want_infinity, "x, v or v_half of particle 2 is not finite, or too large"},
               {want_moved_pins,
                "particle 0 is pinned: its x must be that of the scene, and its v must be 0"},
               {want_moving_pins,
                "particle 0 is pinned: its x must be that of the scene, and its v must be 0"}};
  const double x[3 * N] = {0, 0, 0, 1, 0, 0, 2, 0, 0}, mass[N] = {1, 1, 1}, k[N - 1] = {9, 9};
  const int32_t ij[2 * (N - 1)] = {0, 1, 1, 2}, pinned = 0;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, N, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, N - 1, ij, k, NULL, NULL, err));
  assert_ok(msim_scene_pin(scene, 1, &pinned, err));
  const msim_options opt = options("velocity-verlet", 0.01);
  msim_sim *sim = make_sim(scene, &opt);
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    double place[3 * N], speed[3 * N] = {0};
    msim_error why;
    memcpy(place, x, sizeof x);
    msim_state s = {.size = sizeof s, .step = 7, .t = 3, .n = N, .x = place, .v = speed};
    place[8] = speed[8] = 0.5;
    cases[i].spoil(&s);
    assert_int_equal(msim_sim_set_state(sim, &s, &why), MSIM_ERR_ARG);
    assert_says(&why, cases[i].sentence);
    const msim_state now = state_of(sim);
    assert_true(now.step == 0 && now.t == 0 && now.v[8] == 0);
    assert_memory_equal(now.x, x, sizeof x);
  }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- runs -----------------------------------------------------*/

static msim_scene *flight(double v) {
  return make_single_particle((double[]){0, 0, 1}, (double[]){v, 0, 0}, 9.81);
}

static void refuse(const msim_options *opt, msim_status status, const char *sentence) {
  msim_scene *scene = flight(0);
  msim_sim *sim = (msim_sim *)&scene;
  msim_error why;
  assert_int_equal(msim_sim_create(scene, opt, &sim, &why), status);
  assert_null(sim);
  assert_says(&why, sentence);
  msim_scene_destroy(scene);
}

static void ends_that_no_run_reaches(void **state) {
  (void)state;
  msim_options opt = options("velocity-verlet", 0.01);
  opt.steps = INT64_MAX;
  refuse(&opt, MSIM_ERR_ARG, "steps = 9223372036854775807 exceeds the limit 4.5036e+15");
  opt.steps = 1000000000, opt.h = 1e300;
  refuse(&opt, MSIM_ERR_ARG,
         "1000000000 steps of 1e+300 s: the end time is not a finite number; use fewer steps or a "
         "smaller h");
  opt.steps = -1, opt.t_end = 1, opt.h = 1e-20;
  refuse(&opt, MSIM_ERR_ARG,
         "t_end / h = 1e+20 steps exceeds the limit 4.5036e+15; use a larger h or an earlier "
         "t_end");
  opt.h = 0.01, opt.tol = 1e-6, opt.fps = 1e9;
  refuse(&opt, MSIM_ERR_ARG,
         "fps = 1e+09 requires 1e+09 frames, and the limit is 10000000; use a lower fps");
}

/* A program that does not call msim_options_init has no size, and no defaults. */
static void options_of_no_size(void **state) {
  (void)state;
  refuse(&(msim_options){.integrator = "verlet"}, MSIM_ERR_SIZE,
         "options.size is 0: call msim_options_init first");
}

/*------------------------------------- recordings -----------------------------------------------*/

static void recordings_of_nothing(void **state) {
  (void)state;
  msim_scene *scene = flight(0);
  msim_options opt = options("verlet", 0.1);
  opt.steps = 1;
  msim_sim *sim = make_sim(scene, &opt);
  msim_recorder *recorder;
  msim_error why;
  assert_int_equal(msim_recorder_open(NULL, "a.csv", &recorder, &why), MSIM_ERR_ARG);
  assert_int_equal(msim_recorder_open(sim, NULL, &recorder, &why), MSIM_ERR_ARG);
  assert_int_equal(msim_recorder_open(sim, "a.csv", NULL, &why), MSIM_ERR_ARG);
  assert_says(&why, "sim, path or recorder is NULL");
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- names ----------------------------------------------------*/

static void what_is_built_in_has_no_backend(void **state) {
  (void)state;
  static const char *const names[] = {"pcg", "auto"};
  const msim_backend *backend;
  msim_error why;
  for (int i = 0; i < 2; i++) {
    assert_int_equal(msim_solver_backend(names[i], NULL, &backend, &why), MSIM_ERR_NAME);
    assert_says(&why, "is built into msim and has no function table");
    assert_says(&why, names[i]);
  }
}

static void each_status_has_a_text(void **state) {
  (void)state;
#define CHECK(name, value, text) assert_string_equal(msim_status_text(name), text);
  MSIM_STATUS_LIST(CHECK)
  assert_string_equal(msim_status_text(MSIM_STATUS_END_), "unknown status");
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(states_that_cannot_be),  cmocka_unit_test(ends_that_no_run_reaches),
      cmocka_unit_test(options_of_no_size),     cmocka_unit_test(recordings_of_nothing),
      cmocka_unit_test(each_status_has_a_text), cmocka_unit_test(what_is_built_in_has_no_backend)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
