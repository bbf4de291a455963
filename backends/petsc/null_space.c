#include "null_space.h"

#include <string.h>

PetscErrorCode petsc_null_space_create_vector(const msim_system *A, MPI_Comm mpi, Vec *vec) {
  PetscErrorCode code = VecCreate(mpi, vec);
  if (!code) code = VecSetSizes(*vec, A->block * A->n, PETSC_DETERMINE);
  if (!code) code = VecSetBlockSize(*vec, A->block);
  return code ? code : VecSetType(*vec, VECSTANDARD);
}

/* One vector for each component, 1 there */
static PetscErrorCode make_constants(const msim_system *A, MPI_Comm mpi, MatNullSpace *space) {
  Vec constant[3] = {NULL};
  PetscErrorCode code = 0;
  for (PetscInt c = 0; c < A->block && !code; c++) {
    double *value;
    code = petsc_null_space_create_vector(A, mpi, &constant[c]);
    if (!code) code = VecGetArray(constant[c], &value);
    for (int32_t i = 0; i < A->n && !code; i++) value[A->block * i + c] = 1;
    if (!code) code = VecRestoreArray(constant[c], &value);
    if (!code) code = VecNormalize(constant[c], NULL);
  }
  if (!code) code = MatNullSpaceCreate(mpi, PETSC_FALSE, A->block, constant, space);
  for (PetscInt c = 0; c < A->block; c++) VecDestroy(&constant[c]);
  return code;
}

PetscErrorCode petsc_null_space_create(const msim_system *A, MPI_Comm mpi, MatNullSpace *space) {
  const int has_positions =
      A->size >= offsetof(msim_system, x) + sizeof A->x && A->x && A->block > 1;
  if (!has_positions) return make_constants(A, mpi, space);
  Vec x = NULL;
  double *value;
  PetscErrorCode code = petsc_null_space_create_vector(A, mpi, &x);
  if (!code) code = VecGetArray(x, &value);
  if (!code) memcpy(value, A->x, (size_t)(A->block * A->n) * sizeof *value);
  if (!code) code = VecRestoreArray(x, &value);
  if (!code) code = MatNullSpaceCreateRigidBody(x, space);
  VecDestroy(&x);
  return code;
}
