/* petsc - solver plugin: the Krylov methods (KSP) and preconditioners (PC) of PETSc, by its own
 * options. Without options: conjugate gradients with smoothed aggregation (GAMG), or, for a few
 * unknowns, a factorization.
 *
 * -pc_type msim is the preconditioner of the host, without a matrix (matrix_free.h). Else the FULL
 * matrix of the host becomes an AIJ matrix with the block size and the near-null space of rigid
 * bodies, of which multigrid makes its coarse spaces. KSP solves for corrections A e = b - A y from
 * e = 0, in its own norm and to a tolerance of ours, until the residual is small enough in the norm
 * of the host, sqrt(r.D^-1 r); so any KSP and PC may be chosen, also -ksp_type preonly -pc_type
 * cholesky. r, and A where it is a matrix, are scaled by powers of two, to about 1, which changes
 * no digit.
 *
 * PETSc is not thread-safe and has state of its own: a stack of error handlers, a table of options,
 * a function that prints. Each call here sets them and restores them under a lock. A new KSP for
 * each matrix makes results independent of the matrices before. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <petscksp.h>

#include "diagonal.h"
#include "matrix_free.h"
#include "null_space.h"
#include "shared.h"

#if defined PETSC_USE_COMPLEX || !defined PETSC_USE_REAL_DOUBLE || defined PETSC_USE_64BIT_INDICES
#  error "the plugin petsc needs a PETSc of real double precision and 32-bit indices"
#endif

#define STRING_(x) #x
#define STRING(x)  STRING_(x)

#define DEFAULTS       "-ksp_type cg -pc_type gamg"
#define DEFAULTS_SMALL "-pc_type cholesky" /* beside these, up to MOST_SMALL unknowns */

/* Creating the objects of GAMG takes longer than to factor a system of so few unknowns. */
enum { MOST_SMALL = 60 };

typedef struct petsc_solver {
  const msim_host *host;
  PetscOptions options;
  int has_options; /* 1: of the caller */
  int are_known;   /* 1: the names of all options have been checked */
  MPI_Comm mpi;
  Mat matrix;
  petsc_shared shared; /* of ranks; else empty */
  int is_matrix_free;  /* 1: by -pc_type msim */
  petsc_matrix_free matrix_free;
  KSP ksp;
  Vec r, e;      /* residual and correction, in arrays of PETSc */
  double *value; /* of the matrix, A->val / 2^exponent */
  int exponent;
  double *inverse;   /* of the diagonal blocks of A, row by row */
  char message[400]; /* the first error of PETSc in this call */
} petsc_solver;

/*------------------------------------- PETSc's own state ----------------------------------------*/

static void finalize_petsc(void) {
  PetscBool finalized = PETSC_TRUE;
  PetscFinalized(&finalized);
  if (!finalized) PetscFinalize();
}

/* Initialize PETSc, and MPI, once in a process, unless the program has; they end with it. Neither
 * signal handlers nor files with options in the present folder. */
static int initialize_petsc(void) {
  PetscBool done = PETSC_FALSE;
  if (PetscInitialized(&done)) return 0;
  if (done) return 1;
  if (PetscOptionsSetValue(NULL, "-no_signal_handler", "1") ||
      PetscOptionsSetValue(NULL, "-skip_petscrc", "1") || PetscInitializeNoArguments())
    return 0;
  return atexit(finalize_petsc) == 0;
}

static PetscErrorCode (*program_prints)(FILE *, const char[], va_list); /* while PETSc works here */

/* Output to files that options name, and none to the terminal. */
static PetscErrorCode print_to_files(FILE *file, const char format[], va_list arguments) {
  if (file == stdout || file == stderr) return 0;
  return program_prints(file, format, arguments);
}

/* Keep the sentence of the first error; the error itself is returned through all callers. */
static PetscErrorCode keep_message(MPI_Comm comm, int line, const char *function, const char *file,
                                   PetscErrorCode code, PetscErrorType type, const char *message,
                                   void *context) {
  (void)comm, (void)line, (void)file;
  petsc_solver *self = context;
  if (type == PETSC_ERROR_INITIAL)
    snprintf(self->message, sizeof self->message, "%s (in %s)", message ? message : "no message",
             function ? function : "?");
  return code;
}

