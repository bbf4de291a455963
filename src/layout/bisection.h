/* bisection - divides the free particles of a scene among ranks, by recursive coordinate bisection
 * (Berger and Bokhari, IEEE Trans. Comput. C-36 (1987) 570)
 *
 * Each part is cut across the longest side of its bounding box into two, as large as the numbers of
 * ranks on both sides require. Particles with equal coordinates are divided by their numbers, so
 * that the result depends on the scene and the number of ranks alone. Parts differ by one particle
 * for each level of the recursion at most. */
#ifndef MS_BISECTION_H
#define MS_BISECTION_H

#include "scene/scene.h"

enum { MS_NO_OWNER = -1 }; /* of pinned particles */

/* owner: nparticles: the rank of each free particle by its position in the scene. scratch:
 * nparticles. */
void ms_bisection_assign(const ms_scene *scene, int32_t nranks, int32_t *owner, int32_t *scratch);

#endif
