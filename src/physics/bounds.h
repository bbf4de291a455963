/* bounds - on frequencies and damping rates, in every configuration, from the scene alone
 *
 * M x'' = -K x - C x' with K, C at some configuration. A mode e^(lambda t) u of it is one of
 *   x'' = -g x' - w^2 x,  w^2 = u*K u / u*M u,  g = u*C u / u*M u,
 * whatever K and C have in common. A spring's block of K is at most k times that of the graph
 * Laplacian, its block of C at most c times: so w <= omega and least_rate <= g <= rate, and every
 * pair between may occur. Springs shorter than their rest length may make w^2 negative: such
 * motions grow by themselves, with any method.
 *
 * Along springs w^2 <= r g holds for every mode if K <= r C as quadratic forms. The part of a
 * spring that its dashpot does not cover is (k - r c)^+; by Gershgorin's discs drag covers these
 * parts if for each free particle
 *   sum over its springs of e (k - r c)^+ <= r b,   e = 2, or 1 towards a pinned particle.
 * `ratio` is the least such r: max k/c without drag, INFINITY if a spring without damping pulls and
 * there is no drag. Across a spring no dashpot acts: there drag alone damps. */
#ifndef MS_BOUNDS_H
#define MS_BOUNDS_H

#include "physics/model.h"

typedef struct ms_bounds {
  double omega;      /* sqrt(lambda_max(M^-1 Lap_k)) or more, 1/s */
  double rate;       /* lambda_max(M^-1 (Lap_c + b I)) or more, 1/s */
  double least_rate; /* b / max m: springs do not damp what moves across them, 1/s */
  double ratio;      /* of w^2 to g in any mode along springs, at most, 1/s */
} ms_bounds;

/* By Gershgorin's discs, in one pass over the springs. sharp: by Lanczos's method too, in some
 * 15 passes or 30 for each of k and c, and never above the discs. */
msim_status ms_bounds_compute(const ms_scene *scene, int sharp, ms_bounds *bounds, msim_error *err);

/* Those of the discs for one island, without `ratio`, which is 0; allocates nothing. */
ms_bounds ms_bounds_of(const ms_model *model);

#endif
