/* bounds - bounds on frequencies and damping rates of a scene that hold in every configuration
 *
 * M x'' = -K x - C x' with K, C at some configuration. A mode e^(lambda t) u of it is one of
 *   x'' = -g x' - w^2 x,  w^2 = u*K u / u*M u,  g = u*C u / u*M u,
 * for any K and C. A spring's block of K is at most k times that of the graph Laplacian, its block
 * of C at most c times that; a force function adds at most its largest stiffness and damping to
 * the blocks of a particle: so w <= omega and least_rate <= g <= rate, and every pair within these
 * bounds may occur. Springs shorter than their rest length may make w^2 negative: such motions grow
 * physically, with any method.
 *
 * An angular spring is bounded by two springs along its edges of the lengths in the scene
 * (scene/angles.h): so omega and rate hold there, and beyond while edges are not shorter, and the
 * angle not much farther from rest.
 *
 * Along springs w^2 <= r g holds for every mode if K <= r C as quadratic forms. The part of a
 * spring that its dashpot does not cover is (k - r c)^+; by Gershgorin's theorem drag covers these
 * parts if for each free particle
 *   sum over its springs of e (k - r c)^+ <= r b,   e = 2, or 1 towards a pinned particle.
 * `ratio` is the least such r: max k/c without drag, INFINITY if there is a spring without damping
 * and no drag. Across a spring no dashpot acts: only drag damps there. */
#ifndef MS_BOUNDS_H
#define MS_BOUNDS_H

#include "physics/model.h"

typedef struct ms_bounds {
  double omega;      /* >= sqrt(lambda_max(M^-1 Lap_k)), 1/s */
  double rate;       /* >= lambda_max(M^-1 (Lap_c + b I)), 1/s */
  double least_rate; /* b / max m, as springs do not damp motion across them, 1/s */
  double ratio;      /* >= w^2/g of any mode along springs, 1/s */
} ms_bounds;

/* By Gershgorin discs, in one loop over the springs for each of k and c. tight: also by Lanczos's
 * method, in 15 to 30 more loops each; never above the discs. */
msim_status ms_bounds_compute(const ms_scene *scene, int tight, ms_bounds *bounds, msim_error *err);

/* Gershgorin's disc of a row times its mass: the sum over its springs, and those that bound its
 * angular springs, of e k, e = 2, or 1 if the other end is pinned */
double ms_bounds_sum_stiffness(const ms_model *model, int32_t row);

/* By Gershgorin discs for one island, with ratio = 0; allocates nothing. */
ms_bounds ms_bounds_compute_island(const ms_model *model);

/* The stability limit (s) of symplectic Euler and Verlet: the largest h with
 * h^2 omega^2 + 2 h rate <= 4 */
double ms_bounds_verlet_limit(const ms_bounds *b);

#endif
