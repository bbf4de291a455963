/* angles - the angular springs of a scene: at particle j, between its edges to i and k */
#ifndef MS_SCENE_ANGLES_H
#define MS_SCENE_ANGLES_H

#include "scene/scene.h"

#define MS_PI 3.14159265358979323846

/* The edges p = x_i - x_j and q = x_k - x_j */
void ms_scene_angles_get_edges(const ms_scene *scene, const int32_t ijk[3], double p[3],
                               double q[3]);

/* The angle at j between the edges to i and k, given their positions; pi exactly if these are
 * straight up to rounding, which is a smooth minimum of the energy. NaN: an edge has no length. */
double ms_scene_angles_measure(const double *const at[3]);

/* Append n angular springs that have been checked. */
msim_status ms_scene_angles_append(ms_scene *scene, int32_t n, const int32_t *ijk, const double *k,
                                   const double *rest, const double *damping, msim_error *err);

/* Copy the angular springs to a scene that has none. Returns 0 if memory is exhausted. */
int ms_scene_angles_copy(const ms_scene *from, ms_scene *to);
void ms_scene_angles_free(ms_scene *scene);

/* Weights of springs i-j and k-j whose graph Laplacian, times the largest k (or damping), bounds
 * the matrix of the angular spring where its edges have the lengths a, b of the scene:
 *   (dtheta)^2 <= (1/a + 1/b) (|x_i - x_j|^2/a + |x_k - x_j|^2/b)  by Cauchy's inequality,
 * times 1 + |theta - rest| for the part k (theta - rest) Hess theta. 0, as the force, if a or b is
 * 0. In 1/m^2. */
void ms_scene_angles_weigh(const ms_scene *scene, int32_t angle, double weight[2]);

#endif
