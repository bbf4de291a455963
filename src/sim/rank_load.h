/* rank_load - the scene of a sim, of which each of several ranks may have read a part */
#ifndef MS_RANK_LOAD_H
#define MS_RANK_LOAD_H

#include "base/ranks.h"
#include "sim/rank_scene.h"

/* What a sim is made from */
typedef struct ms_rank_load {
  ms_scene *scene;     /* the whole scene, or what this rank computes of it */
  ms_rank_scene *kept; /* NULL: the whole */
  ms_rank_part *part;  /* NULL likewise */
} ms_rank_load;

/* The scene of the handle, or of the parts of all ranks: each rank gets what it computes, or, where
 * options or scene need it, the whole. opt: of the sim. Collective. Nullable: ranks (one
 * process). Destroy it, also after an error. */
msim_status ms_rank_load_scene(const msim_scene *scene, const msim_options *opt, ms_ranks *ranks,
                               ms_rank_load *load, msim_error *err);
void ms_rank_load_destroy(const msim_allocator *alloc, ms_rank_load *load);

#endif
