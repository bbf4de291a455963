/* rank_distribute - gives each rank its part of a scene of which each has read a slice: no rank has
 * the whole, but rank 0 for a moment its positions and springs */
#ifndef MS_RANK_DISTRIBUTE_H
#define MS_RANK_DISTRIBUTE_H

#include "sim/rank_load.h"

/* Set load->scene to the part of this rank, and load->kept and part, with the order of its unknowns
 * in kept->order. islands: 0 if the whole scene is one island (ms_islands_create). Collective, with
 * the same status on all ranks; after an error `load` has to be destroyed. */
msim_status ms_rank_distribute(const msim_scene *scene, ms_ranks *ranks, int islands,
                               ms_rank_load *load, msim_error *err);

#endif
