#include "checking_backend.h"

#include <float.h>
#include <math.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "graph_checks.h"

/* The state of an instance, which decides which calls are allowed. */
enum { BROKEN, CREATED, ANALYZED, FACTORED, DESTROYED };

typedef struct checked_instance {
  msim_host lent; /* first member: the host that the inner backend is given */
  const msim_host *outer;
  void *self; /* instance of the inner backend */
  int stage;
  int32_t format;    /* that it has chosen */
  atomic_int inside; /* number of calls in progress */
  int live;          /* blocks of the host's memory that it has not freed */
  int said;          /* 1: it reported an error message in this call */
  msim_system system;
  uint64_t pattern;
  double *factored; /* a copy of the values at checked_factor(); NULL without a matrix */
  struct checked_instance *next;
} checked_instance;

static const msim_backend *inner;
static pthread_mutex_t report_mutex = PTHREAD_MUTEX_INITIALIZER; /* protects what follows */
static checked_instance *all_instances;                          /* all, also destroyed ones */
static char report[4096];

/*------------------------------------- breaches -------------------------------------------------*/

static void report_error(const char *who, const char *call, const char *what) {
  pthread_mutex_lock(&report_mutex);
  size_t used = strlen(report);
  snprintf(report + used, sizeof report - used, "%s: %s %s\n", who, call, what);
  pthread_mutex_unlock(&report_mutex);
}

static void expect_host(int holds, const char *call, const char *what) {
  if (!holds) report_error("host", call, what);
}

static void expect_backend(int holds, const char *call, const char *what) {
  if (!holds) report_error("backend", call, what);
}

const char *checking_report(void) {
  static char last[sizeof report];
  memcpy(last, report, sizeof report);
  report[0] = '\0';
  while (all_instances) {
    checked_instance *w = all_instances;
    all_instances = w->next;
    free(w->factored);
    free(w);
  }
  return last;
}

/*------------------------------------- host of the inner backend --------------------------------*/

static void *wrapped_alloc(const msim_host *host, size_t bytes) {
  checked_instance *w = host->data;
  void *block = w->outer->alloc(w->outer, bytes);
  w->live += block != NULL;
  return block;
}

static void wrapped_free(const msim_host *host, void *block) {
  checked_instance *w = host->data;
  w->live -= block != NULL;
  w->outer->free(w->outer, block);
}

static void wrapped_fail(const msim_host *host, const char *format, ...) {
  checked_instance *w = host->data;
  char sentence[512];
  va_list args;
  va_start(args, format);
  vsnprintf(sentence, sizeof sentence, format, args);
  va_end(args);
  w->said = sentence[0] != '\0';
  w->outer->fail(w->outer, "%s", sentence);
}

/*------------------------------------- begin and end of a call ----------------------------------*/

/* 0: the call is not allowed now, and the inner backend is not called. */
static int begin_call(checked_instance *w, const char *call, int least, int most) {
  const char *wrong = w->stage == DESTROYED ? "was called after destroy"
                      : w->stage == BROKEN  ? "was called after a failure"
                      : w->stage < least    ? "was called too early"
                      : w->stage > most     ? "was called too late"
                                            : NULL;
  if (!wrong && atomic_fetch_add(&w->inside, 1) > 0) {
    atomic_fetch_sub(&w->inside, 1);
    wrong = "overlaps another call";
  }
  if (wrong) report_error("host", call, wrong);
  w->said = 0;
  return !wrong;
}

static void end_call(checked_instance *w, const char *call, msim_status status) {
  const msim_status known[] = {MSIM_OK,      MSIM_NOT_SPD,    MSIM_NOT_CONVERGED,
                               MSIM_ERR_ARG, MSIM_ERR_MEMORY, MSIM_ERR_BACKEND};
  int found = 0;
  for (size_t i = 0; i < sizeof known / sizeof *known; i++) found |= status == known[i];
  expect_backend(found, call, "returned an invalid status");
  /* if memory runs out the host supplies the message itself */
  expect_backend(status >= 0 || status == MSIM_ERR_MEMORY || w->said, call,
                 "failed without an error message");
  atomic_fetch_sub(&w->inside, 1);
}

/* FNV-1a, continued from `hash` */
static uint64_t hash_bytes(uint64_t hash, const void *data, size_t bytes) {
  const unsigned char *byte = data;
  for (size_t i = 0; i < bytes; i++) hash = (hash ^ byte[i]) * 0x100000001b3u;
  return hash;
}

