/* bicgstab - BiCGStab(2) for the matrix with all its parts, preconditioned by the symmetric one
 *
 * What dampers add as they turn has no symmetry (physics/turning.h). The preconditioner P of the
 * symmetric part stands on the right, and all is done in the coordinates L^-1 r, D = L L^T the
 * diagonal blocks: what the method makes small, and stops on, is the norm in which answers are
 * judged (Sleijpen and Fokkema, ETNA 1 (1993) 11). It takes no more memory than ten vectors; GMRES
 * that restarts after 20 stagnates where the symmetric part alone takes some 100 iterations. */
#ifndef MS_BICGSTAB_H
#define MS_BICGSTAB_H

#include "linear/linear.h"

enum { MS_BICGSTAB_DEGREE = 2 }; /* of the polynomial of a minimal residual */

typedef struct ms_bicgstab {
  double *r[MS_BICGSTAB_DEGREE + 1], *u[MS_BICGSTAB_DEGREE + 1];
  double *shadow, *x, *z, *w; /* of r at the start; what is added up; work vectors */
  double *roots;              /* of the diagonal blocks; NULL: there is no solver */
} ms_bicgstab;

msim_status ms_bicgstab_create(const ms_model *model, ms_bicgstab *solver, msim_error *err);
void ms_bicgstab_destroy(const ms_model *model, ms_bicgstab *solver);

/* A y = b, A with its turning; y: 0 in, solution out. by: has been made ready for the
 * symmetric part. MSIM_OK says that the true residual has reached its goal or stagnates: look at
 * it. An iteration is a product with A. */
msim_status ms_bicgstab_solve(const ms_bicgstab *solver, ms_linear *by, const ms_target *target,
                              const double *b, double *y, int64_t *iterations);

#endif