static void enter_petsc(petsc_solver *self) {
  self->host->lock(self->host);
  self->message[0] = 0;
  program_prints = PetscVFPrintf;
  PetscVFPrintf = print_to_files;
  PetscPushErrorHandler(keep_message, self);
  if (self->options) PetscOptionsPush(self->options);
}

static void leave_petsc(petsc_solver *self) {
  if (self->options) PetscOptionsPop();
  PetscPopErrorHandler();
  PetscVFPrintf = program_prints;
  self->host->unlock(self->host);
}

/* The status of an error code of PETSc, with its sentence. */
static msim_status convert_code(petsc_solver *self, PetscErrorCode code, msim_status other) {
  if (!code) return MSIM_OK;
  if (code == PETSC_ERR_MEM || code == PETSC_ERR_MEMC) return MSIM_ERR_MEMORY;
  if (code == PETSC_ERR_MAT_LU_ZRPVT || code == PETSC_ERR_MAT_CH_ZRPVT) return MSIM_NOT_SPD;
  if (code == PETSC_ERR_FP || code == PETSC_ERR_CONV_FAILED) return MSIM_NOT_CONVERGED;
  for (char *c = self->message; *c; c++)
    if (*c == '\n') *c = ' ';
  self->host->fail(self->host, "PETSc: %s", self->message[0] ? self->message : "unknown error");
  return other;
}

static msim_status petsc_refuse(petsc_solver *self, const char *why) {
  self->host->fail(self->host, "%s", why);
  return MSIM_ERR_ARG;
}

/*------------------------------------- create and options ---------------------------------------*/

static msim_status petsc_create(const msim_host *host, void **result) {
  petsc_solver *self = host->alloc(host, sizeof *self);
  *result = self;
  if (!self) return MSIM_ERR_MEMORY;
  memset(self, 0, sizeof *self);
  self->host = host;
  self->mpi = PETSC_COMM_SELF;
  host->lock(host);
  const int ready = initialize_petsc();
  host->unlock(host);
  if (!ready) {
    host->fail(host, "PETSc, or MPI behind it, cannot be initialized");
    return MSIM_ERR_BACKEND;
  }
  enter_petsc(self);
  PetscOptions options = NULL;
  PetscErrorCode code = PetscOptionsCreate(&options);
  if (!code) code = PetscOptionsInsertString(options, DEFAULTS);
  leave_petsc(self);
  self->options = options;
  return convert_code(self, code, MSIM_ERR_BACKEND);
}

static msim_status petsc_set_options(void *data, const char *text) {
  petsc_solver *self = data;
  if (text[strspn(text, " ")] != '-')
    return petsc_refuse(self, "solver.options must be options of PETSc, as -ksp_type cg");
  self->has_options = 1;
  enter_petsc(self);
  PetscErrorCode code = PetscOptionsInsertString(self->options, text);
  if (!code) code = petsc_matrix_free_take_option(self->options, &self->is_matrix_free);
  leave_petsc(self);
  return convert_code(self, code, MSIM_ERR_ARG);
}

static int32_t petsc_choose_format(void *data) {
  const petsc_solver *self = data;
  return self->is_matrix_free ? MSIM_FORMAT_NONE : MSIM_FORMAT_FULL;
}

/* Options of KSP and PC that neither has asked for: slips, or of another type. Those of levels are
 * none, as small systems have no levels. Under the lock. */
static msim_status check_options(petsc_solver *self) {
  PetscInt n = 0;
  char **names = NULL, **values = NULL;
  msim_status status = MSIM_OK;
  if (self->are_known || PetscOptionsLeftGet(self->options, &n, &names, &values)) return MSIM_OK;
  for (PetscInt i = 0; i < n && !status; i++) {
    if (strncmp(names[i], "ksp_", 4) != 0 && strncmp(names[i], "pc_", 3) != 0) continue;
    self->host->fail(self->host,
                     "PETSc has no use for -%s in solver.options with this KSP and PC; correct or "
                     "remove it",
                     names[i]);
    status = MSIM_ERR_ARG;
  }
  PetscOptionsLeftRestore(self->options, &n, &names, &values);
  self->are_known = 1;
  return status;
}