static int all_finite(const double *x, size_t n) {
  for (size_t i = 0; i < n; i++)
    if (!isfinite(x[i])) return 0;
  return 1;
}

static void check_info(const char *call, const msim_solve_info *info) {
  expect_backend(info->size == sizeof *info, call, "changed info->size");
  expect_backend(info->iterations >= 0, call, "reports a negative number of iterations");
  expect_backend(info->residual >= 0, call, "reports a residual that is negative or NaN");
  expect_backend(info->fill >= 0 && isfinite(info->fill), call,
                 "reports a fill that is negative or not finite");
  expect_backend(info->flops >= 0 && isfinite(info->flops), call,
                 "reports flops that are negative or not finite");
  expect_backend(info->definite >= -1 && info->definite <= 1, call,
                 "reports an invalid definiteness");
}

/* Every member except size is 0. */
static void check_blank(const char *call, const msim_solve_info *info) {
  const msim_solve_info blank = {.size = sizeof blank};
  expect_host(info && memcmp(info, &blank, sizeof blank) == 0, call,
              "was given an info that is not zero");
}

/*------------------------------------- graphs and matrices --------------------------------------*/

/* 1 if the scalar pattern is that of the blocks, each of them full. */
static int is_expanded(const msim_system *A) {
  int32_t at = 0;
  for (int32_t r = 0; r < A->block * A->n; r++) {
    if (A->rowptr[r] != at) return 0;
    for (int32_t e = A->graphptr[r / A->block]; e < A->graphptr[r / A->block + 1]; e++)
      for (int32_t c = 0; c < A->block; c++)
        if (A->colind[at++] != A->block * A->graphind[e] + c) return 0;
  }
  return A->rowptr[A->block * A->n] == at;
}

static int is_symmetric(const msim_system *A) {
  for (int32_t r = 0; r < A->block * A->n; r++)
    for (int32_t e = A->rowptr[r]; e < A->rowptr[r + 1]; e++) {
      int32_t other = find_entry(A->rowptr, A->colind, A->colind[e], r);
      if (other >= 0 && A->val[other] != A->val[e]) return 0;
    }
  return 1;
}

static size_t entries(const msim_system *A) { return (size_t)A->rowptr[A->block * A->n]; }

static size_t length(const msim_system *A) {
  return (size_t)A->block * (size_t)(A->format == MSIM_FORMAT_NONE ? A->stride : A->n);
}

static uint64_t hash_graph(int32_t n, const int32_t *ptr, const int32_t *ind) {
  return hash_bytes(hash_bytes(1, ptr, ((size_t)n + 1) * sizeof *ptr), ind,
                    (size_t)ptr[n] * sizeof *ind);
}

static uint64_t hash_pattern(const msim_system *A) {
  if (A->format == MSIM_FORMAT_NONE) return 0;
  return hash_graph(A->n, A->graphptr, A->graphind) ^
         hash_graph(A->block * A->n, A->rowptr, A->colind) << 1;
}

static uint64_t hash_values(const msim_system *A) {
  return A->format == MSIM_FORMAT_NONE ? 0 : hash_bytes(1, A->val, entries(A) * sizeof(double));
}

static void check_matrix(const msim_system *A) {
  const int there = A->graphptr && A->graphind && A->rowptr && A->colind && A->val;
  expect_host(there, "analyze", "was given an incomplete matrix");
  if (!there) return;
  expect_host((uintptr_t)A->val % 64 == 0, "analyze", "was given values not aligned to 64 bytes");
  expect_host(ascending(A->n, A->graphptr, A->graphind), "analyze",
              "was given rows whose columns do not ascend");
  expect_host(has_diagonal(A->n, A->graphptr, A->graphind), "analyze",
              "was given an incomplete diagonal");
  expect_host(is_expanded(A), "analyze", "was given patterns of blocks and scalars that differ");
  if (A->format == MSIM_FORMAT_FULL)
    expect_host(has_both_triangles(A->n, A->graphptr, A->graphind), "analyze",
                "was given one triangle instead of both");
  for (int32_t r = 0; A->format == MSIM_FORMAT_UPPER && r < A->n; r++)
    expect_host(A->graphind[A->graphptr[r]] == r, "analyze", "was given a lower triangle");
}

