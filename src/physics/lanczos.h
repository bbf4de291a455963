/* lanczos - bounds the largest eigenvalue of a scene's graph Laplacian, by Lanczos's method */
#ifndef MS_LANCZOS_H
#define MS_LANCZOS_H

#include "scene/scene.h"

/* M^-1 (Lap_w + b I) on scalars x_i at the free particles: row i is
 * (1/m_i) (sum w (x_i - x_j) + b x_i), with x_j = 0 if j is pinned. */
typedef struct ms_laplacian {
  const ms_scene *scene;
  const double *weight;       /* w, nsprings, >= 0 */
  const double *angle_weight; /* 2 angles.n: of springs i-j and k-j of each angular spring; NULL:
                                 without */
  double ground;              /* b >= 0 */
} ms_laplacian;

/* likely: nparticles, > 0 where the wanted eigenvector may be large, 0 if pinned. */
msim_status ms_lanczos_bound(const ms_laplacian *l, const double *likely, double *bound,
                             msim_error *err);

#endif
