/* spring_values - k, rest and damping of half-edges (half_edges.h), stored once for all entries
 * whose springs are alike, lane by lane
 *
 * A cloth or a lattice has some thousand distinct entries, whatever its size. They are found by a
 * table of the last entry of each hash: what a collision drives out is stored again. */
#ifndef MS_SPRING_VALUES_H
#define MS_SPRING_VALUES_H

#include "layout/half_edges.h"

/* Memory for the springs of the scene, or for springs of any values if some of these may break, and
 * the values */
msim_status ms_spring_values_create(const ms_scene *scene, const ms_springs *springs,
                                    ms_half_edges *half_edges, msim_error *err);
void ms_spring_values_destroy(const ms_scene *scene, ms_half_edges *half_edges);

/* Make room for springs of any values; on failure nothing changes. */
msim_status ms_spring_values_reserve(const ms_scene *scene, const ms_springs *springs,
                                     ms_half_edges *half_edges, msim_error *err);

/* Copy the values from the scene again: those of creation, or if there is room for them any
 * others. */
void ms_spring_values_update(const ms_scene *scene, const ms_springs *springs,
                             ms_half_edges *half_edges);

#endif
