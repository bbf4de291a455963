/* mesh_merge - merges vertices that are at the same place, or nearly */
#ifndef MS_MESH_MERGE_H
#define MS_MESH_MERGE_H

#include "base/memory.h"
#include "msim/mesh.h"

/* Set representative[v] of the vertices v where it is not negative: in their order, that with the
 * least index among the representatives within 1e-6 of the diagonal of their bounding box, or v
 * itself. Counts what it merges, and sets *tolerance to that distance. 0: out of memory. */
int ms_mesh_merge(const msim_allocator *alloc, int32_t n, const double *x, int32_t *representative,
                  double *tolerance, msim_mesh_repairs *repairs);

#endif
