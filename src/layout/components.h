/* components - the connected components of unknowns and of particles */
#ifndef MS_COMPONENTS_H
#define MS_COMPONENTS_H

#include "base/disjoint_sets.h"
#include "layout/angles.h"

/* of: out, nfree: the component of each unknown; pinned particles connect nothing. Components are
 * numbered by their first unknowns. Returns their number. */
int32_t ms_components_number(const ms_unknowns *rows, const ms_springs *springs,
                             const ms_angles *angles, int32_t *of);

/* The same of a scene, whose springs connect particles until they break. of: out, nparticles: -1
 * where pinned. Components are numbered by their first particles. */
int32_t ms_components_number_particles(const ms_scene *scene, int32_t *of);

#endif