/*------------------------------------- systems --------------------------------------------------*/

static msim_status check_system(petsc_solver *self, const msim_system *A) {
  if (A->format != petsc_choose_format(self))
    return petsc_refuse(self, "A must have the format that choose_format() returns");
  if (self->is_matrix_free && !petsc_matrix_free_is_offered(A))
    return petsc_refuse(self, "-pc_type msim needs a newer msim");
  if (A->n < 1 || A->block < 1 || A->block > 3)
    return petsc_refuse(self, "A must have at least one block row, of 1 to 3 scalars");
  if (A->n >= INT32_MAX / A->block)
    return petsc_refuse(self, "A must have fewer than 2^31 - 1 rows");
  return MSIM_OK;
}

/*------------------------------------- the matrix -----------------------------------------------*/

static PetscErrorCode create_matrix(petsc_solver *self, const msim_system *A) {
  const PetscInt n = A->block * A->n;
  if (self->is_matrix_free)
    return petsc_matrix_free_create(&self->matrix_free, self->mpi, &self->matrix);
  if (petsc_shared_ranks(A)) return petsc_shared_create(A, self->mpi, &self->shared, &self->matrix);
  return MatCreateSeqAIJWithArrays(PETSC_COMM_SELF, n, n, (PetscInt *)(uintptr_t)A->rowptr,
                                   (PetscInt *)(uintptr_t)A->colind, self->value, &self->matrix);
}

static PetscErrorCode make_matrix(petsc_solver *self, const msim_system *A) {
  MatNullSpace space = NULL;
  PetscErrorCode code = create_matrix(self, A);
  if (!code) code = petsc_null_space_create_vector(A, self->mpi, &self->r);
  if (!code) code = VecDuplicate(self->r, &self->e);
  if (!code) code = MatSetOption(self->matrix, MAT_SYMMETRIC, PETSC_TRUE);
  if (!code) code = MatSetOption(self->matrix, MAT_SYMMETRY_ETERNAL, PETSC_TRUE);
  if (code || self->is_matrix_free) return code;
  code = MatSetBlockSize(self->matrix, A->block);
  if (!code) code = petsc_null_space_create(A, self->mpi, &space);
  if (!code) code = MatSetNearNullSpace(self->matrix, space);
  MatNullSpaceDestroy(&space);
  return code;
}

static int allocate_arrays(petsc_solver *self, const msim_system *A) {
  const msim_host *host = self->host;
  if (self->is_matrix_free) return petsc_matrix_free_allocate(&self->matrix_free, host, A);
  const size_t n = (size_t)A->n * (size_t)A->block, numbers = petsc_shared_numbers(A);
  self->inverse = host->alloc(host, n * (size_t)A->block * sizeof *self->inverse);
  self->value = host->alloc(host, (size_t)A->rowptr[n] * sizeof *self->value);
  self->shared.row = host->alloc(host, numbers * sizeof *self->shared.row);
  return self->inverse && self->value && self->shared.row;
}

static msim_status petsc_analyze(void *data, const msim_system *A, msim_solve_info *info) {
  (void)info;
  petsc_solver *self = data;
  msim_status status = check_system(self, A);
  if (status) return status;
  const char *wrong = petsc_shared_find_mpi(A, &self->mpi);
  if (wrong) return petsc_refuse(self, wrong);
  const double unknowns = petsc_shared_sum(A, A->n * A->block);
  if (!(petsc_shared_maximum(A, !allocate_arrays(self, A)) <= 0)) return MSIM_ERR_MEMORY;
  if (!(unknowns < INT32_MAX))
    return petsc_refuse(self, "all ranks together must have fewer than 2^31 - 1 rows");
  const int is_small = !self->has_options && unknowns <= MOST_SMALL && !petsc_shared_ranks(A);
  enter_petsc(self);
  PetscErrorCode code = is_small ? PetscOptionsInsertString(self->options, DEFAULTS_SMALL) : 0;
  if (!code) code = make_matrix(self, A);
  leave_petsc(self);
  return convert_code(self, code, MSIM_ERR_BACKEND);
}

