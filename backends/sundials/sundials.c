/* sundials - solver plugins: the five Krylov solvers of SUNDIALS; -DSOLVER=... selects one.
 *
 * The solvers use A and its preconditioner as functions and vectors through a table of operations.
 * The vectors are implemented here: in the host's layout, including the padding, and compiled with
 * optimization (Debian's SUNDIALS is not).
 *
 * Each call of the library solves for a correction, A x = r / ||S r||, from x = 0, because its
 * tolerance is absolute and two of the five solvers refuse another initial guess. The
 * preconditioner P is applied from the right, where the stopping criterion is the norm of the
 * residual, scaled by S. The host asks for the norm sqrt(r.P r) <= ||S r|| with S^2 = block
 * diag(P), since P <= block diag(P) for diagonal blocks of `block` scalars. The solvers update that
 * residual by recurrences, which accumulate rounding errors; therefore the true residual decides,
 * and calls are repeated until it is small enough. */
#include <float.h>
#include <limits.h>
#include <math.h>
#include <string.h>

#include <sundials/sundials_iterative.h>
#include <sundials/sundials_nvector.h>
#include <sunlinsol/sunlinsol_pcg.h>
#include <sunlinsol/sunlinsol_spbcgs.h>
#include <sunlinsol/sunlinsol_spfgmr.h>
#include <sunlinsol/sunlinsol_spgmr.h>
#include <sunlinsol/sunlinsol_sptfqmr.h>

#include "msim/backend.h"

#define PASTE_(a, b) a##b
#define PASTE(a, b)  PASTE_(a, b)
#define STRING_(x)   #x
#define STRING(x)    STRING_(x)

/*------------------------------------- solvers --------------------------------------------------*/

#define CREATE_pcg     SUNLinSol_PCG
#define CREATE_spgmr   SUNLinSol_SPGMR
#define CREATE_spfgmr  SUNLinSol_SPFGMR
#define CREATE_spbcgs  SUNLinSol_SPBCGS
#define CREATE_sptfqmr SUNLinSol_SPTFQMR

#define FLAGS_pcg     MSIM_BACKEND_ITERATIVE
#define FLAGS_spgmr   (MSIM_BACKEND_ITERATIVE | MSIM_BACKEND_SYMMETRIC | MSIM_BACKEND_UNSYMMETRIC)
#define FLAGS_spfgmr  FLAGS_spgmr
#define FLAGS_spbcgs  FLAGS_spgmr
#define FLAGS_sptfqmr FLAGS_spgmr

enum { SYMMETRIC = (PASTE(FLAGS_, SOLVER) & MSIM_BACKEND_SYMMETRIC) != 0 };

/* Limits the iterations of a call. GMRES has no function for that, but its length may be lowered
 * below the allocated one. */
#define LIMIT_pcg(solver, n)     SUNLinSol_PCGSetMaxl(solver, n)
#define LIMIT_spgmr(solver, n)   (((SUNLinearSolverContent_SPGMR)(solver)->content)->maxl = (n))
#define LIMIT_spfgmr(solver, n)  (((SUNLinearSolverContent_SPFGMR)(solver)->content)->maxl = (n))
#define LIMIT_spbcgs(solver, n)  SUNLinSol_SPBCGSSetMaxl(solver, n)
#define LIMIT_sptfqmr(solver, n) SUNLinSol_SPTFQMRSetMaxl(solver, n)

/* GMRES stores one vector per iteration of a call, SPFGMR two, and longer calls need fewer
 * iterations in total. The last two solvers store none, but a call that breaks down has no result,
 * so calls should be short. SPTFQMR stagnates above rounding level. */
#define METHOD_pcg     4, 0, INT_MAX, 0
#define METHOD_spgmr   3, 1, 200, 0
#define METHOD_spfgmr  4, 2, 200, 0
#define METHOD_spbcgs  7, 0, 500, 0
#define METHOD_sptfqmr 11, 0, 500, 1e-6

static const struct {
  int vectors;      /* number that SUNDIALS allocates, */
  int more;         /* and for each iteration of a call */
  int longest;      /* maximum number of iterations of a call */
  double reduction; /* smallest reduction of the residual requested from a call */
} method = {PASTE(METHOD_, SOLVER)};

