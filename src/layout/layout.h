/* layout - builds the arrays of an island that the kernels loop over, in an order that makes good
 * use of the caches */
#ifndef MS_LAYOUT_H
#define MS_LAYOUT_H

#include "layout/half_edges.h"

msim_status ms_layout_create(const ms_scene *scene, const ms_island *island, ms_unknowns *rows,
                             ms_springs *springs, ms_half_edges *half_edges, msim_error *err);
void ms_layout_destroy(const ms_scene *scene, ms_unknowns *rows, ms_springs *springs,
                       ms_half_edges *half_edges);

#endif
