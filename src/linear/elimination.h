/* elimination - Gauss's, of the matrix with all its parts, where there are few unknowns
 *
 * With strong dampers BiCGStab takes several times as many iterations as there are unknowns, as
 * rounding errors spoil its directions: 150 with 24 unknowns. Up to some hundred of them a dense
 * matrix costs less, needs no preconditioner, and cannot stagnate. */
#ifndef MS_ELIMINATION_H
#define MS_ELIMINATION_H

#include "linear/linear.h"

enum { MS_MOST_ELIMINATED = 128 }; /* unknowns */

typedef struct ms_elimination {
  ms_matrix matrix; /* sparse */
  double *a;        /* dense, by rows, b as last column; NULL: there is no solver */
  double *packed;   /* b, then y, in the matrix' order */
} ms_elimination;

/* With more unknowns a stays NULL. */
msim_status ms_elimination_create(const ms_model *model, ms_elimination *e, msim_error *err);
void ms_elimination_destroy(const ms_model *model, ms_elimination *e);

/* A y = b; MSIM_NOT_CONVERGED: A is singular. */
msim_status ms_elimination_solve(ms_elimination *e, const ms_system *system, const double *b,
                                 double *y);

#endif