typedef struct krylov {
  const msim_host *host;
  SUNContext context;
  SUNLinearSolver solver;
  size_t length;           /* of a vector */
  int call_iterations;     /* maximum number of iterations of a call */
  N_Vector unused_vectors; /* list of unused vectors */
  N_Vector r, x, z;        /* residual, correction, P r */
  N_Vector scale;          /* S; 1 in the padding */
  const msim_system *A;    /* set by krylov_solve() */
  int32_t kind;
  N_Vector product;           /* A v, while v'A v has not been checked */
  int indefinite, not_finite; /* curvature was negative, or not finite */
} krylov;

/*------------------------------------- vectors --------------------------------------------------*/

typedef struct vector_content {
  krylov *owner;
  N_Vector next;
  double *value;
} vector_content;

static vector_content *content_of(N_Vector v) { return v->content; }
static double *value_of(N_Vector v) { return content_of(v)->value; }
static size_t length_of(N_Vector v) { return content_of(v)->owner->length; }

/* Separate loops for operations in place, so that the operands of a loop never overlap: an exact
 * overlap is correct, but compilers do not vectorize it. */
static void scale_array(size_t n, double a, const double *restrict x, double *restrict z) {
  for (size_t i = 0; i < n; i++) z[i] = a * x[i];
}

static void scale_in_place(size_t n, double a, double *z) {
  for (size_t i = 0; i < n; i++) z[i] *= a;
}

static void add_arrays(size_t n, double a, const double *restrict x, double b,
                       const double *restrict y, double *restrict z) {
  for (size_t i = 0; i < n; i++) z[i] = a * x[i] + b * y[i];
}

static void add_in_place(size_t n, double a, const double *restrict x, double b,
                         double *restrict z) {
  for (size_t i = 0; i < n; i++) z[i] = a * x[i] + b * z[i];
}

/* 8 partial sums, an order that SIMD registers of any width can follow, then a binary tree */
static double dot_arrays(size_t n, const double *x, const double *y) {
  enum { LANES = 8 };
  double sum[LANES] = {0};
  size_t i = 0;
  for (; i + LANES <= n; i += LANES)
    for (size_t lane = 0; lane < LANES; lane++) sum[lane] += x[i + lane] * y[i + lane];
  for (size_t lane = 0; i < n; i++, lane++) sum[lane] += x[i] * y[i];
  return ((sum[0] + sum[4]) + (sum[2] + sum[6])) + ((sum[1] + sum[5]) + (sum[3] + sum[7]));
}

/* Check the curvature v'A v: if it is negative, A is not positive definite; if it is not finite,
 * the call cannot succeed. */
static void check_curvature(krylov *self, N_Vector v, double curvature) {
  const int negative = curvature <= 0 && dot_arrays(self->length, value_of(v), value_of(v)) > 0;
  if (self->kind == MSIM_FACTOR_SPD && negative) self->indefinite = 1;
  if (!isfinite(curvature)) self->not_finite = 1;
  self->product = NULL;
}

static double vector_dot(N_Vector x, N_Vector y) {
  const double sum = dot_arrays(length_of(x), value_of(x), value_of(y));
  krylov *self = content_of(x)->owner;
  if (self->product && (x == self->product || y == self->product))
    check_curvature(self, x == self->product ? y : x, sum);
  return sum;
}

static void vector_const(double c, N_Vector z) {
  double *value = value_of(z);
  for (size_t i = 0; i < length_of(z); i++) value[i] = c;
}

static void vector_scale(double a, N_Vector x, N_Vector z) {
  if (x == z) scale_in_place(length_of(z), a, value_of(z));
  else if (a == 1) memcpy(value_of(z), value_of(x), length_of(z) * sizeof(double));
  else scale_array(length_of(z), a, value_of(x), value_of(z));
}

static void vector_sum(double a, N_Vector x, double b, N_Vector y, N_Vector z) {
  const size_t n = length_of(z);
  if (x == y) vector_scale(a + b, x, z);
  else if (x == z) add_in_place(n, b, value_of(y), a, value_of(z));
  else if (y == z) add_in_place(n, a, value_of(x), b, value_of(z));
  else add_arrays(n, a, value_of(x), b, value_of(y), value_of(z));
}

/* z = sum_k c[k] x[k], in chunks that fit into the cache. z may be one of the x. */
static int vector_combine(int count, double *c, N_Vector *x, N_Vector z) {
  enum { CHUNK = 512 };
  double sum[CHUNK];
  for (size_t at = 0, n = length_of(z); at < n; at += CHUNK) {
    const size_t m = n - at < CHUNK ? n - at : CHUNK;
    scale_array(m, c[0], value_of(x[0]) + at, sum);
    for (int k = 1; k < count; k++) add_in_place(m, c[k], value_of(x[k]) + at, 1, sum);
    memcpy(value_of(z) + at, sum, m * sizeof *sum);
  }
  return 0;
}

