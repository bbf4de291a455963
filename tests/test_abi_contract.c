/* Tests that msim as a host keeps the contract of backend.h, in whole simulations with the solver
 * that the argument names. checking_backend between msim and the solver reports no breach, and
 * solutions of a faulty solver with errors beyond rtol are not accepted. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "checking_backend.h"
#include "scene_check.h"
#include "scenes.h"

enum { SIDE = 7, N = SIDE * SIDE, STEPS = 25 };

static const msim_backend *bare;

static int is_iterative(void) { return (bare->flags & MSIM_BACKEND_ITERATIVE) != 0; }

/* Block size of the matrix: 3; 2 if gravity keeps the cloth planar; 1 if all rest lengths and
 * dampings are 0. */
static int block = 3;

static const char cloth[] =
    "{\"msim\": 1, \"gravity\": [0, 0, -9.81], \"objects\": [{\"type\": \"cloth\", \"n\": [7, 7],"
    " \"origin\": [0, 0, 0], \"row\": [0, 1, 0], \"column\": [1, 0, 0], \"mass\": 0.3,"
    " \"k\": {\"structural\": 300, \"shear\": 300, \"bend\": 300}, \"damping\": 0.01,"
    " \"pinned\": [\"first_corners\"]}]}";

typedef struct run {
  msim_status status;
  msim_stats stats;
  double x[3 * N];
  char text[1020]; /* the error message */
} run;

/* A cloth that is initially compressed along one edge, so that the exact matrix is indefinite. */
static run simulate(const msim_allocator *alloc, const msim_backend *table, int32_t indefinite) {
  const msim_backend *const backends[] = {table, NULL};
  run r = {0};
  msim_error why = {0, ""};
  msim_scene *scene = NULL;
  msim_sim *sim = NULL;
  msim_options opt = options("linearly-implicit-euler", 0.02);
  opt.solver = table->name, opt.backends = backends, opt.indefinite = indefinite;
  r.status = msim_scene_parse(alloc, "cloth", cloth, sizeof cloth - 1, &scene, &why);
  static const double in_plane[3] = {0, -9.81, 0}, zeros[6 * N];
  if (!r.status && block == 2) r.status = msim_scene_set_gravity(scene, in_plane, &why);
  if (!r.status) r.status = msim_sim_create(scene, &opt, &sim, &why);
  if (!r.status && block == 1) r.status = msim_sim_set_springs(sim, NULL, zeros, zeros, &why);
  if (!r.status) {
    const msim_scene_view view = view_of(scene);
    for (int i = 0; i < 3 * N; i++) r.x[i] = view.x[i] * (i % 3 == 1 ? 0.7 : 1);
    const msim_state start = {.size = sizeof start, .n = N, .x = r.x, .v = view.v};
    r.status = msim_sim_set_state(sim, &start, &why);
  }
  if (!r.status) r.status = msim_sim_step(sim, STEPS, &why);
  if (sim) memcpy(r.x, state_of(sim).x, sizeof r.x), r.stats = stats_of(sim);
  memcpy(r.text, why.text, sizeof r.text);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return r;
}

static void assert_no_breach(void) {
  const char *report = checking_report();
  if (report[0])
    fail_msg(
        "breaches of backend.h:\n"
        "%s",
        report);
}

/* With checking_backend and without: the same end, bit by bit. */
static run simulate_watched(int32_t indefinite) {
  run alone = simulate(NULL, bare, indefinite);
  run watched = simulate(NULL, checking_backend(bare), indefinite);
  assert_no_breach();
  assert_int_equal(watched.status, alone.status);
  assert_string_equal(watched.text, alone.text);
  assert_memory_equal(watched.x, alone.x, sizeof alone.x);
  return watched;
}

static void clamped_where_it_is_indefinite(void **state) {
  (void)state;
  const run r = simulate_watched(MSIM_INDEFINITE_CLAMP);
  if (r.status) fail_msg("status %d, \"%s\"", (int)r.status, r.text);
  assert_int_equal(r.stats.steps, STEPS);
  if (is_iterative()) assert_true(r.stats.iterations >= r.stats.solves);
  else assert_in_range(r.stats.indefinite_steps, 1, STEPS);
}

static void solved_where_it_is_indefinite(void **state) {
  (void)state;
  const run r = simulate_watched(MSIM_INDEFINITE_SOLVE);
  if (!(bare->flags & MSIM_BACKEND_SYMMETRIC)) {
    assert_int_equal(r.status, MSIM_ERR_ARG);
    assert_non_null(strstr(r.text, "cannot solve indefinite systems"));
    return;
  }
  if (r.status) fail_msg("status %d, \"%s\"", (int)r.status, r.text);
  assert_in_range(r.stats.indefinite_steps, 1, STEPS);
}

