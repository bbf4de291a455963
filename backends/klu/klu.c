/* klu - solver plugin: sparse LU factorization by KLU, through SUNLinSol_KLU of SUNDIALS.
 *
 * The host's FULL matrix is stored by rows and KLU needs columns: a symmetric matrix is the same by
 * columns; for others SUNDIALS solves the transposed system. The pattern is converted once to the
 * index type of SUNDIALS, the values are not copied.
 *
 * Positive definite systems are factored with diagonal pivots, P A P' = L U. The diagonal of U is D
 * in L D L', so its signs are those of the eigenvalues of A (Sylvester's law of inertia). SUNDIALS
 * analyzes and factors at first, and afterwards refactors with the same pivots, unless the
 * estimated condition number exceeds eps^(-2/3). Other systems are factored with partial pivoting,
 * in a solver of their own, with new pivots each time. */
#include <float.h>
#include <math.h>
#include <string.h>

#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_klu.h>
#include <sunmatrix/sunmatrix_sparse.h>

#include "msim/backend.h"

#define STRING_(x) #x
#define STRING(x)  STRING_(x)

/* KLU exists for two index types; SUNDIALS names most functions, but not these. */
#ifdef SUNDIALS_INT64_T
#  define KLU(function) klu_l_##function
#else
#  define KLU(function) klu_##function
#endif

typedef struct lu_solver {
  const msim_host *host;
  SUNContext context;
  SUNMatrix matrix;
  double *own_data;                   /* the array of values that SUNDIALS allocated, to be freed */
  int32_t *diagonal;                  /* index of each row's diagonal entry among the values */
  N_Vector b, y;                      /* wrappers for arrays of the host */
  SUNLinearSolver solver[3], current; /* one per kind, created at first use */
} lu_solver;

static msim_status lu_refuse(lu_solver *self, const char *why) {
  self->host->fail(self->host, "%s", why);
  return MSIM_ERR_ARG;
}

static msim_status lu_out_of_memory(lu_solver *self) {
  self->host->fail(self->host, "KLU ran out of memory");
  return MSIM_ERR_MEMORY;
}

/*------------------------------------- the matrix -----------------------------------------------*/

static msim_status lu_create(const msim_host *host, void **result) {
  lu_solver *self = host->alloc(host, sizeof *self);
  *result = self;
  if (!self) return MSIM_ERR_MEMORY;
  memset(self, 0, sizeof *self);
  self->host = host;
#if SUNDIALS_VERSION_MAJOR >= 7
  if (SUNContext_Create(SUN_COMM_NULL, &self->context)) return lu_out_of_memory(self);
  SUNContext_ClearErrHandlers(self->context); /* they print */
#else
  if (SUNContext_Create(NULL, &self->context)) return lu_out_of_memory(self);
#endif
  return MSIM_OK;
}

static msim_status lu_check_system(lu_solver *self, const msim_system *A) {
  if (A->format != MSIM_FORMAT_FULL) return lu_refuse(self, "A must have MSIM_FORMAT_FULL");
  if (A->n < 1 || A->block < 1 || A->block > 3)
    return lu_refuse(self, "A must have at least one block row, of 1 to 3 scalars");
  if (A->n >= INT32_MAX / A->block) return lu_refuse(self, "A must have fewer than 2^31 - 1 rows");
  return MSIM_OK;
}

/* Copy the pattern in SUNDIALS' index type, and find the diagonal entries. */
static msim_status copy_pattern(lu_solver *self, const msim_system *A) {
  const int32_t n = A->n * A->block;
  sunindextype *start = SM_INDEXPTRS_S(self->matrix), *row = SM_INDEXVALS_S(self->matrix);
  for (int32_t i = 0; i <= n; i++) start[i] = A->rowptr[i];
  for (int32_t e = 0; e < A->rowptr[n]; e++) row[e] = A->colind[e];
  for (int32_t i = 0; i < n; i++) {
    int32_t e = A->rowptr[i];
    while (e < A->rowptr[i + 1] && A->colind[e] < i) e++;
    if (e == A->rowptr[i + 1] || A->colind[e] != i)
      return lu_refuse(self, "A must have all of its diagonal entries");
    self->diagonal[i] = e;
  }
  return MSIM_OK;
}

static msim_status lu_analyze(void *data, const msim_system *A, msim_solve_info *info) {
  (void)info;
  lu_solver *self = data;
  msim_status status = lu_check_system(self, A);
  if (status) return status;
  const int32_t n = A->n * A->block;
  self->matrix = SUNSparseMatrix(n, n, A->rowptr[n], CSC_MAT, self->context);
  self->b = N_VNewEmpty_Serial(n, self->context);
  self->y = N_VNewEmpty_Serial(n, self->context);
  self->diagonal = self->host->alloc(self->host, (size_t)n * sizeof *self->diagonal);
  if (!self->matrix || !self->b || !self->y || !self->diagonal) return lu_out_of_memory(self);
  self->own_data = SM_DATA_S(self->matrix);
  SM_DATA_S(self->matrix) = (double *)(uintptr_t)A->val;
  return copy_pattern(self, A);
}

/*------------------------------------- the factor -----------------------------------------------*/