static void check_system(const checked_instance *w, const msim_system *A) {
  expect_host(A->size >= sizeof *A, "analyze", "was given a short msim_system");
  expect_host(A->n >= 1 && A->block >= 1 && A->block <= 3, "analyze", "was given an invalid size");
  expect_host(A->format == w->format, "analyze", "was given another format");
  if (A->format != MSIM_FORMAT_NONE) {
    check_matrix(A);
    return;
  }
  expect_host(!A->graphptr && !A->graphind && !A->rowptr && !A->colind && !A->val, "analyze",
              "was given a matrix with format NONE");
  expect_host(A->stride >= A->n && A->apply && A->precondition, "analyze",
              "was given no apply() or precondition(), or a stride < n");
  expect_host(!(inner->flags & MSIM_BACKEND_TWO_LEVEL) == !A->two_level, "analyze",
              "was given two_level() or not, against its flags");
}

/* The same system at the same addresses as in checked_analyze(). */
static void check_unmoved(const checked_instance *w, const char *call, const msim_system *A) {
  expect_host(memcmp(A, &w->system, sizeof *A) == 0, call, "was given another system than analyze");
  expect_host(hash_pattern(A) == w->pattern, call, "was given another pattern than analyze");
}

/*------------------------------------- solutions ------------------------------------------------*/

/* y += A x, or |A| x, with the values at checked_factor() */
static void multiply(const msim_system *A, const double *val, int absolute, const double *x,
                     double *y) {
  for (int32_t r = 0; r < A->block * A->n; r++)
    for (int32_t e = A->rowptr[r]; e < A->rowptr[r + 1]; e++) {
      const int32_t c = A->colind[e];
      const double value = absolute ? fabs(val[e]) : val[e];
      y[r] += value * x[c];
      if (A->format == MSIM_FORMAT_UPPER && c / A->block > r / A->block) y[c] += value * x[r];
    }
}

/* z = D^-1 r by elimination in each diagonal block D, which is positive definite */
static void divide_by_blocks(const msim_system *A, const double *val, const double *r, double *z) {
  const int32_t m = A->block;
  for (int32_t first = 0; first < m * A->n; first += m) {
    double d[3][4] = {{0}};
    for (int32_t i = 0; i < m; i++) {
      for (int32_t j = 0; j < m; j++)
        d[i][j] = val[find_entry(A->rowptr, A->colind, first + i, first + j)];
      d[i][3] = r[first + i];
    }
    for (int32_t k = 0; k < m; k++)
      for (int32_t i = 0; i < m; i++)
        for (int32_t j = 3; j >= k && i != k; j--) d[i][j] -= d[i][k] / d[k][k] * d[k][j];
    for (int32_t i = 0; i < m; i++) z[first + i] = d[i][3] / d[i][i];
  }
}

/* sqrt(r.D^-1 r) */
static double norm_of(const checked_instance *w, const double *r) {
  const msim_system *A = &w->system;
  const size_t n = length(A);
  double *z = calloc(n, sizeof *z), sum = 0;
  if (!z) abort();
  if (A->format == MSIM_FORMAT_NONE) A->precondition(A, r, z);
  else divide_by_blocks(A, w->factored, r, z);
  for (size_t i = 0; i < n; i++) sum += r[i] * z[i];
  free(z);
  return sqrt(fmax(0, sum));
}

/* ||b - A y|| <= rtol ||b||, or at most `slack` || |A| |y| + |b| ||. Without a matrix |A| is
 * unknown, and A |y| replaces |A| |y|. */
static int is_solved(const checked_instance *w, double rtol, double slack, const double *b,
                     const double *y) {
  const msim_system *A = &w->system;
  const size_t n = length(A);
  double *work = calloc(3 * n, sizeof *work), *r = work, *size = work + n, *positive = work + 2 * n;
  if (!work) abort();
  for (size_t i = 0; i < n; i++) positive[i] = fabs(y[i]);
  if (w->factored) {
    multiply(A, w->factored, 0, y, r);
    multiply(A, w->factored, 1, positive, size);
  } else {
    A->apply(A, y, r);
    A->apply(A, positive, size);
  }
  for (size_t i = 0; i < n; i++) r[i] = b[i] - r[i], size[i] = fabs(size[i]) + fabs(b[i]);
  const double left = norm_of(w, r);
  const int solved = left <= rtol * norm_of(w, b) || left <= slack * norm_of(w, size);
  free(work);
  return solved;
}

