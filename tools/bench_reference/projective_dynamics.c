/* Projective dynamics (Liu et al. 2013), which alternates between the directions of the springs and
 * a linear system with a constant matrix:
 *
 *   local:  p = L d/l of each spring      global:  (M + h^2 Lap_k) x' = M y + h^2 sum k A' p
 *
 * where A x = d. As a correction of x this is x' = x - (M + h^2 Lap_k)^-1 grad P(x) (Liu, Bouaziz
 * and Kavan 2017): both take one loop over the springs and one solve. */
#include <string.h>

#include "prefactored_descent.h"

static void projective_begin(descent *d) { memcpy(d->x, d->p->y, d->length * sizeof *d->x); }

static int projective_iterate(descent *d) {
  potential_at(d->p, d->x, d->gradient);
  if (laplacian_solve(d->p->matrix, d->gradient, d->direction) != MSIM_OK) return 0;
  for (size_t i = 0; i < d->length; i++) d->x[i] -= d->direction[i];
  return 1;
}

const descent_method projective_dynamics = {"projective dynamics", projective_begin,
                                            projective_iterate};
