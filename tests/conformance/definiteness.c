/* Definiteness: a matrix that is not positive definite is detected, or solved if the flags say so,
 * and does not affect later calls. */
#include "conformance.h"

static const int32_t sizes[] = {2, 9, 60, 0};

static const kind indefinite[] = {{"one negative", one_negative, 1},
                                  {"strong coupling", strong_coupling, 1},
                                  {"negative definite", negative_definite, 1},
                                  {0}};
static const kind singular[] = {{"free chain", free_chain, 1}, {"row of zeros", zero_row, 1}, {0}};

/* A right-hand side that has a solution, even if A is singular. */
static double *solvable(const problem *p) {
  double *x = random_vector(unknowns(p), 3), *b = calloc((size_t)unknowns(p), sizeof *b);
  problem_apply(p, x, b);
  free(x);
  return b;
}

/* A factorization must detect the matrix; an iteration may find a solution, or not. */
static void check_spd(const char *label, const problem *p) {
  double *b = solvable(p);
  outcome o = solve_with(backend, p, MSIM_FACTOR_SPD, b);
  const int seen = o.status == MSIM_NOT_SPD;
  if (!(iterative ? is_valid_outcome(p, b, o.status, o.y) : seen))
    fail_msg("%s: %s gave status %d, residual %.3g", label, o.call, (int)o.status,
             residual(p, b, o.y));
  if (o.definite == MSIM_DEFINITE_POSITIVE) fail_msg("%s: reported as positive definite", label);
  free(b), free(o.y);
}

static void factor_spd_detects_indefinite_matrices(void **state) {
  (void)state;
  for_each(indefinite, sizes, check_spd);
  for_each(singular, sizes, check_spd);
}

static void check_symmetric(const char *label, const problem *p) {
  double *b = solvable(p);
  outcome o = solve_with(backend, p, MSIM_FACTOR_SYMMETRIC, b);
  if (o.status) fail_msg("%s: %s gave status %d", label, o.call, (int)o.status);
  if (!is_solution(p, b, o.y, RTOL, 1e-9))
    fail_msg("%s: backward error %.3g", label, backward_error(p, b, o.y));
  if (o.definite == MSIM_DEFINITE_POSITIVE) fail_msg("%s: reported as positive definite", label);
  free(b), free(o.y);
}

static void factor_symmetric_solves_indefinite_matrices(void **state) {
  (void)state;
  if (!symmetric) skip();
  for_each(indefinite, sizes, check_symmetric);
}

static void check_symmetric_spd(const char *label, const problem *p) {
  double *b = random_vector(unknowns(p), 3);
  outcome o = solve_with(backend, p, MSIM_FACTOR_SYMMETRIC, b);
  if (o.status || !is_solution(p, b, o.y, RTOL, 1e-12))
    fail_msg("%s: %s gave status %d, backward error %.3g", label, o.call, (int)o.status,
             backward_error(p, b, o.y));
  if (o.definite == MSIM_DEFINITE_NOT) fail_msg("%s: reported as indefinite", label);
  free(b), free(o.y);
}

static void factor_symmetric_solves_definite_matrices(void **state) {
  (void)state;
  if (!symmetric) skip();
  for_each((const kind[]){{"springs", spring_net, 1}, {0}}, sizes, check_symmetric_spd);
}

static void check_singular(const char *label, const problem *p) {
  double *b = solvable(p);
  outcome o = solve_with(backend, p, MSIM_FACTOR_SYMMETRIC, b);
  if (!is_valid_outcome(p, b, o.status, o.y))
    fail_msg("%s: %s gave status %d, backward error %.3g", label, o.call, (int)o.status,
             backward_error(p, b, o.y));
  if (strstr(label, "row of zeros") && o.definite == MSIM_DEFINITE_POSITIVE)
    fail_msg("%s: reported as positive definite", label);
  free(b), free(o.y);
}

static void factor_symmetric_reports_singular_matrices(void **state) {
  (void)state;
  if (!symmetric) skip();
  for_each(singular, sizes, check_singular);
}

