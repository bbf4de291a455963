/* klu - KLU's sparse LU, through SUNDIALS' SUNLinSol_KLU.
 *
 * The host's FULL matrix comes by rows. KLU wants columns: a symmetric one reads the same, of
 * others SUNDIALS solves the transposed system. The pattern is widened once to SUNDIALS' indices,
 * the values are read in place.
 *
 * Positive definite systems are factored with the diagonal for pivots, P A P' = L U, where U's
 * diagonal is that of L D L': its signs are A's, by Sylvester. SUNDIALS analyses and factors at
 * first, and afterwards refactors; where the condition number that it then estimates is above
 * eps^(-2/3), it factors anew. Others get partial pivoting, in a factor of its own, which begins
 * anew each time. */
#include <float.h>
#include <math.h>
#include <string.h>

#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_klu.h>
#include <sunmatrix/sunmatrix_sparse.h>

#include "msim/backend.h"

#define STRING_(x) #x
#define STRING(x)  STRING_(x)

/* KLU comes in two widths of an index; SUNDIALS names most of its functions, not these. */
#ifdef SUNDIALS_INT64_T
#  define KLU(function) klu_l_##function
#else
#  define KLU(function) klu_##function
#endif

typedef struct lu {
  const msim_host *host;
  SUNContext context;
  SUNMatrix matrix;
  double *own_data;                   /* what SUNDIALS allocated for the values, and has to free */
  int32_t *diagonal;                  /* where in the values a row's diagonal entry is */
  N_Vector b, y;                      /* the host's arrays */
  SUNLinearSolver solver[3], current; /* by kind, once they are needed */
} lu;

static msim_status refuse(lu *self, const char *why) {
  self->host->fail(self->host, "%s", why);
  return MSIM_ERR_ARG;
}

static msim_status out_of_memory(lu *self) {
  self->host->fail(self->host, "KLU ran out of memory");
  return MSIM_ERR_MEMORY;
}

/*------------------------------------- the matrix -----------------------------------------------*/

static msim_status create(const msim_host *host, void **result) {
  lu *self = host->alloc(host, sizeof *self);
  *result = self;
  if (!self) return MSIM_ERR_MEMORY;
  memset(self, 0, sizeof *self);
  self->host = host;
#if SUNDIALS_VERSION_MAJOR >= 7
  if (SUNContext_Create(SUN_COMM_NULL, &self->context)) return out_of_memory(self);
  SUNContext_ClearErrHandlers(self->context); /* they print */
#else
  if (SUNContext_Create(NULL, &self->context)) return out_of_memory(self);
#endif
  return MSIM_OK;
}

static msim_status check(lu *self, const msim_system *A) {
  if (A->format != MSIM_FORMAT_FULL) return refuse(self, "A must have both triangles");
  if (A->n < 1 || A->block < 1 || A->block > 3)
    return refuse(self, "A must have a block row or more, of 1 to 3 scalars");
  if (A->n >= INT32_MAX / A->block) return refuse(self, "A has too many rows");
  return MSIM_OK;
}

/* The pattern in SUNDIALS' indices, and where the diagonal is in it. */
static msim_status copy_pattern(lu *self, const msim_system *A) {
  const int32_t n = A->n * A->block;
  sunindextype *start = SM_INDEXPTRS_S(self->matrix), *row = SM_INDEXVALS_S(self->matrix);
  for (int32_t i = 0; i <= n; i++) start[i] = A->rowptr[i];
  for (int32_t e = 0; e < A->rowptr[n]; e++) row[e] = A->colind[e];
  for (int32_t i = 0; i < n; i++) {
    int32_t e = A->rowptr[i];
    while (e < A->rowptr[i + 1] && A->colind[e] < i) e++;
    if (e == A->rowptr[i + 1] || A->colind[e] != i)
      return refuse(self, "A must have all of its diagonal entries");
    self->diagonal[i] = e;
  }
  return MSIM_OK;
}

