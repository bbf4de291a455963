/* shared - systems that several ranks share, as matrices that PETSc distributes on the communicator
 * of the plugin mpi; PETSc itself sums over ranks by MPI_Allreduce */
#ifndef PETSC_SHARED_H
#define PETSC_SHARED_H

#include <petscmat.h>

#include "msim/backend.h"
#include "msim/comm.h"

typedef struct petsc_shared {
  Vec in, out;   /* arguments of multiply(), in its arrays */
  PetscInt *row; /* petsc_shared_numbers(), owned by the caller: numbers of columns of each row, of
                    this rank and of others; columns of a row */
} petsc_shared;

/* The ranks that share the system; NULL: one process */
const msim_comm *petsc_shared_ranks(const msim_system *A);

/* The sum or the maximum over all ranks; NaN if they cannot communicate. */
double petsc_shared_sum(const msim_system *A, double value);
double petsc_shared_maximum(const msim_system *A, double value);

/* The MPI_Comm of the ranks, unchanged in one process. Returns a sentence if there is none. */
const char *petsc_shared_find_mpi(const msim_system *A, MPI_Comm *mpi);

/* The length of `row`, 1 in one process */
size_t petsc_shared_numbers(const msim_system *A);

PetscErrorCode petsc_shared_create(const msim_system *A, MPI_Comm mpi, petsc_shared *shared,
                                   Mat *matrix);
void petsc_shared_destroy(petsc_shared *shared);

/* value: of the scalars of own rows, as A->val */
PetscErrorCode petsc_shared_set(const msim_system *A, const petsc_shared *shared,
                                const double *value, Mat matrix);

/* y = 2^exponent matrix x */
PetscErrorCode petsc_shared_multiply(const msim_system *A, const petsc_shared *shared, Mat matrix,
                                     int exponent, const double *x, double *y);

#endif