/*------------------------------------- the norm of the host -------------------------------------*/

/* sqrt(r.D^-1 r), over all ranks */
static double norm_of(const petsc_solver *self, const msim_system *A, const double *r) {
  const double own = self->is_matrix_free ? petsc_matrix_free_product(&self->matrix_free, r)
                                          : petsc_diagonal_product(A, self->inverse, r);
  const double sum = petsc_shared_sum(A, own);
  return sqrt(sum < 0 ? 0 : sum); /* NaN stays */
}

/* y = A x in one process */
static void multiply_own(const msim_system *A, const double *x, double *y) {
  for (int32_t row = 0; row < A->block * A->n; row++) {
    y[row] = 0;
    for (int32_t e = A->rowptr[row]; e < A->rowptr[row + 1]; e++)
      y[row] += A->val[e] * x[A->colind[e]];
  }
}

/* y = A x; return x.A x, over all ranks. NaN: PETSc has failed. */
static double multiply(petsc_solver *self, const msim_system *A, const double *x, double *y) {
  double curvature = 0;
  if (self->is_matrix_free) petsc_matrix_free_apply(&self->matrix_free, x, y);
  else if (!petsc_shared_ranks(A)) multiply_own(A, x, y);
  else if (petsc_shared_multiply(A, &self->shared, self->matrix, self->exponent, x, y))
    curvature = NAN;
  for (int32_t row = 0; row < A->block * A->n; row++) curvature += x[row] * y[row];
  return petsc_shared_sum(A, curvature);
}

/*------------------------------------- factor ---------------------------------------------------*/

/* value = A / 2^exponent, the largest of all ranks is about 1; 0: they are not finite. */
static int copy_values(petsc_solver *self, const msim_system *A) {
  if (self->is_matrix_free) return 1;
  const int32_t n = A->rowptr[A->block * A->n];
  double most = 0;
  for (int32_t e = 0; e < n && isfinite(most); e++)
    most = isfinite(A->val[e]) ? fmax(most, fabs(A->val[e])) : INFINITY;
  most = petsc_shared_maximum(A, most);
  if (!isfinite(most)) return 0;
  self->exponent = most > 0 ? ilogb(most) : 0;
  for (int32_t e = 0; e < n; e++) self->value[e] = scalbn(A->val[e], -self->exponent);
  return 1;
}

/* The values in our array are new: PETSc drops what it has derived from the former ones. */
static PetscErrorCode announce_values(petsc_solver *self) {
  double *values;
  const PetscErrorCode code = MatSeqAIJGetArray(self->matrix, &values);
  return code ? code : MatSeqAIJRestoreArray(self->matrix, &values);
}

/* Copy the values to PETSc's matrix. */
static PetscErrorCode set_matrix(petsc_solver *self, const msim_system *A) {
  if (self->is_matrix_free) return 0;
  return petsc_shared_ranks(A) ? petsc_shared_set(A, &self->shared, self->value, self->matrix)
                               : announce_values(self);
}

static PetscErrorCode make_solver(petsc_solver *self, const msim_system *A) {
  PetscErrorCode code = set_matrix(self, A);
  if (!code) code = KSPDestroy(&self->ksp);
  if (!code) code = KSPCreate(self->mpi, &self->ksp);
  if (!code) code = KSPSetOperators(self->ksp, self->matrix, self->matrix);
  if (!code) code = KSPSetFromOptions(self->ksp);
  if (!code && self->is_matrix_free)
    code = petsc_matrix_free_set_preconditioner(&self->matrix_free, self->ksp);
  if (!code) code = KSPSetInitialGuessNonzero(self->ksp, PETSC_FALSE);
  if (!code) code = KSPSetErrorIfNotConverged(self->ksp, PETSC_FALSE);
  return code ? code : KSPSetUp(self->ksp);
}