/* The matrix as the host stores it, row by row, and not its transpose. */
static void check_unsymmetric(const char *label, const problem *p) {
  problem *q = add_skew_part(random_dominant(p->n, p->block, 7), 11);
  double *b = random_vector(unknowns(q), 3);
  outcome o = solve_with(backend, q, MSIM_FACTOR_UNSYMMETRIC, b);
  if (o.status || !is_solution(q, b, o.y, RTOL, 1e-12))
    fail_msg("%s: %s gave status %d, backward error %.3g", label, o.call, (int)o.status,
             backward_error(q, b, o.y));
  if (o.definite) fail_msg("%s: definiteness reported for an unsymmetric factorization", label);
  free(b), free(o.y), problem_free(q);
}

static void factor_unsymmetric_solves_unsymmetric_matrices(void **state) {
  (void)state;
  if (!unsymmetric) skip();
  for_each((const kind[]){{"skewed", random_dominant, 1}, {0}}, sizes, check_unsymmetric);
}

/* As in a step of msim: the exact matrix fails, and the clamped one or another kind of
 * factorization follows. */
static void check_recovery(const char *label, const problem *bad) {
  const int32_t n = unknowns(bad);
  problem *good = spring_net(bad->n, bad->block, 7);
  double *b = random_vector(n, 3);
  outcome fresh = solve_with(backend, good, MSIM_FACTOR_SPD, b);
  rig r;
  assert_int_equal(rig_open(&r, backend, bad), MSIM_OK);
  for (int round = 0; round < 3; round++) {
    double *y = calloc((size_t)n, sizeof *y);
    rig_set(&r, bad);
    if (!rig_factor(&r, MSIM_FACTOR_SPD)) rig_solve(&r, RTOL, LIMIT, 1, b, y);
    if (symmetric) assert_int_equal(rig_factor(&r, MSIM_FACTOR_SYMMETRIC), MSIM_OK);
    if (unsymmetric) assert_int_equal(rig_factor(&r, MSIM_FACTOR_UNSYMMETRIC), MSIM_OK);
    rig_set(&r, good);
    for (int32_t i = 0; i < n; i++) y[i] = 0;
    assert_int_equal(rig_factor(&r, MSIM_FACTOR_SPD), MSIM_OK);
    assert_int_equal(rig_solve(&r, RTOL, LIMIT, 1, b, y), MSIM_OK);
    assert_same(label, y, fresh.y, n);
    free(y);
  }
  rig_close(&r);
  free(b), free(fresh.y), problem_free(good);
}

static void a_failure_leaves_nothing_behind(void **state) {
  (void)state;
  const kind kinds[] = {
      {"one negative", one_negative, 1}, {"negative definite", negative_definite, 1}, {0}};
  for_each(kinds, sizes, check_recovery);
}

/* Pivots on the diagonal are good for the first matrix. In the second they give large multipliers,
 * in the third one is about 0: LU has to choose new ones. LDL^T cannot. */
static void pivots_follow_the_values(void **state) {
  (void)state;
  if (strcmp(backend->name, "klu") != 0) skip();
  const double diagonals[] = {5, 1e-9, 1e-20};
  const int32_t n = 60;
  problem *p = random_dominant(n, 1, 5);
  double *b = random_vector(n, 3), *y = random_vector(n, 4);
  rig r;
  assert_int_equal(rig_open(&r, backend, p), MSIM_OK);
  for (int k = 0; k < 3; k++) {
    rig_set(&r, set_diagonal(p, diagonals[k]));
    assert_int_equal(rig_factor(&r, MSIM_FACTOR_SYMMETRIC), MSIM_OK);
    assert_int_equal(rig_solve(&r, RTOL, LIMIT, 1, b, y), MSIM_OK);
    assert_close(backward_error(p, b, y), 0, 1e-12);
  }
  rig_close(&r);
  free(b), free(y), problem_free(p);
}

int run_definiteness(void) {
  const struct CMUnitTest tests[] = {
      conformance_test(factor_spd_detects_indefinite_matrices),
      conformance_test(factor_symmetric_solves_indefinite_matrices),
      conformance_test(factor_symmetric_solves_definite_matrices),
      conformance_test(factor_symmetric_reports_singular_matrices),
      conformance_test(factor_unsymmetric_solves_unsymmetric_matrices),
      conformance_test(a_failure_leaves_nothing_behind),
      conformance_test(pivots_follow_the_values)};
  return cmocka_run_group_tests_name("definiteness", tests, NULL, NULL);
}