/* Scaling and row exchanges would destroy the symmetry on which the signs of the pivots depend. */
static SUNLinearSolver make_solver(lu_solver *self, int32_t kind) {
  SM_SPARSETYPE_S(self->matrix) = kind == MSIM_FACTOR_UNSYMMETRIC ? CSR_MAT : CSC_MAT;
  SUNLinearSolver solver = SUNLinSol_KLU(self->b, self->matrix, self->context);
  if (!solver) return NULL;
  sun_klu_common *common = SUNLinSol_KLUGetCommon(solver);
  SUNLinSol_KLUSetOrdering(solver, 0); /* AMD */
  common->btf = 0;
  if (kind == MSIM_FACTOR_SPD) common->tol = 0, common->scale = 0;
  return solver;
}

/* Discard pivots and order: the next setup begins with an analysis. */
static void reset_pivoting(lu_solver *self, SUNLinearSolver solver) {
  SUNLinSol_KLUReInit(solver, self->matrix, SUNSparseMatrix_NNZ(self->matrix),
                      SUNKLU_REINIT_PARTIAL);
}

/* Definiteness by the signs of the diagonal pivots. A pivot smaller than eps times its initial
 * diagonal entry is the result of cancellation, so its sign is unknown. */
static int32_t lu_definiteness(const lu_solver *self, SUNLinearSolver solver) {
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

static msim_status lu_status(lu_solver *self, SUNLinearSolver solver, int flag) {
  const sun_klu_common *common = SUNLinSol_KLUGetCommon(solver);
  if (!flag) return MSIM_OK;
  if (common->status == KLU_SINGULAR) return MSIM_NOT_SPD;
  if (common->status == KLU_OUT_OF_MEMORY) return lu_out_of_memory(self);
  self->host->fail(self->host, "KLU failed with status %d, SUNDIALS with status %d",
                   (int)common->status, flag);
  return MSIM_ERR_BACKEND;
}

static msim_status lu_set_up(lu_solver *self, SUNLinearSolver solver, int32_t kind,
                             msim_solve_info *info) {
  msim_status status = lu_status(self, solver, SUNLinSolSetup(solver, self->matrix));
  if (status) return status;
  sun_klu_common *common = SUNLinSol_KLUGetCommon(solver);
  sun_klu_numeric *numeric = SUNLinSol_KLUGetNumeric(solver);
  if (kind != MSIM_FACTOR_UNSYMMETRIC) info->definite = lu_definiteness(self, solver);
  info->fill = (double)numeric->lnz + (double)numeric->unz;
  if (KLU(flops)(SUNLinSol_KLUGetSymbolic(solver), numeric, common)) info->flops = common->flops;
  return kind == MSIM_FACTOR_SPD && info->definite != MSIM_DEFINITE_POSITIVE ? MSIM_NOT_SPD
                                                                             : MSIM_OK;
}

static msim_status lu_factor(void *data, const msim_system *A, int32_t kind,
                             msim_solve_info *info) {
  (void)A;
  lu_solver *self = data;
  if (kind < MSIM_FACTOR_SPD || kind > MSIM_FACTOR_UNSYMMETRIC)
    return lu_refuse(self, "unknown kind of factorization");
  SUNLinearSolver *solver = &self->solver[kind];
  const int is_old = *solver != NULL;
  if (!is_old) *solver = make_solver(self, kind);
  if (!*solver) return lu_out_of_memory(self);
  self->current = *solver;
  /* pivots of earlier values may be unstable, and results must not depend on them */
  if (is_old && kind != MSIM_FACTOR_SPD) reset_pivoting(self, *solver);
  msim_status status = lu_set_up(self, *solver, kind, info);
  /* SUNDIALS would refactor even if the full factorization failed and there is no factor; and after
   * NaN, a pivot may be off the diagonal, where refactorization would keep it */
  if (status && (!SUNLinSol_KLUGetNumeric(*solver) ||
                 (kind == MSIM_FACTOR_SPD && SUNLinSol_KLUGetCommon(*solver)->noffdiag != 0)))
    reset_pivoting(self, *solver);
  return status;
}

/*------------------------------------- solve and destroy ----------------------------------------*/

static msim_status lu_solve(void *data, const msim_system *A, const msim_solve_params *params,
                            int32_t nrhs, const double *b, double *y, msim_solve_info *info) {
  (void)params, (void)info;
  lu_solver *self = data;
  const size_t n = (size_t)A->n * (size_t)A->block;
  if (nrhs < 1) return lu_refuse(self, "nrhs must be at least 1");
  int flag = 0;
  for (size_t at = 0; !flag && at < n * (size_t)nrhs; at += n) {
    N_VSetArrayPointer((double *)(uintptr_t)(b + at), self->b);
    N_VSetArrayPointer(y + at, self->y);
    flag = SUNLinSolSolve(self->current, self->matrix, self->y, self->b, 0);
  }
  return lu_status(self, self->current, flag);
}

static void lu_destroy(void *data) {
  lu_solver *self = data;
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
      .create = lu_create,
      .analyze = lu_analyze,
      .factor = lu_factor,
      .solve = lu_solve,
      .destroy = lu_destroy};
  return &table;
}
