/* Tests of the names that messages suggest for unknown ones: those of other systems, abbreviations
 * and slips, the same in the API, in scene files and for lists of a program. */
#include <stdio.h>
#include <string.h>

#include "testing.h"

static void assert_says(const char *text, const char *word, const char *meant) {
  char hint[96];
  snprintf(hint, sizeof hint, "did you mean '%s'?", meant);
  if (!strstr(text, hint)) fail_msg("'%s': \"%s\" does not say \"%s\"", word, text, hint);
}

static void integrators_of_other_systems(void **state) {
  (void)state;
  static const char *const words[][2] = {{"leapfrog", "velocity-verlet"},
                                         {"Stormer-Verlet", "velocity-verlet"},
                                         {"euler", "explicit-euler"},
                                         {"forward_euler", "explicit-euler"},
                                         {"backward-euler", "implicit-euler"},
                                         {"semi-implicit-euler", "symplectic-euler"},
                                         {"crank-nicolson", "trapezoidal"},
                                         {"rk45", "dop853"},
                                         {"dopri5", "dop853"},
                                         {"VelocityVerlet", "velocity-verlet"},
                                         {"heum", "heun"}};
  const double x[3] = {0, 0, 0}, mass = 1;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
  for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
    msim_options options;
    msim_sim *sim;
    msim_error err;
    msim_options_init(&options, sizeof options);
    options.integrator = words[i][0];
    assert_int_equal(msim_sim_create(scene, &options, &sim, &err), MSIM_ERR_NAME);
    assert_says(err.text, words[i][0], words[i][1]);
  }
  msim_scene_destroy(scene);
}

/* The same by msim_options_set and in `run` of a scene file. No such option takes effect. */
static void options_of_other_systems(void **state) {
  (void)state;
  static const char *const words[][2] = {
      {"dt", "h"},     {"timestep", "h"},        {"t-end", "t_end"},      {"duration", "t_end"},
      {"rtol", "tol"}, {"method", "integrator"}, {"newt", "newton.rtol"}, {"Threads", "threads"}};
  for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
    msim_options options;
    msim_error err;
    char json[256];
    msim_scene *scene;
    msim_options_init(&options, sizeof options);
    assert_int_equal(msim_options_set(&options, words[i][0], "1", &err), MSIM_ERR_ARG);
    assert_says(err.text, words[i][0], words[i][1]);
    assert_true(options.h == 1e-3 && options.t_end == -1);
    snprintf(
        json, sizeof json,
        "{\"msim\": 1, \"particles\": {\"x\": [[0, 0, 0]], \"mass\": 1}, \"run\": {\"%s\": 1}}",
        words[i][0]);
    assert_int_equal(msim_scene_parse(NULL, "a", json, strlen(json), &scene, &err), MSIM_ERR_ARG);
    assert_says(err.text, words[i][0], words[i][1]);
  }
}

static void keys_of_other_systems(void **state) {
  (void)state;
  static const char *const scenes[][3] = {
      {"{\"msim\": 1, \"nodes\": {}}", "nodes", "particles"},
      {"{\"msim\": 1, \"particles\": {\"positions\": []}}", "positions", "x"},
      {"{\"msim\": 1, \"particles\": {\"fixed\": []}}", "fixed", "pinned"},
      {"{\"msim\": 1, \"particles\": {\"x\": [[0, 0, 0]], \"mass\": 1},"
       " \"springs\": {\"stiffness\": 3}}",
       "stiffness", "k"},
      {"{\"msim\": 1, \"objects\": [{\"type\": \"chain\"}]}", "chain", "rope"}};
  for (size_t i = 0; i < sizeof scenes / sizeof *scenes; i++) {
    msim_scene *scene;
    msim_error err;
    assert_true(msim_scene_parse(NULL, "a", scenes[i][0], strlen(scenes[i][0]), &scene, &err) < 0);
    assert_says(err.text, scenes[i][1], scenes[i][2]);
  }
}

/* A solver may be a plugin of any name; one that is not found may be meant otherwise. */
static void solvers_of_other_systems(void **state) {
  (void)state;
  const msim_backend *backend;
  msim_error err;
  assert_int_equal(msim_solver_backend("cg", NULL, &backend, &err), MSIM_ERR_NAME);
  assert_says(err.text, "cg", "pcg");
  assert_int_equal(msim_solver_backend("ldlt", NULL, &backend, &err), MSIM_ERR_NAME);
  assert_says(err.text, "ldlt", "cholmod");
}

static void names_of_a_program(void **state) {
  (void)state;
  static const char *const names[] = {"h", "height", "t_end", NULL};
  assert_string_equal(msim_nearest_name("dt", names), "h");
  assert_string_equal(msim_nearest_name("heigth", names), "height");
  assert_string_equal(msim_nearest_name("hei", names), "height");
  assert_string_equal(msim_nearest_name("T-END", names), "t_end");
  assert_null(msim_nearest_name("h", names)); /* it is there */
  assert_null(msim_nearest_name("q", names)); /* all letters differ */
  assert_null(msim_nearest_name("", names));
  assert_null(msim_nearest_name("leapfrog", names)); /* its name is not in this list */
  assert_null(msim_nearest_name(NULL, names));
  assert_null(msim_nearest_name("h", NULL));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(integrators_of_other_systems), cmocka_unit_test(options_of_other_systems),
      cmocka_unit_test(keys_of_other_systems), cmocka_unit_test(solvers_of_other_systems),
      cmocka_unit_test(names_of_a_program)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