/* 1 if every entry that is no unknown is zero. */
static int is_padded(const msim_system *A, const double *x) {
  for (size_t i = 0; A->format == MSIM_FORMAT_NONE && i < length(A); i++)
    if (i % (size_t)A->stride >= (size_t)A->n && x[i] != 0) return 0;
  return 1;
}

/* An iteration must meet its tolerance, a factorization a small backward error; single precision is
 * enough for rtol >= 1e-4, as the host refines the solution. */
static void check_answer(const checked_instance *w, const msim_solve_params *params,
                         const double *b, const double *y) {
  const int iterative = (inner->flags & MSIM_BACKEND_ITERATIVE) != 0;
  /* a residual summed in another order differs in the last digits */
  const double rtol = iterative ? params->rtol * (1 + 1e-9) : 0;
  const double direct = params->rtol >= 1e-4 ? 1e-5 : 1e-8;
  const double slack = !iterative ? direct : w->factored ? 8 * DBL_EPSILON : 1e-13;
  expect_backend(is_padded(&w->system, y), "solve", "returned padding that is not zero");
  expect_backend(all_finite(y, length(&w->system)) && is_solved(w, rtol, slack, b, y), "solve",
                 "returned a solution with too large a residual");
}

/*------------------------------------- the table ------------------------------------------------*/

static msim_status checked_create(const msim_host *host, void **self) {
  checked_instance *w = calloc(1, sizeof *w);
  if (!w) return MSIM_ERR_MEMORY;
  *w = (checked_instance){.lent = {.size = sizeof w->lent,
                                   .alloc = wrapped_alloc,
                                   .free = wrapped_free,
                                   .fail = wrapped_fail,
                                   .data = w,
                                   .lock = host->lock,
                                   .unlock = host->unlock},
                          .outer = host,
                          .format = inner->format};
  atomic_init(&w->inside, 1);
  *self = w;
  pthread_mutex_lock(&report_mutex);
  w->next = all_instances;
  all_instances = w;
  pthread_mutex_unlock(&report_mutex);
  const msim_status status = inner->create(&w->lent, &w->self);
  w->stage = status ? BROKEN : CREATED;
  expect_backend(status || w->self, "create", "succeeded without an instance");
  end_call(w, "create", status);
  return status;
}

static msim_status checked_set_options(void *self, const char *text) {
  return inner->set_options(((checked_instance *)self)->self, text);
}

static int32_t checked_choose_format(void *self) {
  checked_instance *w = self;
  return w->format = inner->choose_format(w->self);
}

static msim_status checked_order(void *self, int32_t n, const int32_t *ptr, const int32_t *ind,
                                 int32_t *perm) {
  checked_instance *w = self;
  if (!begin_call(w, "order", CREATED, CREATED)) return MSIM_ERR_ARG;
  expect_host(n >= 1 && ptr && ind && perm, "order", "was given an incomplete graph");
  expect_host(ascending(n, ptr, ind), "order", "was given rows whose columns do not ascend");
  expect_host(has_both_triangles(n, ptr, ind), "order", "was given a graph that is not symmetric");
  for (int32_t r = 0; r < n; r++)
    expect_host(find_entry(ptr, ind, r, r) < 0, "order", "was given a graph with a diagonal");
  const uint64_t before = hash_graph(n, ptr, ind);
  const msim_status status = inner->order(w->self, n, ptr, ind, perm);
  expect_backend(hash_graph(n, ptr, ind) == before, "order", "wrote to the graph");
  expect_backend(status || is_permutation(n, perm), "order", "returned no permutation");
  if (status) w->stage = BROKEN;
  end_call(w, "order", status);
  return status;
}

static msim_status checked_analyze(void *self, const msim_system *A, msim_solve_info *info) {
  checked_instance *w = self;
  if (!begin_call(w, "analyze", CREATED, CREATED)) return MSIM_ERR_ARG;
  check_system(w, A);
  check_blank("analyze", info);
  w->system = *A;
  w->pattern = hash_pattern(A);
  const msim_status status = inner->analyze(w->self, A, info);
  expect_backend(hash_pattern(A) == w->pattern, "analyze", "wrote to the pattern");
  if (!status && A->val) w->factored = malloc(entries(A) * sizeof *w->factored);
  w->stage = status ? BROKEN : ANALYZED;
  check_info("analyze", info);
  end_call(w, "analyze", status);
  return status;
}