static msim_status petsc_factor(void *data, const msim_system *A, int32_t kind,
                                msim_solve_info *info) {
  petsc_solver *self = data;
  if (kind != MSIM_FACTOR_SPD)
    return petsc_refuse(self, "petsc supports symmetric positive definite systems only");
  if (!copy_values(self, A)) return petsc_refuse(self, "A has entries that are not finite");
  const int has_blocks = self->is_matrix_free || petsc_diagonal_invert(A, self->inverse);
  if (!(petsc_shared_maximum(A, !has_blocks) <= 0)) {
    info->definite = MSIM_DEFINITE_NOT;
    return MSIM_NOT_SPD;
  }
  enter_petsc(self);
  const PetscErrorCode code = make_solver(self, A);
  leave_petsc(self);
  return convert_code(self, code, MSIM_ERR_BACKEND);
}

/*------------------------------------- solve ----------------------------------------------------*/

/* r = b - A y; return its norm. e is overwritten. */
static double compute_residual(petsc_solver *self, const msim_system *A, const double *b,
                               const double *y, double *r) {
  if (isnan(multiply(self, A, y, r))) return NAN;
  for (int32_t i = 0; i < A->block * A->n; i++) r[i] = b[i] - r[i];
  return norm_of(self, A, r);
}

/* x *= 2^exponent */
static PetscErrorCode scale_vector(Vec x, int32_t n, int exponent) {
  double *value;
  PetscErrorCode code = VecGetArray(x, &value);
  if (code) return code;
  for (int32_t i = 0; i < n; i++) value[i] = scalbn(value[i], exponent);
  return VecRestoreArray(x, &value);
}

/* One call of KSP: e = an approximation of A^-1 r, to the relative
 * residual rtol or up to *limit iterations, which is set to the number made. Overwrites r. */
static PetscErrorCode compute_correction(petsc_solver *self, int32_t n, double rtol,
                                         PetscInt *limit, KSPConvergedReason *reason) {
  double most;
  PetscErrorCode code = VecNorm(self->r, NORM_INFINITY, &most);
  const int exponent = !code && most > 0 ? ilogb(most) : 0;
  if (!code) code = scale_vector(self->r, n, -exponent);
  if (!code) code = KSPSetTolerances(self->ksp, rtol, DBL_MIN, DBL_MAX, *limit);
  if (!code) code = KSPSolve(self->ksp, self->r, self->e);
  if (!code) code = KSPGetConvergedReason(self->ksp, reason);
  if (!code) code = KSPGetIterationNumber(self->ksp, limit);
  return code ? code : scale_vector(self->e, n, exponent - self->exponent);
}

/* Add corrections as long as they reduce the residual; y is the best solution so far. */
static msim_status solve_right_hand_side(petsc_solver *self, const msim_system *A,
                                         const msim_solve_params *params, const double *b,
                                         double *y, msim_solve_info *info) {
  const int32_t n = A->block * A->n;
  const double size = norm_of(self, A, b), goal = fmax(params->rtol, DBL_EPSILON / 4) * size;
  double *r, *e;
  if (VecGetArray(self->r, &r)) return MSIM_ERR_BACKEND;
  if (size == 0) memset(y, 0, (size_t)n * sizeof *y);
  double left = compute_residual(self, A, b, y, r);
  PetscErrorCode code = VecRestoreArray(self->r, &r);
  int32_t count = 0;
  int gains = 1, indefinite = 0;
  while (!code && gains && left > goal && isfinite(left) && count < params->max_iterations) {
    PetscInt used = params->max_iterations - count;
    KSPConvergedReason reason;
    code = compute_correction(self, n, fmax(fmin(0.5 * goal / left, 0.1), 1e-14), &used, &reason);
    if (code) break;
    count += used > 0 ? used : 1;
    if (VecGetArray(self->e, &e) || VecGetArray(self->r, &r)) return MSIM_ERR_BACKEND;
    indefinite = reason == KSP_DIVERGED_INDEFINITE_MAT || multiply(self, A, e, r) < 0;
    for (int32_t i = 0; i < n; i++) e[i] += y[i];
    const double now = compute_residual(self, A, b, e, r);
    gains = now < 0.9 * left && !indefinite;
    if (now < left) memcpy(y, e, (size_t)n * sizeof *y), left = now;
    else compute_residual(self, A, b, y, r);
    VecRestoreArray(self->r, &r);
    code = VecRestoreArray(self->e, &e);
    if (indefinite) break;
  }
  info->iterations += count;
  info->residual = fmax(info->residual, size > 0 ? left / size : 0);
  if (code) return convert_code(self, code, MSIM_ERR_BACKEND);
  if (indefinite) info->definite = MSIM_DEFINITE_NOT;
  if (indefinite) return MSIM_NOT_SPD;
  return left <= goal && isfinite(goal) ? MSIM_OK : MSIM_NOT_CONVERGED;
}

