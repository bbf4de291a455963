/* rank_others - what a rank needs for output beside its section of the scene: the particles that
 * its springs, faces and angular springs refer to, and for the strain of its faces the springs
 * between their corners; on rank 0, for reactions, pinned particles, and springs and angular
 * springs at them
 *
 * Where ranks have slices of the scene, the ends of all springs pass by in pieces: none has all. */
#ifndef MS_RANK_OTHERS_H
#define MS_RANK_OTHERS_H

#include "scene/section.h"
#include "sim/rank_scene.h"

/* Particles and springs that are not in the section, ascending */
typedef struct ms_rank_others {
  int32_t n, nsprings;
  int32_t *particle, *spring;
} ms_rank_others;

/* Collective, with the same status on all ranks; both lists have to be freed, also after an error.
 */
msim_status ms_rank_others_find(const msim_sim *sim, const ms_section *section,
                                ms_rank_others *others, msim_error *err);

#endif
