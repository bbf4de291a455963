/* Tests of step-size limits: warnings, h = auto, explain. */
#include <string.h>

#include "stability.h"

/*------------------------------------- warnings -------------------------------------------------*/

static int warnings;
static char warning[512];
static void keep_warning(const char *text, void *user) {
  (void)user;
  strncpy(warning, text, sizeof warning - 1);
  warnings++;
}

static msim_sim *watched(const msim_scene *scene, const char *method, double h) {
  msim_options opt = options(method, h);
  opt.warn = keep_warning;
  warnings = 0, warning[0] = 0;
  return make_sim(scene, &opt);
}

static void assert_warned(int times, const char *part) {
  assert_int_equal(warnings, times);
  if (!strstr(warning, part)) fail_msg("\"%s\" lacks \"%s\"", warning, part);
}

static void too_long_a_step_gives_one_warning(void **state) {
  (void)state;
  msim_scene *scene = ring(0, 0);
  const double k[RING] = {1e4, 1e4, 1e4, 1e4, 1e4, 1e4, 1e4, 1e4};
  msim_sim *sim = watched(scene, "verlet", 0.11);
  assert_warned(1,
                "h = 0.11 s exceeds the stability limit of verlet in this scene, 0.1 s: the run "
                "may become unstable; use h = 0.09 or");
  msim_state start = state_of(sim);
  assert_ok(msim_sim_step(sim, 3, err));
  assert_ok(msim_sim_set_state(sim, &start, err));
  assert_ok(msim_sim_set_step(sim, 0.12, err));
  assert_warned(1, "");
  assert_ok(msim_sim_set_step(sim, 0.09, err));
  assert_warned(1, "");
  assert_ok(msim_sim_set_step(sim, 0.12, err));
  assert_warned(2, "h = 0.12 s");
  assert_ok(msim_sim_set_step(sim, 0.09, err));
  assert_ok(msim_sim_set_springs(sim, k, NULL, NULL, err));
  assert_warned(3, "h = 0.09 s exceeds the stability limit of verlet in this scene, 0.01 s");
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void rough_bounds_alone_give_no_warning(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(12, 100, 0);
  const double rough = 2 / bounds_of(scene, 0).omega, sharp = 2 / bounds_of(scene, 1).omega;
  assert_true(sharp > 1.05 * rough);
  msim_sim_destroy(watched(scene, "velocity-verlet", (rough + sharp) / 2));
  assert_warned(0, "");
  msim_sim_destroy(watched(scene, "velocity-verlet", 1.001 * sharp));
  assert_warned(1, "velocity-verlet");
  msim_scene_destroy(scene);
}

static void methods_without_a_limit_are_told_apart(void **state) {
  (void)state;
  msim_scene *scene = ring(0, 0);
  for (int32_t i = 0; method_at(i); i++)
    if (is_implicit(method_at(i))) {
      msim_sim_destroy(watched(scene, method_at(i), 10));
      assert_warned(0, "");
    }
  msim_sim_destroy(watched(scene, "heun", 1e-6));
  assert_warned(1, "h = 1e-06 s: with heun undamped vibrations grow at any h");
  msim_scene_destroy(scene);
}

/*------------------------------------- h = auto -------------------------------------------------*/

static double planned_step(msim_sim *sim) {
  msim_plan plan = {.size = sizeof plan};
  msim_sim_plan(sim, &plan);
  return plan.h;
}

static void auto_is_below_the_limit(void **state) {
  (void)state;
  msim_scene *scene = ring(1, 2);
  for (int32_t i = 0; method_at(i); i++) {
    if (!has_limit(method_at(i)) || takes_positions_only(method_at(i))) continue;
    msim_sim *sim = watched(scene, method_at(i), MSIM_H_AUTO);
    assert_close(planned_step(sim), 0.9 * limit_of(method_at(i), bounds_of(scene, 1)), 1e-15);
    assert_warned(0, "");
    assert_ok(msim_sim_step(sim, 1000, err));
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

/* h = auto is lowered to meet t_end, without a warning; new springs do not change it, and it can be
 * set anew. */
static void h_auto_is_lowered_to_meet_the_end(void **state) {
  (void)state;
  msim_scene *scene = ring(0, 0);
  const double k[RING] = {1e4, 1e4, 1e4, 1e4, 1e4, 1e4, 1e4, 1e4};
  msim_options opt = options("verlet", MSIM_H_AUTO);
  const char *text;
  opt.t_end = 1, opt.warn = keep_warning;
  warnings = 0;
  msim_sim *sim = make_sim(scene, &opt);
  assert_close(planned_step(sim), 1. / 12, 1e-15); /* 0.09, lowered */
  assert_int_equal(warnings, 0);
  assert_ok(msim_sim_explain(sim, &text, err));
  assert_non_null(strstr(text, "0.9 of the stability limit"));
  assert_ok(msim_sim_step(sim, 6, err));
  assert_ok(msim_sim_set_springs(sim, k, NULL, NULL, err));
  assert_int_equal(warnings, 1);
  assert_close(planned_step(sim), 1. / 12, 1e-15);
  assert_ok(msim_sim_set_step(sim, MSIM_H_AUTO, err));
  assert_close(planned_step(sim), 0.5 / 56, 1e-15);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_close(state_of(sim).t, 1, 1e-12);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void refused(const msim_scene *scene, const char *method, double h, const char *sentence) {
  msim_options opt = options(method, h);
  msim_sim *sim;
  msim_error why;
  assert_int_equal(msim_sim_create(scene, &opt, &sim, &why), MSIM_ERR_ARG);
  if (!strstr(why.text, sentence)) fail_msg("\"%s\" lacks \"%s\"", why.text, sentence);
}

static void h_auto_is_refused_without_a_limit(void **state) {
  (void)state;
  const double x[3] = {0};
  msim_error why;
  msim_scene *scene = ring(1, 0), *free_ring = ring(0, 0),
             *still = make_single_particle(x, x, 9.81);
  for (int32_t i = 0; method_at(i); i++)
    if (is_implicit(method_at(i))) refused(scene, method_at(i), MSIM_H_AUTO, "no stability limit");
  refused(scene, "explicit-euler", MSIM_H_AUTO,
          "undamped vibrations grow with explicit-euler at any h");
  refused(scene, "heun", MSIM_H_AUTO, "undamped vibrations grow with heun at any h");
  refused(free_ring, "rkc", MSIM_H_AUTO, "undamped vibrations grow with rkc at any h");
  refused(still, "verlet", MSIM_H_AUTO, "nothing vibrates");
  refused(scene, "verlet", 0, "h is '0'; it must be a number > 0 or auto");
  refused(scene, "verlet", -2, "h is '-2'; it must be a number > 0 or auto");
  msim_sim *sim = watched(still, "verlet", 0.5);
  assert_int_equal(msim_sim_set_step(sim, MSIM_H_AUTO, &why), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_set_step(sim, 0, &why), MSIM_ERR_ARG);
  assert_true(planned_step(sim) == 0.5);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene), msim_scene_destroy(free_ring), msim_scene_destroy(still);
}

/* "auto" as the text of an option, in a scene file, and in a saved scene. */
static void h_auto_is_read_and_written_as_text(void **state) {
  (void)state;
  static const char text[] =
      "{\"msim\": 1, \"particles\": {\"x\": [[0,0,0],[1,0,0]], \"mass\": 1},"
      " \"springs\": {\"ij\": [[0,1]], \"k\": 200},"
      " \"run\": {\"integrator\": \"verlet\", \"h\": \"auto\"}}";
  const double g[3] = {0, 0, -1};
  msim_scene *scene, *again;
  msim_options opt;
  ms_text saved = {0};
  assert_ok(msim_scene_parse(NULL, "auto.json", text, strlen(text), &scene, err));
  assert_ok(msim_scene_set_gravity(scene, g, err)); /* no longer the text that was read */
  saved.alloc = &scene->data->alloc;
  assert_ok(ms_scene_write_json(scene->data, &saved, err));
  assert_ok(msim_scene_parse(NULL, "saved.json", saved.data, saved.length, &again, err));
  msim_options_init(&opt, sizeof opt);
  assert_ok(msim_options_from_scene(&opt, again, err));
  assert_true(opt.h == MSIM_H_AUTO);
  msim_sim *sim = make_sim(again, &opt);
  assert_close(planned_step(sim), 0.09, 1e-15);
  assert_ok(msim_options_set(&opt, "h", "0.25", err));
  assert_true(opt.h == 0.25);
  assert_ok(msim_options_set(&opt, "h", "auto", err));
  assert_true(opt.h == MSIM_H_AUTO);
  const char *const bad[] = {"-1", "0", "Auto", "autos", "number > 0", ""};
  msim_error why;
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
    assert_int_equal(msim_options_set(&opt, "h", bad[i], &why), MSIM_ERR_ARG);
  assert_int_equal(msim_options_set(&opt, "tol", "auto", &why), MSIM_ERR_ARG);
  ms_text_free(&saved);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene), msim_scene_destroy(again);
}

/*------------------------------------- explain --------------------------------------------------*/

static void explained(const msim_scene *scene, const char *method, double h, const char *part) {
  msim_options opt = options(method, h);
  msim_sim *sim = make_sim(scene, &opt);
  const char *text;
  assert_ok(msim_sim_explain(sim, &text, err));
  if (!strstr(text, part)) fail_msg("%s\nlacks \"%s\"", text, part);
  msim_sim_destroy(sim);
}

static void explain_gives_the_limit(void **state) {
  (void)state;
  const double x[3] = {0};
  msim_scene *scene = ring(0, 0), *damped = ring(0, 10), *still = make_single_particle(x, x, 9.81);
  explained(scene, "verlet", 0.05, "angular frequencies <= 20 rad/s, damping rates <= 0 1/s");
  explained(scene, "verlet", 0.05, "verlet is stable for h < 0.1 s; h is 0.5 times that\n");
  explained(scene, "rk4", 0.2,
            "rk4 is stable for h < 0.141421 s; h is 1.41 times that: the run may become");
  explained(scene, "rkn6", 0.05, "rkn6 is stable for h < 0.15707 s");
  explained(scene, "heun", 0.05, "with heun undamped vibrations grow at any h");
  explained(damped, "explicit-euler", 0.05, "explicit-euler is stable for h < 0.025 s");
  explained(damped, "verlet", 0.05, "verlet is stable for h < 0.0780776 s");
  explained(scene, "implicit-midpoint", 0.05, "stable for every h if the system is linear");
  explained(still, "verlet", 0.05, "stable for every h: nothing vibrates");
  msim_scene_destroy(scene), msim_scene_destroy(damped), msim_scene_destroy(still);
}

/* k = 1e308, and 4 k/m beyond the range of double. No message recommends another method. */
static void frequencies_beyond_double_are_named(void **state) {
  (void)state;
  const double x[6] = {0, 0, 0, 1, 0, 0}, mass[2] = {1, 1}, k = 1e308;
  const int32_t ij[2] = {0, 1};
  static const char *const methods[] = {"velocity-verlet", "symplectic-euler", "explicit-euler"};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, NULL, NULL, err));
  for (int i = 0; i < 6; i++) {
    msim_options opt = options(methods[i % 3], MSIM_H_AUTO);
    msim_error why;
    msim_sim *sim;
    const char *text;
    assert_int_equal(msim_sim_create(scene, &opt, &sim, &why), MSIM_ERR_ARG);
    if (!strstr(why.text, "use smaller k")) fail_msg("%s", why.text);
    opt.h = 1e-3, opt.t_end = 1;
    sim = make_sim(scene, &opt);
    assert_ok(msim_sim_explain(sim, &text, err));
    if (!strstr(text, "use smaller k") || strstr(text, "use velocity-verlet")) fail_msg("%s", text);
    msim_sim_destroy(sim);
    if (i == 2) assert_ok(msim_scene_pin(scene, 1, ij, err)); /* then it is k/m */
  }
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(too_long_a_step_gives_one_warning),
                                     cmocka_unit_test(rough_bounds_alone_give_no_warning),
                                     cmocka_unit_test(methods_without_a_limit_are_told_apart),
                                     cmocka_unit_test(auto_is_below_the_limit),
                                     cmocka_unit_test(h_auto_is_lowered_to_meet_the_end),
                                     cmocka_unit_test(h_auto_is_refused_without_a_limit),
                                     cmocka_unit_test(h_auto_is_read_and_written_as_text),
                                     cmocka_unit_test(explain_gives_the_limit),
                                     cmocka_unit_test(frequencies_beyond_double_are_named)};
  return cmocka_run_group_tests_name("step_limit", tests, NULL, NULL);
}
