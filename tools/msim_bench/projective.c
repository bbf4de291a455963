/* Projective dynamics (Liu et al. 2013), alternating between the directions of the springs and a
 * linear system that is always the same:
 *
 *   local:  p = L d/l of each spring      global:  (M + h^2 Lap_k) x' = M y + h^2 sum k A' p
 *
 * where A x = d. As a correction of x that is x' = x - (M + h^2 Lap_k)^-1 grad P(x) (Liu, Bouaziz
 * and Kavan 2017): one loop over the springs and one solve either way. */
#include <string.h>

#include "descent.h"

static void begin(descent *d) { memcpy(d->x, d->p->y, d->length * sizeof *d->x); }

static int iterate(descent *d) {
  potential_at(d->p, d->x, d->gradient);
  if (laplacian_solve(d->p->matrix, d->gradient, d->direction) != MSIM_OK) return 0;
  for (size_t i = 0; i < d->length; i++) d->x[i] -= d->direction[i];
  return 1;
}

const descent_method projective_dynamics = {"projective dynamics", begin, iterate};
