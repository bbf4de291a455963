/* elimination - Gaussian elimination for few unknowns, where the matrix has the non-symmetric
 * damping derivative (physics/damping_derivative.h)
 *
 * With strong dampers BiCGStab takes several times as many iterations as there are unknowns, due to
 * rounding errors in its directions: 150 with 24 unknowns. Up to some hundred unknowns elimination
 * costs less, requires no preconditioner, and cannot stagnate. */
#ifndef MS_ELIMINATION_H
#define MS_ELIMINATION_H

#include "linear/linear.h"

enum { MS_ELIMINATION_MAX_UNKNOWNS = 128 }; /* scalar unknowns */

typedef struct ms_elimination {
  ms_sparse_matrix matrix; /* sparse */
  double *a;               /* dense, by rows, with b as last column; NULL: not created */
  double *packed;          /* b, then y, in the order of the matrix */
} ms_elimination;

/* With more than MS_ELIMINATION_MAX_UNKNOWNS unknowns, or several ranks, e->a stays NULL. */
msim_status ms_elimination_create(const ms_model *model, ms_elimination *e, msim_error *err);
void ms_elimination_destroy(const ms_model *model, ms_elimination *e);

/* A y = b. MSIM_NOT_CONVERGED: A is singular. */
msim_status ms_elimination_solve(ms_elimination *e, const ms_linear_system *system, const double *b,
                                 double *y);

#endif