static msim_status checked_factor(void *self, const msim_system *A, int32_t kind,
                                  msim_solve_info *info) {
  checked_instance *w = self;
  if (!begin_call(w, "factor", ANALYZED, FACTORED)) return MSIM_ERR_ARG;
  check_unmoved(w, "factor", A);
  check_blank("factor", info);
  expect_host(kind == MSIM_FACTOR_SPD ||
                  (kind == MSIM_FACTOR_SYMMETRIC && inner->flags & MSIM_BACKEND_SYMMETRIC) ||
                  (kind == MSIM_FACTOR_UNSYMMETRIC && inner->flags & MSIM_BACKEND_UNSYMMETRIC),
              "factor", "was given a kind that the flags do not offer");
  if (A->val) {
    expect_host(all_finite(A->val, entries(A)), "factor", "was given values that are not finite");
    expect_host(kind == MSIM_FACTOR_UNSYMMETRIC || is_symmetric(A), "factor",
                "was given a matrix that is not symmetric");
    if (w->factored) memcpy(w->factored, A->val, entries(A) * sizeof *w->factored);
  }
  const uint64_t before = hash_values(A);
  const msim_status status = inner->factor(w->self, A, kind, info);
  expect_backend(hash_pattern(A) == w->pattern, "factor", "wrote to the pattern");
  expect_backend(hash_values(A) == before, "factor", "wrote to the values");
  w->stage = status ? ANALYZED : FACTORED;
  check_info("factor", info);
  end_call(w, "factor", status);
  return status;
}

static msim_status checked_solve(void *self, const msim_system *A, const msim_solve_params *params,
                                 int32_t nrhs, const double *b, double *y, msim_solve_info *info) {
  checked_instance *w = self;
  if (!begin_call(w, "solve", FACTORED, FACTORED)) return MSIM_ERR_ARG;
  const size_t n = length(A), all = nrhs > 0 ? n * (size_t)nrhs : 0;
  check_unmoved(w, "solve", A);
  check_blank("solve", info);
  expect_host(params->size >= sizeof *params && params->rtol >= 0 && params->max_iterations >= 1,
              "solve", "was given invalid parameters");
  expect_host(nrhs >= 1 && b && y && b != y, "solve", "was given missing or aliased vectors");
  expect_host(all_finite(b, all), "solve", "was given a right-hand side that is not finite");
  for (int32_t k = 0; k < nrhs; k++)
    expect_host(is_padded(A, b + (size_t)k * n) && is_padded(A, y + (size_t)k * n), "solve",
                "was given padding that is not zero");
  const uint64_t values = hash_values(A), right = hash_bytes(1, b, all * sizeof *b);
  const msim_status status = inner->solve(w->self, A, params, nrhs, b, y, info);
  expect_backend(hash_pattern(A) == w->pattern, "solve", "wrote to the pattern");
  expect_backend(hash_values(A) == values, "solve", "wrote to the values");
  expect_backend(hash_bytes(1, b, all * sizeof *b) == right, "solve",
                 "wrote to the right-hand side");
  for (int32_t k = 0; !status && k < nrhs; k++)
    check_answer(w, params, b + (size_t)k * n, y + (size_t)k * n);
  check_info("solve", info);
  end_call(w, "solve", status);
  return status;
}

static void checked_destroy(void *self) {
  checked_instance *w = self;
  if (!w) return;
  if (w->stage == BROKEN) w->stage = CREATED; /* destroy may follow any call */
  if (!begin_call(w, "destroy", CREATED, FACTORED)) return;
  inner->destroy(w->self);
  w->stage = DESTROYED;
  expect_backend(w->live == 0, "destroy", "did not free memory of the host");
  end_call(w, "destroy", MSIM_OK);
}

const msim_backend *checking_backend(const msim_backend *table) {
  static msim_backend checking;
  inner = table;
  checking = *table;
  checking.create = checked_create;
  checking.order = table->order ? checked_order : NULL;
  checking.analyze = checked_analyze;
  checking.factor = checked_factor;
  checking.solve = checked_solve;
  checking.destroy = checked_destroy;
  checking.set_options = table->set_options ? checked_set_options : NULL;
  checking.choose_format = table->choose_format ? checked_choose_format : NULL;
  return &checking;
}
