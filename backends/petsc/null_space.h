/* null_space - the near-null space of a system, of which multigrid makes its coarse spaces */
#ifndef PETSC_NULL_SPACE_H
#define PETSC_NULL_SPACE_H

#include <petscmat.h>

#include "msim/backend.h"

/* A vector of the system */
PetscErrorCode petsc_null_space_create_vector(const msim_system *A, MPI_Comm mpi, Vec *vec);

/* The modes that stretch no spring: translations and rotations where positions are known, else one
 * constant vector for each component. */
PetscErrorCode petsc_null_space_create(const msim_system *A, MPI_Comm mpi, MatNullSpace *space);

#endif
