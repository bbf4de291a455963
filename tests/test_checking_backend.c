/* Tests of checking_backend itself: it reports nothing if host and backend keep the contract, and
 * each breach otherwise. The system is 2 x 2, the backend a diagonal one with a fault on request,
 * the host a script with one letter per call. */
#include <math.h>
#include <string.h>

#include "checking_backend.h"
#include "counting_host.h"
#include "testing.h"

/*------------------------------------- a faulty backend -----------------------------------------*/

enum defect {
  NONE,
  GIVES_NO_SELF,
  FREES_ELSEWHERE,
  REPEATS_A_ROW,
  WRITES_TO_GRAPH,
  WRITES_TO_PATTERN,
  WRITES_TO_VALUES,
  WRITES_TO_RIGHT_SIDE,
  LIES,
  GIVES_NAN,
  COUNTS_BACKWARDS,
  STOPS,
  IS_SILENT,
  CALLS_BACK
};
static enum defect defect;
static const msim_backend *checked; /* the wrapped backend as the host calls it, and its instance */
static void *instance;

/* Writes to a const array, on purpose. */
static void overwrite_const(const void *array) { *(unsigned char *)(uintptr_t)array ^= 1; }

static msim_status diagonal_create(const msim_host *host, void **self) {
  const msim_host **lent = defect == GIVES_NO_SELF ? NULL : host->alloc(host, sizeof *lent);
  if (lent) *lent = host;
  *self = lent;
  return MSIM_OK;
}

static msim_status diagonal_order(void *self, int32_t n, const int32_t *ptr, const int32_t *ind,
                                  int32_t *perm) {
  (void)self, (void)ptr;
  for (int32_t k = 0; k < n; k++) perm[k] = defect == REPEATS_A_ROW ? 0 : k;
  if (defect == WRITES_TO_GRAPH) overwrite_const(&ind[0]);
  return MSIM_OK;
}

static msim_status diagonal_analyze(void *self, const msim_system *A, msim_solve_info *info) {
  (void)self, (void)info;
  if (defect == WRITES_TO_PATTERN) overwrite_const(&A->graphind[1]);
  return MSIM_OK;
}

static msim_status diagonal_factor(void *self, const msim_system *A, int32_t kind,
                                   msim_solve_info *info) {
  (void)kind;
  const msim_host *host = *(const msim_host **)self;
  if (defect == COUNTS_BACKWARDS) info->iterations = -1;
  if (defect == STOPS) return MSIM_STOPPED;
  if (A->val[0] > 0) return MSIM_OK;
  if (defect != IS_SILENT)
    (host->fail)(host, /* cmocka has a macro of that name */
                 "%g is not positive", A->val[0]);
  return MSIM_ERR_BACKEND;
}

static msim_status diagonal_solve(void *self, const msim_system *A, const msim_solve_params *params,
                                  int32_t nrhs, const double *b, double *y, msim_solve_info *info) {
  (void)self, (void)params, (void)info;
  for (int32_t i = 0; i < 2 * nrhs; i++) y[i] = b[i] / A->val[i % 2 ? 3 : 0];
  if (defect == WRITES_TO_VALUES) overwrite_const(&A->val[3]);
  if (defect == WRITES_TO_RIGHT_SIDE) overwrite_const(&b[1]);
  if (defect == CALLS_BACK) checked->destroy(instance);
  if (defect == LIES) y[1] += 1e-3;
  if (defect == GIVES_NAN) y[1] = NAN;
  return MSIM_OK;
}

static void diagonal_destroy(void *self) {
  if (!self) return;
  const msim_host *host = *(const msim_host **)self;
  if (defect == FREES_ELSEWHERE) free(self);
  else host->free(host, self);
}

static const msim_backend diagonal = {.abi = MSIM_BACKEND_ABI,
                                      .size = sizeof(msim_backend),
                                      .name = "diagonal",
                                      .library = "none",
                                      .license = "MIT",
                                      .format = MSIM_FORMAT_FULL,
                                      .create = diagonal_create,
                                      .order = diagonal_order,
                                      .analyze = diagonal_analyze,
                                      .factor = diagonal_factor,
                                      .solve = diagonal_solve,
                                      .destroy = diagonal_destroy};

/*------------------------------------- a faulty host --------------------------------------------*/

/* Calls: c create, o order, a analyze, f factor, s solve, d destroy. Breaches by the host in
 * between: m move the matrix, p change its pattern, n write NaN to it, u make it nonsymmetric, b
 * change b, i keep an old info, t request what no flag offers. z is allowed: a matrix that is
 * refused. */