static msim_status analyze(void *data, const msim_system *A, msim_solve_info *info) {
  (void)info;
  lu *self = data;
  msim_status status = check(self, A);
  if (status) return status;
  const int32_t n = A->n * A->block;
  self->matrix = SUNSparseMatrix(n, n, A->rowptr[n], CSC_MAT, self->context);
  self->b = N_VNewEmpty_Serial(n, self->context);
  self->y = N_VNewEmpty_Serial(n, self->context);
  self->diagonal = self->host->alloc(self->host, (size_t)n * sizeof *self->diagonal);
  if (!self->matrix || !self->b || !self->y || !self->diagonal) return out_of_memory(self);
  self->own_data = SM_DATA_S(self->matrix);
  SM_DATA_S(self->matrix) = (double *)(uintptr_t)A->val;
  return copy_pattern(self, A);
}

/*------------------------------------- the factor -----------------------------------------------*/

/* Scaling and row exchanges would spoil the symmetry that the signs of the pivots rest on. */
static SUNLinearSolver make_solver(lu *self, int32_t kind) {
  SM_SPARSETYPE_S(self->matrix) = kind == MSIM_FACTOR_UNSYMMETRIC ? CSR_MAT : CSC_MAT;
  SUNLinearSolver solver = SUNLinSol_KLU(self->b, self->matrix, self->context);
  if (!solver) return NULL;
  sun_klu_common *common = SUNLinSol_KLUGetCommon(solver);
  SUNLinSol_KLUSetOrdering(solver, 0); /* AMD */
  common->btf = 0;
  if (kind == MSIM_FACTOR_SPD) common->tol = 0, common->scale = 0;
  return solver;
}

/* Forget pivots and order: the next setup begins with an analysis. */
static void begin_anew(lu *self, SUNLinearSolver solver) {
  SUNLinSol_KLUReInit(solver, self->matrix, SUNSparseMatrix_NNZ(self->matrix),
                      SUNKLU_REINIT_PARTIAL);
}

/* The signs of the diagonal pivots. One that cancellation has eaten down to the last bit of the
 * diagonal entry it began with has none. */
static int32_t definiteness(const lu *self, SUNLinearSolver solver) {
  const sun_klu_symbolic *symbolic = SUNLinSol_KLUGetSymbolic(solver);
  const sun_klu_numeric *numeric = SUNLinSol_KLUGetNumeric(solver);
  const double *pivot = numeric->Udiag, *value = SM_DATA_S(self->matrix);
  int32_t result = MSIM_DEFINITE_POSITIVE;
  if (SUNLinSol_KLUGetCommon(solver)->noffdiag != 0) return MSIM_DEFINITE_UNKNOWN;
  for (sunindextype k = 0; k < numeric->n; k++) {
    const double scale = numeric->Rs ? numeric->Rs[k] : 1;
    const double began = fabs(value[self->diagonal[symbolic->Q[k]]]) / scale;
    if (pivot[k] < -DBL_EPSILON * began) return MSIM_DEFINITE_NOT;
    if (!(pivot[k] > DBL_EPSILON * began)) result = MSIM_DEFINITE_UNKNOWN;
  }
  return result;
}

static msim_status status_of(lu *self, SUNLinearSolver solver, int flag) {
  const sun_klu_common *common = SUNLinSol_KLUGetCommon(solver);
  if (!flag) return MSIM_OK;
  if (common->status == KLU_SINGULAR) return MSIM_NOT_SPD;
  if (common->status == KLU_OUT_OF_MEMORY) return out_of_memory(self);
  self->host->fail(self->host, "KLU failed with its status %d, and SUNDIALS with %d",
                   (int)common->status, flag);
  return MSIM_ERR_BACKEND;
}