/* Vectors as the host has them */
static msim_status solve_vector(petsc_solver *self, const msim_system *A,
                                const msim_solve_params *params, const double *b, double *y,
                                msim_solve_info *info) {
  petsc_matrix_free *m = &self->matrix_free;
  if (!self->is_matrix_free) return solve_right_hand_side(self, A, params, b, y, info);
  petsc_matrix_free_pack(A, b, m->b);
  petsc_matrix_free_pack(A, y, m->y);
  const msim_status status = solve_right_hand_side(self, A, params, m->b, m->y, info);
  petsc_matrix_free_unpack(A, m->y, y);
  return status;
}

static msim_status petsc_solve(void *data, const msim_system *A, const msim_solve_params *params,
                               int32_t nrhs, const double *b, double *y, msim_solve_info *info) {
  petsc_solver *self = data;
  const size_t n = (size_t)(self->is_matrix_free ? A->stride : A->n) * (size_t)A->block;
  if (nrhs < 1) return petsc_refuse(self, "nrhs must be at least 1");
  msim_status worst = MSIM_OK;
  enter_petsc(self);
  for (int32_t k = 0; k < nrhs && worst >= 0 && worst != MSIM_NOT_SPD; k++) {
    const size_t at = n * (size_t)k;
    const msim_status status = solve_vector(self, A, params, b + at, y + at, info);
    if (status) worst = status;
  }
  const msim_status misspelt = worst >= 0 ? check_options(self) : MSIM_OK;
  leave_petsc(self);
  return misspelt ? misspelt : worst;
}

static void petsc_destroy(void *data) {
  petsc_solver *self = data;
  if (!self) return;
  if (self->options) {
    enter_petsc(self);
    KSPDestroy(&self->ksp);
    VecDestroy(&self->r);
    VecDestroy(&self->e);
    petsc_shared_destroy(&self->shared);
    MatDestroy(&self->matrix);
    PetscOptions options = self->options;
    PetscOptionsPop();
    self->options = NULL;
    PetscOptionsDestroy(&options);
    leave_petsc(self);
  }
  self->host->free(self->host, self->value);
  self->host->free(self->host, self->inverse);
  self->host->free(self->host, self->shared.row);
  self->host->free(self->host, self->matrix_free.b);
  self->host->free(self->host, self);
}

MSIM_BACKEND_ENTRY(petsc) {
  static const msim_backend table = {
      .abi = MSIM_BACKEND_ABI,
      .size = sizeof(msim_backend),
      .name = "petsc",
      .library = "PETSc " STRING(PETSC_VERSION_MAJOR) "." STRING(PETSC_VERSION_MINOR) "." STRING(
          PETSC_VERSION_SUBMINOR),
      .license = "BSD-2-Clause",
      .flags = MSIM_BACKEND_ITERATIVE | MSIM_BACKEND_RANKS | MSIM_BACKEND_TWO_LEVEL,
      .format = MSIM_FORMAT_FULL,
      .create = petsc_create,
      .analyze = petsc_analyze,
      .factor = petsc_factor,
      .solve = petsc_solve,
      .destroy = petsc_destroy,
      .set_options = petsc_set_options,
      .choose_format = petsc_choose_format};
  return &table;
}
