/* bounds - on frequencies and damping rates, in every configuration, from the scene alone
 *
 * M x'' = -K x - C x' with K, C at some configuration. A mode e^(lambda t) u of it is one of
 *   x'' = -g x' - w^2 x,  w^2 = u*K u / u*M u,  g = u*C u / u*M u,
 * whatever K and C have in common. A spring's block of K is at most k times that of the graph
 * Laplacian, its block of C at most c times: so w <= omega and least_rate <= g <= rate, and every
 * pair between may occur. Springs shorter than their rest length may make w^2 negative: such
 * motions grow by themselves, with any method. */
#ifndef MS_BOUNDS_H
#define MS_BOUNDS_H

#include "physics/model.h"

typedef struct ms_bounds {
  double omega;      /* sqrt(lambda_max(M^-1 Lap_k)) or more, 1/s */
  double rate;       /* lambda_max(M^-1 (Lap_c + b I)) or more, 1/s */
  double least_rate; /* b / max m: springs do not damp what moves across them, 1/s */
} ms_bounds;

/* By Gershgorin's discs, in one pass over the springs. sharp: by Lanczos's method too, in some
 * 15 passes or 30 for each of k and c, and never above the discs. */
msim_status ms_bounds_compute(const ms_scene *scene, int sharp, ms_bounds *bounds, msim_error *err);

/* Those of the discs for one island, which allocates nothing. */
ms_bounds ms_bounds_of(const ms_model *model);

#endif