static void stopped_where_it_is_indefinite(void **state) {
  (void)state;
  const run r = simulate_watched(MSIM_INDEFINITE_STOP);
  if (r.status == MSIM_OK && is_iterative()) { /* the iteration met no negative curvature */
    assert_int_equal(r.stats.steps, STEPS);
    return;
  }
  assert_int_equal(r.status, MSIM_NOT_SPD);
  assert_int_equal(r.stats.steps, 0);
}

static void smaller_blocks(void **state) {
  (void)state;
  for (block = 2; block > 0; block--) {
    const run r = simulate_watched(MSIM_INDEFINITE_CLAMP);
    if (r.status) fail_msg("status %d, \"%s\"", (int)r.status, r.text);
    assert_int_equal(r.stats.steps, STEPS);
    if (block == 1) assert_int_equal(r.stats.assemblies, 1);
  }
  block = 3;
}

static msim_status watch(const msim_allocator *alloc, void *data) {
  const run r = simulate(alloc, data, MSIM_INDEFINITE_CLAMP);
  assert_no_breach();
  return r.status;
}

/* Memory runs out in each allocation: the contract is kept all the same. */
static void the_contract_holds_without_memory(void **state) {
  (void)state;
  msim_backend watched = *checking_backend(bare);
  assert_true(expect_memory_errors(watch, &watched) > 50);
}

/*------------------------------------- D^-1 -----------------------------------------------------*/

static size_t length(const msim_system *A) {
  return (size_t)A->block * (size_t)(A->format == MSIM_FORMAT_NONE ? A->stride : A->n);
}

static double farthest_from_identity; /* largest entry of D^-1 D - I, over all steps */
static int compared;                  /* number of columns compared */

/* D e for a unit vector e, from apply(), and then D^-1 of that. */
static void compare_column(const msim_system *A, int32_t row, int32_t c) {
  const size_t n = length(A), unit = (size_t)c * (size_t)A->stride + (size_t)row;
  double *e = calloc(3 * n, sizeof *e), *column = e + n, *own = e + 2 * n;
  e[unit] = 1;
  A->apply(A, e, column);
  for (size_t i = (size_t)row; i < n; i += (size_t)A->stride) own[i] = column[i];
  A->precondition(A, own, own);
  for (size_t i = 0; i < n; i++)
    farthest_from_identity = fmax(farthest_from_identity, fabs(own[i] - e[i]));
  compared++;
  free(e);
}

static msim_status factor_and_compare(void *self, const msim_system *A, int32_t kind,
                                      msim_solve_info *info) {
  const msim_status status = bare->factor(self, A, kind, info);
  for (int32_t i = 0; !status && i < A->n; i++)
    for (int32_t c = 0; c < A->block; c++) compare_column(A, i, c);
  return status;
}

/* Without a matrix the host provides D^-1, for the diagonal blocks of A in this step. */
static void preconditioner_is_that_of_the_blocks(void **state) {
  (void)state;
  if (bare->format != MSIM_FORMAT_NONE) return;
  msim_backend comparing = *bare;
  comparing.factor = factor_and_compare;
  for (block = 3; block > 0; block--) {
    compared = 0, farthest_from_identity = 0;
    const run r = simulate(NULL, &comparing, MSIM_INDEFINITE_CLAMP);
    assert_int_equal(r.status, MSIM_OK);
    assert_true(compared >= (block == 1 ? 1 : STEPS) * block * (N - 2));
    assert_close(farthest_from_identity, 0, 1e-12);
  }
  block = 3;
}

/*------------------------------------- rtol and its norm ----------------------------------------*/

/* What the faulty backend adds to its solution. */
static enum { NOTHING, SHARE_OF_ANSWER, RESIDUAL_OF_LIGHTEST } fault;
static double off;              /* the residual that it leaves, over rtol ||b|| */
static msim_solve_params asked; /* of the last call */

/* The diagonal entry of an unknown, +-0 for padding. */
static double diagonal(const msim_system *A, size_t i, double *x, double *y) {
  if (A->format != MSIM_FORMAT_NONE) {
    int32_t e = A->rowptr[i];
    while ((size_t)A->colind[e] != i) e++;
    return A->val[e];
  }
  memset(x, 0, length(A) * sizeof *x);
  x[i] = 1;
  A->apply(A, x, y);
  return i % (size_t)A->stride < (size_t)A->n ? y[i] : 0;
}

/* Leaves a residual of off rtol ||b||, in the 2-norm, in the equation with the least diagonal
 * entry. */
static void spoil_lightest(const msim_system *A, double rtol, const double *b, double *y) {
  const size_t n = length(A);
  double *work = calloc(2 * n, sizeof *work), least = INFINITY, sum = 0;
  size_t lightest = 0;
  for (size_t i = 0; i < n; i++) {
    const double d = diagonal(A, i, work, work + n);
    if (d > 0 && d < least) least = d, lightest = i;
    sum += b[i] * b[i];
  }
  y[lightest] += off * rtol * sqrt(sum) / least;
  free(work);
}

