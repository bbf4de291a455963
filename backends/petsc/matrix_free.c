#include "matrix_free.h"

#include <string.h>

PetscErrorCode petsc_matrix_free_take_option(PetscOptions options, int *is_set) {
  char type[16];
  PetscBool found;
  const PetscErrorCode code =
      PetscOptionsGetString(options, NULL, "-pc_type", type, sizeof type, &found);
  *is_set = !code && found && strcmp(type, "msim") == 0;
  return *is_set ? PetscOptionsSetValue(options, "-pc_type", PCSHELL) : code;
}

static size_t unknowns(const msim_system *A) { return (size_t)A->block * (size_t)A->n; }

int petsc_matrix_free_allocate(petsc_matrix_free *m, const msim_host *host, const msim_system *A) {
  const size_t n = unknowns(A), padded = (size_t)A->block * (size_t)A->stride;
  m->A = A;
  m->b = host->alloc(host, 2 * (n + padded) * sizeof *m->b);
  if (!m->b) return 0;
  m->y = m->b + n, m->in = m->y + n, m->out = m->in + padded;
  return 1;
}

/*------------------------------------- vectors --------------------------------------------------*/

void petsc_matrix_free_pack(const msim_system *A, const double *padded, double *packed) {
  const size_t n = (size_t)A->n, stride = (size_t)A->stride;
  for (size_t c = 0; c < (size_t)A->block; c++)
    memcpy(packed + c * n, padded + c * stride, n * sizeof *packed);
}

void petsc_matrix_free_unpack(const msim_system *A, const double *packed, double *padded) {
  const size_t n = (size_t)A->n, stride = (size_t)A->stride;
  for (size_t c = 0; c < (size_t)A->block; c++) {
    memcpy(padded + c * stride, packed + c * n, n * sizeof *padded);
    memset(padded + c * stride + n, 0, (stride - n) * sizeof *padded);
  }
}

void petsc_matrix_free_apply(const petsc_matrix_free *m, const double *x, double *y) {
  petsc_matrix_free_unpack(m->A, x, m->in);
  m->A->apply(m->A, m->in, m->out);
  petsc_matrix_free_pack(m->A, m->out, y);
}

double petsc_matrix_free_product(const petsc_matrix_free *m, const double *r) {
  double sum = 0;
  petsc_matrix_free_unpack(m->A, r, m->in);
  m->A->precondition(m->A, m->in, m->out);
  for (int32_t i = 0; i < m->A->block * m->A->stride; i++) sum += m->in[i] * m->out[i];
  return sum;
}

/*------------------------------------- objects of PETSc -----------------------------------------*/

/* y = f(x), in the arrays of PETSc's vectors */
static PetscErrorCode call_host(const petsc_matrix_free *m, int is_product, Vec from, Vec to) {
  const msim_system *A = m->A;
  const double *x;
  double *y;
  PetscErrorCode code = VecGetArrayRead(from, &x);
  if (code) return code;
  petsc_matrix_free_unpack(A, x, m->in);
  (is_product ? A->apply : A->two_level)(A, m->in, m->out);
  code = VecRestoreArrayRead(from, &x);
  if (!code) code = VecGetArrayWrite(to, &y);
  if (code) return code;
  petsc_matrix_free_pack(A, m->out, y);
  return VecRestoreArrayWrite(to, &y);
}

static PetscErrorCode multiply_shell(Mat matrix, Vec x, Vec y) {
  petsc_matrix_free *m;
  const PetscErrorCode code = MatShellGetContext(matrix, &m);
  return code ? code : call_host(m, 1, x, y);
}

static PetscErrorCode precondition_shell(PC pc, Vec r, Vec z) {
  petsc_matrix_free *m;
  const PetscErrorCode code = PCShellGetContext(pc, &m);
  return code ? code : call_host(m, 0, r, z);
}

PetscErrorCode petsc_matrix_free_create(petsc_matrix_free *m, MPI_Comm mpi, Mat *matrix) {
  const PetscInt n = (PetscInt)unknowns(m->A);
  PetscErrorCode code = MatCreateShell(mpi, n, n, PETSC_DETERMINE, PETSC_DETERMINE, m, matrix);
  if (!code) code = MatShellSetOperation(*matrix, MATOP_MULT, (void (*)(void))multiply_shell);
  return code ? code
              : MatShellSetOperation(*matrix, MATOP_MULT_TRANSPOSE, (void (*)(void))multiply_shell);
}

PetscErrorCode petsc_matrix_free_set_preconditioner(petsc_matrix_free *m, KSP ksp) {
  PC pc;
  PetscErrorCode code = KSPGetPC(ksp, &pc);
  if (!code) code = PCShellSetName(pc, "msim");
  if (!code) code = PCShellSetContext(pc, m);
  if (!code) code = PCShellSetApply(pc, precondition_shell);
  return code ? code : PCShellSetApplyTranspose(pc, precondition_shell);
}
