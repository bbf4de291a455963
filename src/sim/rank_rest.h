/* rank_rest - rest lengths of springs of a scene that ranks have read in parts, where its file has
 * none: their lengths at the start, between particles that other ranks may have read */
#ifndef MS_RANK_REST_H
#define MS_RANK_REST_H

#include "base/ranks.h"
#include "scene/scene.h"

/* Set part->rows->rest, with the bits of one process. Collective, with the same status on all
 * ranks. */
msim_status ms_rank_rest_compute(const ms_scene_part *part, ms_ranks *ranks, msim_error *err);

#endif
