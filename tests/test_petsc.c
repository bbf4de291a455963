/* Tests of the plugin petsc: options in PETSc's own words, what is refused, and that nothing of the
 * environment changes a result. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "ranks.h"
#include "scene_check.h"
#include "scenes.h"

enum { SIDE = 30, N = SIDE * SIDE };

typedef struct end {
  msim_status status;
  int64_t iterations;
  double x[3 * N];
  char text[1020];
} end;

/* A cloth after a long step, h^2 k / m about 10: its matrix couples distant particles. */
static end run_cloth(const char *solver, const char *solver_options) {
  static end e;
  msim_error why = {0, ""};
  msim_sim *sim = NULL;
  memset(&e, 0, sizeof e);
  msim_scene *scene = hanging_cloth(SIDE, 1000, 0.01);
  msim_options opt = options("linearly-implicit-euler", 0.02);
  opt.solver = solver, opt.solver_options = solver_options;
  e.status = msim_sim_create(scene, &opt, &sim, &why);
  if (!e.status) e.status = msim_sim_step(sim, 3, &why);
  if (sim) {
    e.iterations = stats_of(sim).iterations;
    memcpy(e.x, state_of(sim).x, sizeof e.x);
  }
  memcpy(e.text, why.text, sizeof e.text);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return e;
}

static void all_preconditioners_agree(void **state) {
  (void)state;
  const end reference = run_cloth("pcg", NULL);
  const char *choices[] = {NULL,
                           "-pc_type jacobi",
                           "-ksp_type minres -pc_type bjacobi",
                           "-ksp_type preonly -pc_type cholesky",
                           "-ksp_type fgmres -ksp_gmres_restart 20 -pc_type icc",
                           "-pc_type gamg -mg_levels_ksp_max_it 3",
                           "-pc_type msim",
                           "-ksp_type minres -pc_type msim",
                           "-ksp_type gmres -pc_type msim"};
  int64_t by_gamg = 0;
  assert_int_equal(reference.status, MSIM_OK);
  for (size_t i = 0; i < sizeof choices / sizeof *choices; i++) {
    const end e = run_cloth("petsc", choices[i]);
    const double most = largest_difference(reference.x, e.x, 3 * N);
    if (e.status) fail_msg("%s: status %d, \"%s\"", choices[i], (int)e.status, e.text);
    if (most > 1e-7) fail_msg("%s: positions differ by %g m", choices[i], most);
    if (i == 0) by_gamg = e.iterations;
    if (i == 1 && e.iterations < 2 * by_gamg)
      fail_msg("Jacobi takes %lld iterations, multigrid %lld", (long long)e.iterations,
               (long long)by_gamg);
    if (i == 3) assert_in_range(e.iterations, 3, 12); /* a few calls of a factorization each */
    if (i == 6 && e.iterations > 1.25 * (double)reference.iterations)
      fail_msg("-pc_type msim takes %lld iterations, the solver pcg %lld", (long long)e.iterations,
               (long long)reference.iterations);
  }
}

static void what_is_refused(void **state) {
  (void)state;
  const struct {
    const char *solver, *options, *words;
  } cases[] = {
      {"petsc", "-ksp_tipe cg", "PETSc has no use for -ksp_tipe in solver.options"},
      {"petsc", "-ksp_gmres_restart 20", "PETSc has no use for -ksp_gmres_restart"},
      {"petsc", "-pc_type multigird", "multigird"},
      {"petsc", "-pc_type msim -pc_gamg_threshold 0.1", "PETSc has no use for -pc_gamg_threshold"},
      {"petsc", "-ksp_type conjugate", "conjugate"},
      {"petsc", "cg", "must be options of PETSc, as -ksp_type cg"},
      {"pcg", "-pc_type gamg", "solver 'pcg' takes no solver.options"},
      {"auto", "-pc_type gamg", "solver 'auto' takes no solver.options"},
      {"cholmod", "-pc_type gamg", "solver 'cholmod' takes no solver.options"},
  };
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    if (strcmp(cases[i].solver, "cholmod") == 0 && !is_solver_available("cholmod")) continue;
    const end e = run_cloth(cases[i].solver, cases[i].options);
    if (e.status >= 0 || !strstr(e.text, cases[i].words))
      fail_msg("%s: status %d, \"%s\"", cases[i].options, (int)e.status, e.text);
  }
}

/* Options of the environment are for other programs. */
static void the_environment_does_not_matter(void **state) {
  (void)state;
  const end before = run_cloth("petsc", NULL);
  setenv("PETSC_OPTIONS", "-pc_type none -ksp_monitor", 1);
  const end after = run_cloth("petsc", NULL);
  unsetenv("PETSC_OPTIONS");
  assert_int_equal(before.status, MSIM_OK);
  assert_int_equal(after.iterations, before.iterations);
  assert_memory_equal(after.x, before.x, sizeof before.x);
}

/* Also options that print. */
static void nothing_is_printed(void **state) {
  (void)state;
  FILE *file = tmpfile();
  assert_non_null(file);
  fflush(NULL);
  const int out = dup(1), err = dup(2);
  dup2(fileno(file), 1), dup2(fileno(file), 2);
  const end e = run_cloth("petsc", "-ksp_monitor -ksp_view -ksp_converged_reason");
  fflush(NULL);
  dup2(out, 1), dup2(err, 2);
  close(out), close(err);
  const long printed = (fseek(file, 0, SEEK_END), ftell(file));
  fclose(file);
  assert_int_equal(e.status, MSIM_OK);
  assert_int_equal(printed, 0);
}

/* Ranks that are threads would share PETSc, which is not thread-safe. */
static const char *check_thread_rank(msim_comm *comm, void *data) {
  const char *wrong = NULL;
  msim_options opt = options("linearly-implicit-euler", 1e-3);
  msim_scene *scene = hanging_cloth(8, 100, 0);
  msim_sim *sim = NULL;
  msim_error why = {0};
  (void)data;
  opt.solver = "petsc", opt.comm = comm;
  if (msim_sim_create(scene, &opt, &sim, &why) != MSIM_ERR_ARG) wrong = "another status";
  else if (!strstr(why.text, "PETSc is not thread-safe") || sim) wrong = "another sentence";
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return wrong;
}

static void threads_as_ranks_are_refused(void **state) {
  (void)state;
  const char *wrong = run_ranks(3, check_thread_rank, NULL);
  if (wrong) fail_msg("%s", wrong);
}

int main(void) {
  setenv("PETSC_OPTIONS", "-ksp_type richardson -pc_type none", 1);
  if (!is_solver_available("petsc")) return missing_status("the solver petsc");
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(all_preconditioners_agree), cmocka_unit_test(what_is_refused),
      cmocka_unit_test(the_environment_does_not_matter), cmocka_unit_test(nothing_is_printed),
      cmocka_unit_test(threads_as_ranks_are_refused)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
