#include "shared.h"

#include <math.h>
#include <string.h>

/*------------------------------------- ranks ----------------------------------------------------*/

const msim_comm *petsc_shared_ranks(const msim_system *A) {
  return A->size >= offsetof(msim_system, ghost) + sizeof A->ghost ? A->comm : NULL;
}

double petsc_shared_sum(const msim_system *A, double value) {
  const msim_comm *c = petsc_shared_ranks(A);
  return c && c->sum(c->self, 1, &value) ? NAN : value;
}

double petsc_shared_maximum(const msim_system *A, double value) {
  const msim_comm *c = petsc_shared_ranks(A);
  return c && c->maximum(c->self, 1, &value) ? NAN : value;
}

const char *petsc_shared_find_mpi(const msim_system *A, MPI_Comm *mpi) {
  const msim_comm *c = petsc_shared_ranks(A);
  if (!c) return NULL;
  const int has_handle = c->size >= offsetof(msim_comm, handle) + sizeof c->handle && c->handle;
  if (!has_handle || strcmp(c->name, "mpi") != 0)
    return "PETSc is not thread-safe and communicates by MPI: ranks must be processes of mpirun; "
           "use "
           "solver = pcg for other ranks";
  *mpi = *(const MPI_Comm *)c->handle;
  return NULL;
}

/*------------------------------------- the matrix -----------------------------------------------*/

size_t petsc_shared_numbers(const msim_system *A) {
  const int32_t n = A->block * A->n;
  int32_t longest = 0;
  if (!petsc_shared_ranks(A)) return 1;
  for (int32_t row = 0; row < n; row++)
    if (A->rowptr[row + 1] - A->rowptr[row] > longest)
      longest = A->rowptr[row + 1] - A->rowptr[row];
  return 2 * (size_t)n + (size_t)longest;
}

static PetscErrorCode create_argument(const msim_system *A, MPI_Comm mpi, Vec *vec) {
  return VecCreateMPIWithArray(mpi, A->block, A->block * A->n, PETSC_DETERMINE, NULL, vec);
}

PetscErrorCode petsc_shared_create(const msim_system *A, MPI_Comm mpi, petsc_shared *shared,
                                   Mat *matrix) {
  const PetscInt n = A->block * A->n;
  PetscInt *own = shared->row, *other = own + n;
  for (PetscInt row = 0; row < n; row++) {
    own[row] = other[row] = 0;
    for (int32_t e = A->rowptr[row]; e < A->rowptr[row + 1]; e++)
      ++*(A->colind[e] < n ? &own[row] : &other[row]);
  }
  PetscErrorCode code = MatCreate(mpi, matrix);
  if (!code) code = MatSetSizes(*matrix, n, n, PETSC_DETERMINE, PETSC_DETERMINE);
  if (!code) code = MatSetType(*matrix, MATMPIAIJ);
  if (!code) code = MatMPIAIJSetPreallocation(*matrix, 0, own, 0, other);
  if (!code) code = MatSetOption(*matrix, MAT_NO_OFF_PROC_ENTRIES, PETSC_TRUE);
  if (!code) code = create_argument(A, mpi, &shared->in);
  return code ? code : create_argument(A, mpi, &shared->out);
}

void petsc_shared_destroy(petsc_shared *shared) {
  VecDestroy(&shared->in);
  VecDestroy(&shared->out);
}

/* The number of a scalar row or column in the whole system */
static PetscInt number_of(const msim_system *A, int32_t scalar) {
  const int32_t k = scalar / A->block;
  const int64_t row = k < A->n ? A->first + k : A->ghost[k - A->n];
  return (PetscInt)(A->block * row + scalar % A->block);
}

PetscErrorCode petsc_shared_set(const msim_system *A, const petsc_shared *shared,
                                const double *value, Mat matrix) {
  PetscInt *columns = shared->row + 2 * A->block * A->n;
  PetscErrorCode code = 0;
  for (int32_t r = 0; r < A->block * A->n && !code; r++) {
    const PetscInt row = number_of(A, r), begin = A->rowptr[r], n = A->rowptr[r + 1] - begin;
    for (PetscInt e = 0; e < n; e++) columns[e] = number_of(A, A->colind[begin + e]);
    code = MatSetValues(matrix, 1, &row, n, columns, value + begin, INSERT_VALUES);
  }
  if (!code) code = MatAssemblyBegin(matrix, MAT_FINAL_ASSEMBLY);
  return code ? code : MatAssemblyEnd(matrix, MAT_FINAL_ASSEMBLY);
}

PetscErrorCode petsc_shared_multiply(const msim_system *A, const petsc_shared *shared, Mat matrix,
                                     int exponent, const double *x, double *y) {
  PetscErrorCode code = VecPlaceArray(shared->in, x);
  if (!code) code = VecPlaceArray(shared->out, y);
  if (!code) code = MatMult(matrix, shared->in, shared->out);
  if (!code) code = VecResetArray(shared->in);
  if (!code) code = VecResetArray(shared->out);
  for (int32_t i = 0; i < A->block * A->n && !code; i++) y[i] = scalbn(y[i], exponent);
  return code;
}