/* SUNDIALS requires these two for scaling by vectors. */
static void vector_product(N_Vector x, N_Vector y, N_Vector z) {
  for (size_t i = 0; i < length_of(z); i++) value_of(z)[i] = value_of(x)[i] * value_of(y)[i];
}

static void vector_quotient(N_Vector x, N_Vector y, N_Vector z) {
  for (size_t i = 0; i < length_of(z); i++) value_of(z)[i] = value_of(x)[i] / value_of(y)[i];
}

static N_Vector vector_clone(N_Vector v);
static void vector_destroy(N_Vector v);

static N_Vector vector_create(krylov *self) {
  N_Vector v = N_VNewEmpty(self->context);
  vector_content *c = self->host->alloc(self->host, sizeof *c);
  double *value = self->host->alloc(self->host, self->length * sizeof *value);
  if (!v || !c || !value) {
    self->host->free(self->host, value);
    self->host->free(self->host, c);
    N_VFreeEmpty(v);
    return NULL;
  }
  memset(value, 0, self->length * sizeof *value);
  *c = (vector_content){.owner = self, .value = value};
  v->content = c;
  v->ops->nvclone = vector_clone;
  v->ops->nvdestroy = vector_destroy;
  v->ops->nvlinearsum = vector_sum;
  v->ops->nvconst = vector_const;
  v->ops->nvprod = vector_product;
  v->ops->nvdiv = vector_quotient;
  v->ops->nvscale = vector_scale;
  v->ops->nvdotprod = vector_dot;
  v->ops->nvlinearcombination = vector_combine;
  return v;
}

static void vector_free(N_Vector v) {
  krylov *self = content_of(v)->owner;
  self->host->free(self->host, value_of(v));
  self->host->free(self->host, v->content);
  N_VFreeEmpty(v);
}

/* SUNDIALS 6 crashes if a clone finds no memory, so clones come from a list made before. */
static N_Vector vector_clone(N_Vector v) {
  krylov *self = content_of(v)->owner;
  N_Vector clone = self->unused_vectors;
  if (!clone) return vector_create(self);
  self->unused_vectors = content_of(clone)->next;
  return clone;
}

static void vector_destroy(N_Vector v) {
  krylov *self = content_of(v)->owner;
  content_of(v)->next = self->unused_vectors;
  self->unused_vectors = v;
}

static int vectors_reserve(krylov *self, int count) {
  while (count-- > 0) {
    N_Vector v = vector_create(self);
    if (!v) return 0;
    vector_destroy(v);
  }
  return 1;
}

/*------------------------------------- callbacks ------------------------------------------------*/

/* z = A v, and a check of v'A v, which may end the call. For conjugate gradients the check follows
 * in vector_dot, because the solver computes v'A v itself in its next operation. */
static int apply_matrix(void *data, N_Vector v, N_Vector z) {
  krylov *self = data;
  self->A->apply(self->A, value_of(v), value_of(z));
  self->product = z;
  if (SYMMETRIC) vector_dot(v, z);
  return self->indefinite || self->not_finite;
}

static int apply_preconditioner(void *data, N_Vector r, N_Vector z, double tolerance, int side) {
  (void)tolerance, (void)side;
  krylov *self = data;
  self->A->precondition(self->A, value_of(r), value_of(z));
  return 0;
}

/*------------------------------------- one right-hand side --------------------------------------*/

/* sqrt(r.P r) */
static double preconditioned_norm(krylov *self, const double *r) {
  self->A->precondition(self->A, r, value_of(self->z));
  const double square = dot_arrays(self->length, r, value_of(self->z));
  return sqrt(square < 0 ? 0 : square); /* NaN stays, as fmax would not let it */
}

/* ||S r|| */
static double scaled_norm(krylov *self) {
  vector_product(self->scale, self->r, self->z);
  return sqrt(vector_dot(self->z, self->z));
}

/* Compute S. P is block diagonal: applied to the vector that is 1 in one component of all block
 * rows and 0 in the others, it gives the diagonal entries of that component. */
static void compute_scale(krylov *self, const msim_system *A) {
  double *scale = value_of(self->scale), *one = value_of(self->r), *column = value_of(self->z);
  const size_t n = (size_t)A->n;
  vector_const(1, self->scale);
  for (int32_t c = 0; c < A->block; c++) {
    const size_t first = (size_t)c * (size_t)A->stride;
    vector_const(0, self->r);
    for (size_t i = first; i < first + n; i++) one[i] = 1;
    A->precondition(A, one, column);
    for (size_t i = first; i < first + n; i++) scale[i] = sqrt(A->block * column[i]);
  }
}