static msim_status solve_faultily(void *self, const msim_system *A, const msim_solve_params *params,
                                  int32_t nrhs, const double *b, double *y, msim_solve_info *info) {
  asked = *params;
  const msim_status status = bare->solve(self, A, params, nrhs, b, y, info);
  assert_int_equal(nrhs, 1);
  for (size_t i = 0; fault == SHARE_OF_ANSWER && i < length(A); i++) y[i] *= 1 + off * params->rtol;
  if (fault == RESIDUAL_OF_LIGHTEST) spoil_lightest(A, params->rtol, b, y);
  return status;
}

/* A particle of 1 kg connected with one of 1e6 kg, which hangs from a pinned one. */
static run simulate_faulty(double rtol, int kind, double residual) {
  const double x[9] = {0, 0, 0, 1, 0.2, 0, 2, 0.1, 0.4}, mass[3] = {1, 1e6, 1}, k[2] = {10, 10};
  const double g[3] = {0, 0, -9.81};
  const int32_t ij[4] = {0, 1, 1, 2}, pinned = 0;
  msim_backend faulty = *bare;
  const msim_backend *const backends[] = {&faulty, NULL};
  msim_scene *scene;
  msim_error why = {0, ""};
  run r = {0};
  faulty.solve = solve_faultily, fault = kind, off = residual;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 3, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 2, ij, k, NULL, NULL, err));
  assert_ok(msim_scene_pin(scene, 1, &pinned, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  msim_options opt = options("linearly-implicit-euler", 0.01);
  opt.solver = bare->name, opt.backends = backends;
  opt.solver_rtol = rtol, opt.solver_max_iterations = 77;
  msim_sim *sim = make_sim(scene, &opt);
  r.status = msim_sim_step(sim, 1, &why);
  r.stats = stats_of(sim);
  memcpy(r.text, why.text, sizeof r.text);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return r;
}

/* A solution is refined, as often as necessary. */
static void assert_refined(const run *r) {
  if (r->status) fail_msg("%s", r->text);
  assert_in_range(r->stats.refinements, 1, 3);
}

/* A factorization must meet at least 1e-5, as single precision does for preconditioners. */
static void tolerance_and_limit_are_passed_on(void **state) {
  (void)state;
  const double rtols[] = {1e-3, 1e-6, 1e-9};
  for (int i = 0; i < 3; i++) {
    const run r = simulate_faulty(rtols[i], NOTHING, 0);
    assert_int_equal(r.status, MSIM_OK);
    assert_int_equal(r.stats.refinements, 0);
    assert_true(asked.rtol == (is_iterative() ? rtols[i] : fmin(rtols[i], 1e-5)));
    assert_int_equal(asked.max_iterations, 77);
  }
}

static void solutions_beyond_rtol_are_not_accepted(void **state) {
  (void)state;
  const run below = simulate_faulty(1e-6, SHARE_OF_ANSWER, 0.1);
  assert_int_equal(below.status, MSIM_OK);
  assert_int_equal(below.stats.refinements, 0);
  for (double residual = 2; residual < 20; residual += 8) {
    const run beyond = simulate_faulty(1e-6, SHARE_OF_ANSWER, residual);
    assert_refined(&beyond);
  }
  const run never = simulate_faulty(1e-6, SHARE_OF_ANSWER, 3e6);
  assert_int_equal(never.status, MSIM_NOT_CONVERGED);
  assert_non_null(strstr(never.text, "reached a relative residual of"));
  assert_int_equal(never.stats.steps, 0);
  assert_int_equal(never.stats.refinements, 3);
}

/* In the 2-norm this residual is a tenth of rtol ||b||; in sqrt(r.D^-1 r) it is 100 times rtol
 * ||b||, as D is a million times smaller there than in the other equations. */
static void residuals_are_measured_in_the_block_norm(void **state) {
  (void)state;
  const run r = simulate_faulty(1e-6, RESIDUAL_OF_LIGHTEST, 0.1);
  assert_refined(&r);
}

int main(int argc, char **argv) {
  msim_error why;
  if (argc != 2) return 2;
  const msim_status status = msim_solver_backend(argv[1], NULL, &bare, &why);
  if (status) fprintf(stderr, "%s\n", why.text);
  if (status) return status == MSIM_ERR_NAME ? missing_status(argv[1]) : 1;
  const struct CMUnitTest tests[] = {cmocka_unit_test(clamped_where_it_is_indefinite),
                                     cmocka_unit_test(solved_where_it_is_indefinite),
                                     cmocka_unit_test(stopped_where_it_is_indefinite),
                                     cmocka_unit_test(smaller_blocks),
                                     cmocka_unit_test(the_contract_holds_without_memory),
                                     cmocka_unit_test(preconditioner_is_that_of_the_blocks),
                                     cmocka_unit_test(tolerance_and_limit_are_passed_on),
                                     cmocka_unit_test(solutions_beyond_rtol_are_not_accepted),
                                     cmocka_unit_test(residuals_are_measured_in_the_block_norm)};
  return cmocka_run_group_tests_name("abi_contract", tests, NULL, NULL);
}
