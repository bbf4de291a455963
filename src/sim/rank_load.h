/* rank_load - the scene of a sim whose ranks have each read a part of it */
#ifndef MS_RANK_LOAD_H
#define MS_RANK_LOAD_H

#include "base/ranks.h"
#include "scene/scene.h"

/* The whole scene: that of the handle, or gathered from the parts of all ranks; to be released.
 * Collective. Nullable: ranks (one process). */
msim_status ms_rank_load_scene(const msim_scene *scene, ms_ranks *ranks, ms_scene **whole,
                               msim_error *err);

#endif
