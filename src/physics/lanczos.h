/* lanczos - the largest eigenvalue of a scene's graph Laplacian, with some to spare */
#ifndef MS_LANCZOS_H
#define MS_LANCZOS_H

#include "scene/scene.h"

/* M^-1 (Lap_w + b I) on the free particles, a number each: row i takes
 * (1/m_i) (sum w (x_i - x_j) + b x_i), x_j = 0 where j is pinned. */
typedef struct ms_laplacian {
  const ms_scene *scene;
  const double *weight; /* w, nsprings, >= 0 */
  double ground;        /* b >= 0 */
} ms_laplacian;

/* likely: nparticles, above 0 where the wanted eigenvector may be large. */
msim_status ms_lanczos_bound(const ms_laplacian *l, const double *likely, double *bound,
                             msim_error *err);

#endif
