/* matrix_free - systems of which there is no matrix, by -pc_type msim: products and the
 * preconditioner, of two levels, are those of the host. Vectors of PETSc have one component after
 * the other, as those of the host have, but without padding. */
#ifndef PETSC_MATRIX_FREE_H
#define PETSC_MATRIX_FREE_H

#include <petscksp.h>

#include "msim/backend.h"

typedef struct petsc_matrix_free {
  const msim_system *A;
  double *b, *y;    /* without padding; b: owned by the caller, with all that follows */
  double *in, *out; /* with padding */
} petsc_matrix_free;

/* is_set = 1 if the options have -pc_type msim, which becomes PETSc's shell. */
PetscErrorCode petsc_matrix_free_take_option(PetscOptions options, int *is_set);

/* 1: the host has such a preconditioner. */
static inline int petsc_matrix_free_is_offered(const msim_system *A) {
  return A->size >= offsetof(msim_system, two_level) + sizeof A->two_level && A->two_level;
}

/* 0: there is no memory. */
int petsc_matrix_free_allocate(petsc_matrix_free *m, const msim_host *host, const msim_system *A);

PetscErrorCode petsc_matrix_free_create(petsc_matrix_free *m, MPI_Comm mpi, Mat *matrix);
PetscErrorCode petsc_matrix_free_set_preconditioner(petsc_matrix_free *m, KSP ksp);

void petsc_matrix_free_pack(const msim_system *A, const double *padded, double *packed);
void petsc_matrix_free_unpack(const msim_system *A, const double *packed, double *padded);

/* y = A x; collective. */
void petsc_matrix_free_apply(const petsc_matrix_free *m, const double *x, double *y);

/* r.D^-1 r, of the rows of this rank */
double petsc_matrix_free_product(const petsc_matrix_free *m, const double *r);

#endif