static msim_status set_up(lu *self, SUNLinearSolver solver, int32_t kind, msim_solve_info *info) {
  msim_status status = status_of(self, solver, SUNLinSolSetup(solver, self->matrix));
  if (status) return status;
  sun_klu_common *common = SUNLinSol_KLUGetCommon(solver);
  sun_klu_numeric *numeric = SUNLinSol_KLUGetNumeric(solver);
  if (kind != MSIM_FACTOR_UNSYMMETRIC) info->definite = definiteness(self, solver);
  info->fill = (double)numeric->lnz + (double)numeric->unz;
  if (KLU(flops)(SUNLinSol_KLUGetSymbolic(solver), numeric, common)) info->flops = common->flops;
  return kind == MSIM_FACTOR_SPD && info->definite != MSIM_DEFINITE_POSITIVE ? MSIM_NOT_SPD
                                                                             : MSIM_OK;
}

static msim_status factor(void *data, const msim_system *A, int32_t kind, msim_solve_info *info) {
  (void)A;
  lu *self = data;
  if (kind < MSIM_FACTOR_SPD || kind > MSIM_FACTOR_UNSYMMETRIC)
    return refuse(self, "there is no such kind of factor");
  SUNLinearSolver *solver = &self->solver[kind];
  const int is_old = *solver != NULL;
  if (!is_old) *solver = make_solver(self, kind);
  if (!*solver) return out_of_memory(self);
  self->current = *solver;
  /* pivots that other values chose may be bad ones, and bits must not depend on what came before */
  if (is_old && kind != MSIM_FACTOR_SPD) begin_anew(self, *solver);
  msim_status status = set_up(self, *solver, kind, info);
  /* SUNDIALS refactors whatever it has: nothing, where a full factorisation failed; and NaN may
   * have led the search for a pivot off the diagonal, where it would stay */
  if (status && (!SUNLinSol_KLUGetNumeric(*solver) ||
                 (kind == MSIM_FACTOR_SPD && SUNLinSol_KLUGetCommon(*solver)->noffdiag != 0)))
    begin_anew(self, *solver);
  return status;
}

/*------------------------------------- the rest -------------------------------------------------*/

static msim_status solve(void *data, const msim_system *A, const msim_solve_params *params,
                         int32_t nrhs, const double *b, double *y, msim_solve_info *info) {
  (void)params, (void)info;
  lu *self = data;
  const size_t n = (size_t)A->n * (size_t)A->block;
  if (nrhs < 1) return refuse(self, "there must be a right side or more");
  int flag = 0;
  for (size_t at = 0; !flag && at < n * (size_t)nrhs; at += n) {
    N_VSetArrayPointer((double *)(uintptr_t)(b + at), self->b);
    N_VSetArrayPointer(y + at, self->y);
    flag = SUNLinSolSolve(self->current, self->matrix, self->y, self->b, 0);
  }
  return status_of(self, self->current, flag);
}

static void destroy(void *data) {
  lu *self = data;
  if (!self) return;
  for (int kind = 0; kind < 3; kind++)
    if (self->solver[kind]) SUNLinSolFree(self->solver[kind]);
  if (self->own_data) SM_DATA_S(self->matrix) = self->own_data;
  if (self->matrix) SUNMatDestroy(self->matrix);
  N_VDestroy(self->b);
  N_VDestroy(self->y);
  SUNContext_Free(&self->context);
  self->host->free(self->host, self->diagonal);
  self->host->free(self->host, self);
}

MSIM_BACKEND_ENTRY(klu) {
  static const msim_backend table = {
      .abi = MSIM_BACKEND_ABI,
      .size = sizeof(msim_backend),
      .name = "klu",
      .library = "KLU " STRING(KLU_MAIN_VERSION) "." STRING(KLU_SUB_VERSION) "." STRING(
          KLU_SUBSUB_VERSION) ", SUNDIALS " SUNDIALS_VERSION,
      .license = "LGPL-2.1-or-later (KLU), BSD-3-Clause (SUNDIALS)",
      .flags = MSIM_BACKEND_SYMMETRIC | MSIM_BACKEND_UNSYMMETRIC,
      .format = MSIM_FORMAT_FULL,
      .create = create,
      .analyze = analyze,
      .factor = factor,
      .solve = solve,
      .destroy = destroy};
  return &table;
}