/* r = b - A y; return its norm */
static double compute_residual(krylov *self, const double *b, const double *y) {
  double *r = value_of(self->r);
  self->A->apply(self->A, y, r);
  add_in_place(self->length, 1, b, -1, r);
  return preconditioned_norm(self, r);
}

/* Compute x, an approximation of A^-1 r / size, to the norm `goal` or up to *limit iterations,
 * which is set to the number made. A reduction by a factor of 10 at least is requested, because
 * SPTFQMR's estimate may report a smaller one without any. Returns 1 if there is a result.
 * Then the curvature x'A x is checked as well, which is most sensitive to the smallest eigenvalues;
 * for conjugate gradients it is a sum of curvatures already checked. Overwrites r. */
static int compute_correction(krylov *self, double size, double goal, int *limit) {
  const double factor = fmax(fmin(0.5 * goal / size, 0.1), method.reduction);
  scale_in_place(self->length, 1 / size, value_of(self->r));
  vector_const(0, self->x);
  self->product = NULL, self->not_finite = 0;
  SUNLinSolSetZeroGuess(self->solver, SUNTRUE);
  PASTE(LIMIT_, SOLVER)(self->solver, *limit);
  const int flag = SUNLinSolSolve(self->solver, NULL, self->x, self->r, factor);
  const int shown = !flag || flag == SUNLS_RES_REDUCED;
  if (!shown) vector_const(0, self->x);
  else if (SYMMETRIC) apply_matrix(self, self->x, self->r);
  *limit = SUNLinSolNumIters(self->solver);
  return shown;
}

/* Add corrections as long as they reduce the residual; y is the best solution so far. A call that
 * breaks down is repeated with half as many iterations. */
static msim_status solve_right_hand_side(krylov *self, const msim_solve_params *params,
                                         const double *b, double *y, msim_solve_info *info) {
  double *x = value_of(self->x);
  const double size = preconditioned_norm(self, b),
               goal = fmax(params->rtol, DBL_EPSILON / 4) * size;
  if (size == 0) memset(y, 0, self->length * sizeof *y);
  double left = compute_residual(self, b, y);
  int count = 0, cycle = self->call_iterations;
  while (left > goal && count < params->max_iterations && cycle > 0) {
    int used = cycle < params->max_iterations - count ? cycle : params->max_iterations - count;
    const double scaled = scaled_norm(self);
    const int shown = compute_correction(self, scaled, goal, &used);
    count += used;
    if (self->indefinite) break;
    add_in_place(self->length, 1, y, scaled, x);
    const double now = compute_residual(self, b, x);
    const int gained = now < 0.99 * left;
    if (now < left) memcpy(y, x, self->length * sizeof *y), left = now;
    else compute_residual(self, b, y);
    cycle = shown ? self->call_iterations : used / 2;
    if (shown && !gained) break;
  }
  info->iterations += count;
  const double relative = size == 0 ? 0 : left / size;
  if (!(relative <= info->residual)) info->residual = relative;
  if (self->indefinite) info->definite = MSIM_DEFINITE_NOT;
  if (self->indefinite) return MSIM_NOT_SPD;
  return left <= goal && isfinite(goal) ? MSIM_OK : MSIM_NOT_CONVERGED;
}

/*------------------------------------- plugin functions -----------------------------------------*/

static msim_status krylov_refuse(krylov *self, const char *why) {
  self->host->fail(self->host, "%s", why);
  return MSIM_ERR_ARG;
}

static msim_status krylov_create(const msim_host *host, void **result) {
  krylov *self = host->alloc(host, sizeof *self);
  *result = self;
  if (!self) return MSIM_ERR_MEMORY;
  memset(self, 0, sizeof *self);
  self->host = host;
#if SUNDIALS_VERSION_MAJOR >= 7
  if (SUNContext_Create(SUN_COMM_NULL, &self->context)) return MSIM_ERR_MEMORY;
  SUNContext_ClearErrHandlers(self->context); /* they print */
#else
  if (SUNContext_Create(NULL, &self->context)) return MSIM_ERR_MEMORY;
#endif
  return MSIM_OK;
}

/* Iterations of a call: for GMRES, vectors of at most 128 MiB, but at least 30 iterations and at
 * most as many as unknowns. */
