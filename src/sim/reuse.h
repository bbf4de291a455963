/* reuse - keeps the islands that an edit of the scene leaves as they were, with their models,
 * solvers and analyses
 *
 * An island that is kept has the same particles and springs as an old one, in the same order, with
 * other numbers in the scene; motions of its pinned particles may have other numbers, too. Its
 * model, the order of its unknowns, its solver and their analyses follow from that alone, so that
 * steps have the bits of an island that is built anew. */
#ifndef MS_REUSE_H
#define MS_REUSE_H

#include "physics/moving_pins.h"
#include "scene/edit.h"
#include "sim/sim.h"

typedef struct ms_island_reuse {
  const ms_edit_map *map;
  const ms_island_sims *old; /* the islands before the edit, while others are built */
  int32_t *island;           /* for each particle after the edit: its old island; -1: none */
  ms_moving_row *mover;      /* likewise: its motion; NULL: the edited scene has none */
} ms_island_reuse;

/* For the islands in use, and the edited scene, whose islands will be built. */
msim_status ms_reuse_create(const msim_sim *sim, const ms_edit_map *map, const ms_scene *edited,
                            ms_island_reuse *reuse, msim_error *err);
void ms_reuse_destroy(const msim_sim *sim, ms_island_reuse *reuse);

/* If the island is an old one, copy that to *m, and return 1. The old one stays valid, and *m must
 * not be used yet. */
int ms_reuse_island(const msim_sim *sim, const ms_island *island, int32_t left_out,
                    ms_island_sim *m);

/* Let a model refer to another scene, in which its particles and springs have other numbers. */
void ms_reuse_renumber(ms_model *model, const ms_scene *scene, const ms_edit_map *map);

/* Once all islands are built: move the old ones that are reused, and renumber their particles and
 * springs. */
void ms_reuse_finish(msim_sim *sim);

#endif
