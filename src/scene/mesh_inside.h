/* mesh_inside - the points of a cubic lattice inside a closed surface, and far enough from it */
#ifndef MS_MESH_INSIDE_H
#define MS_MESH_INSIDE_H

#include "scene/mesh_topology.h"

/* Point (ix n[1] + iy) n[2] + iz is at origin + spacing (ix, iy, iz). */
typedef struct ms_inside {
  int32_t n[3];
  double origin[3], spacing;
  int32_t *part;   /* of each point: the part of the surface that it is in; -1: it is not inside */
  int32_t *vertex; /* of each vertex of the surface: its part; parts are named by a vertex */
} ms_inside;

/* Find the points inside. n, origin and spacing are set. Parts of the surface are one part where
 * faces connect them, or where they have points in common. 0: out of memory. The caller deletes
 * it, also then. */
int ms_inside_find(const msim_allocator *alloc, const ms_surface *s, ms_inside *in);
void ms_inside_destroy(const msim_allocator *alloc, ms_inside *in);

static inline int32_t ms_inside_count(const ms_inside *in) {
  return in->n[0] * in->n[1] * in->n[2];
}

#endif