static int max_call_iterations(const msim_system *A) {
  const int64_t memory = 1 << 27, unknowns = (int64_t)A->block * A->n;
  const int64_t bytes = (int64_t)A->block * A->stride * (int64_t)sizeof(double);
  int64_t count = method.longest;
  if (method.more == 0) return method.longest;
  if (count * method.more * bytes > memory) count = memory / (method.more * bytes);
  if (count < 30) count = 30;
  return (int)(count < unknowns ? count : unknowns);
}

static msim_status krylov_analyze(void *data, const msim_system *A, msim_solve_info *info) {
  (void)info;
  krylov *self = data;
  if (A->format != MSIM_FORMAT_NONE) return krylov_refuse(self, "A must have MSIM_FORMAT_NONE");
  if (A->n < 1 || A->block < 1 || A->block > 3 || A->stride < A->n)
    return krylov_refuse(self, "A must have at least one block row, of 1 to 3 scalars");
  self->call_iterations = max_call_iterations(A);
  self->length = (size_t)A->block * (size_t)A->stride;
  self->r = vector_create(self);
  self->x = vector_create(self);
  self->z = vector_create(self);
  self->scale = vector_create(self);
  const int more = method.more ? method.more * self->call_iterations : 0;
  if (!self->r || !self->x || !self->z || !self->scale ||
      !vectors_reserve(self, method.vectors + more))
    return MSIM_ERR_MEMORY;
  self->solver =
      PASTE(CREATE_, SOLVER)(self->x, SUN_PREC_RIGHT, self->call_iterations, self->context);
  if (!self->solver || SUNLinSolSetATimes(self->solver, self, apply_matrix) ||
      SUNLinSolSetPreconditioner(self->solver, self, NULL, apply_preconditioner) ||
      SUNLinSolSetScalingVectors(self->solver, self->scale, self->scale) ||
      SUNLinSolInitialize(self->solver))
    return MSIM_ERR_MEMORY;
  return MSIM_OK;
}

static msim_status krylov_factor(void *data, const msim_system *A, int32_t kind,
                                 msim_solve_info *info) {
  (void)info;
  krylov *self = data;
  if (kind != MSIM_FACTOR_SPD &&
      !(SYMMETRIC && (kind == MSIM_FACTOR_SYMMETRIC || kind == MSIM_FACTOR_UNSYMMETRIC)))
    return krylov_refuse(self, "this solver supports symmetric positive definite systems only");
  self->kind = kind;
  compute_scale(self, A);
  return MSIM_OK;
}

static msim_status krylov_solve(void *data, const msim_system *A, const msim_solve_params *params,
                                int32_t nrhs, const double *b, double *y, msim_solve_info *info) {
  krylov *self = data;
  if (nrhs < 1) return krylov_refuse(self, "nrhs must be at least 1");
  self->A = A;
  self->indefinite = 0;
  msim_status worst = MSIM_OK;
  for (int32_t k = 0; k < nrhs && worst != MSIM_NOT_SPD;
       k++, b += self->length, y += self->length) {
    msim_status status = solve_right_hand_side(self, params, b, y, info);
    if (status) worst = status;
  }
  return worst;
}

static void krylov_destroy(void *data) {
  krylov *self = data;
  if (!self) return;
  if (self->solver) {
    PASTE(LIMIT_, SOLVER)(self->solver, self->call_iterations); /* for the arrays it frees */
    SUNLinSolFree(self->solver);
  }
  N_Vector own[] = {self->r, self->x, self->z, self->scale};
  for (size_t i = 0; i < sizeof own / sizeof *own; i++)
    if (own[i]) vector_free(own[i]);
  while (self->unused_vectors) vector_free(vector_clone(self->unused_vectors));
  SUNContext_Free(&self->context);
  self->host->free(self->host, self);
}

#define ENTRY(name) MSIM_BACKEND_ENTRY(name)

ENTRY(PASTE(sundials_, SOLVER)) {
  static const msim_backend table = {.abi = MSIM_BACKEND_ABI,
                                     .size = sizeof(msim_backend),
                                     .name = "sundials-" STRING(SOLVER),
                                     .library = "SUNDIALS " SUNDIALS_VERSION,
                                     .license = "BSD-3-Clause",
                                     .flags = PASTE(FLAGS_, SOLVER),
                                     .format = MSIM_FORMAT_NONE,
                                     .create = krylov_create,
                                     .analyze = krylov_analyze,
                                     .factor = krylov_factor,
                                     .solve = krylov_solve,
                                     .destroy = krylov_destroy};
  return &table;
}