static const char *play(const char *script) {
  counting_host host;
  int32_t ptr[] = {0, 2, 4}, ind[] = {0, 1, 0, 1}, other[] = {0, 1, 0, 1};
  int32_t graphptr[] = {0, 1, 2}, graph[] = {1, 0}, perm[2], kind = MSIM_FACTOR_SPD;
  _Alignas(64) double val[] = {2, 0, 0, 4};
  double b[] = {1, 2}, y[2] = {0};
  msim_system A = {.size = sizeof A,
                   .n = 2,
                   .block = 1,
                   .format = MSIM_FORMAT_FULL,
                   .graphptr = ptr,
                   .graphind = ind,
                   .rowptr = ptr,
                   .colind = ind,
                   .val = val};
  const msim_solve_params params = {sizeof params, 1e-8, 10};
  int old_info = 0;
  checked = checking_backend(&diagonal);
  host_init(&host);
  for (; *script; script++) {
    msim_solve_info info = {.size = sizeof info, .iterations = old_info};
    const char call = *script;
    if (call == 'c') checked->create(&host.host, &instance);
    if (call == 'o') checked->order(instance, 2, graphptr, graph, perm);
    if (call == 'a') checked->analyze(instance, &A, &info);
    if (call == 'f') checked->factor(instance, &A, kind, &info);
    if (call == 's') checked->solve(instance, &A, &params, 1, b, y, &info);
    if (call == 'd') checked->destroy(instance);
    if (call == 'm') A.colind = other;
    if (call == 'p') ind[1] = 0;
    if (call == 'n') val[0] = NAN;
    if (call == 'u') val[1] = 1;
    if (call == 'b') b[0] = INFINITY;
    if (call == 'i') old_info = 1;
    if (call == 't') kind = MSIM_FACTOR_SYMMETRIC;
    if (call == 'z') val[0] = -1;
  }
  return checking_report();
}

static void expect(const char *script, const char *found) {
  const char *report = play(script);
  if (found[0] ? !strstr(report, found) : report[0] != '\0')
    fail_msg("script \"%s\", defect %d: found \"%s\", expected \"%s\"", script, (int)defect, report,
             found);
}

static void no_breach_is_reported_without_one(void **state) {
  (void)state;
  const char *const scripts[] = {"cd", "cod", "cad", "coafsd", "cafd", "caffssfsd", "cafszfd"};
  for (size_t i = 0; i < sizeof scripts / sizeof *scripts; i++) expect(scripts[i], "");
}

static void breaches_by_hosts_are_found(void **state) {
  (void)state;
  const struct {
    const char *script, *found;
  } cases[] = {
      {"cfd", "host: factor was called too early"},
      {"casd", "host: solve was called too early"},
      {"cafzfsd", "host: solve was called too early"},
      {"caod", "host: order was called too late"},
      {"caad", "host: analyze was called too late"},
      {"cdd", "host: destroy was called after destroy"},
      {"cafsds", "host: solve was called after destroy"},
      {"camfd", "host: factor was given another system than analyze"},
      {"cafmsd", "host: solve was given another system than analyze"},
      {"capfd", "host: factor was given another pattern than analyze"},
      {"cpad", "host: analyze was given rows whose columns do not ascend"},
      {"canfd", "host: factor was given values that are not finite"},
      {"caufd", "host: factor was given a matrix that is not symmetric"},
      {"cafbsd", "host: solve was given a right-hand side that is not finite"},
      {"caifd", "host: factor was given an info that is not zero"},
      {"catfd", "host: factor was given a kind that the flags do not offer"},
  };
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) expect(cases[i].script, cases[i].found);
}

static void breaches_by_backends_are_found(void **state) {
  (void)state;
  const struct {
    enum defect vice;
    const char *script, *found;
  } cases[] = {
      {GIVES_NO_SELF, "cd", "backend: create succeeded without an instance"},
      {FREES_ELSEWHERE, "cd", "backend: destroy did not free memory of the host"},
      {REPEATS_A_ROW, "cod", "backend: order returned no permutation"},
      {WRITES_TO_GRAPH, "cod", "backend: order wrote to the graph"},
      {WRITES_TO_PATTERN, "cad", "backend: analyze wrote to the pattern"},
      {WRITES_TO_VALUES, "cafsd", "backend: solve wrote to the values"},
      {WRITES_TO_RIGHT_SIDE, "cafsd", "backend: solve wrote to the right-hand side"},
      {LIES, "cafsd", "backend: solve returned a solution with too large a residual"},
      {GIVES_NAN, "cafsd", "backend: solve returned a solution with too large a residual"},
      {COUNTS_BACKWARDS, "cafd", "backend: factor reports a negative number of iterations"},
      {STOPS, "cafd", "backend: factor returned an invalid status"},
      {IS_SILENT, "cazfd", "backend: factor failed without an error message"},
      {CALLS_BACK, "cafsd", "host: destroy overlaps another call"},
  };
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    defect = cases[i].vice;
    expect(cases[i].script, cases[i].found);
  }
  defect = NONE;
  expect("coafsd", "");
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(no_breach_is_reported_without_one),
                                     cmocka_unit_test(breaches_by_hosts_are_found),
                                     cmocka_unit_test(breaches_by_backends_are_found)};
  return cmocka_run_group_tests_name("checking_backend", tests, NULL, NULL);
}
