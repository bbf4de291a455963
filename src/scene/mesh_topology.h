/* mesh_topology - from vertices and triangles to particles, edges and oriented faces */
#ifndef MS_MESH_TOPOLOGY_H
#define MS_MESH_TOPOLOGY_H

#include "base/memory.h"
#include "msim/mesh.h"

/* A mesh without the defects that can be repaired (mesh.h). The half-edge 3 f + c goes from corner
 * c of face f to its corner (c + 1) % 3. */
typedef struct ms_surface {
  int32_t nvertices, nfaces, nedges;
  double *x;        /* 3 nvertices */
  int32_t *corners; /* 3 nfaces */
  int32_t *ij;      /* 2 nedges: i < j, ascending */
  int32_t *first;   /* nedges + 1: the half-edges of edge e are half[first[e]], ..., of ascending */
  int32_t *half;    /* 3 nfaces   faces up to half[first[e + 1] - 1] */
  msim_mesh_repairs repairs;
} ms_surface;

/* Make a surface from n vertices and nfaces triangles of them, which are in range and finite; the
 * extent of the vertices is finite, too. 0: out of memory. The caller deletes it, also then. */
int ms_surface_create(const msim_allocator *alloc, int32_t n, const double *x, int32_t nfaces,
                      const int32_t *faces, ms_surface *s);
void ms_surface_destroy(const msim_allocator *alloc, ms_surface *s);

/* The vertex of a half-edge's face that is not on it. */
static inline int32_t ms_surface_opposite(const ms_surface *s, int32_t half) {
  return s->corners[half / 3 * 3 + (half + 2) % 3];
}

/* 1: the half-edge goes from i to j, of its edge. */
static inline int ms_surface_ascends(const ms_surface *s, int32_t half) {
  return s->corners[half] < s->corners[half / 3 * 3 + (half + 1) % 3];
}

#endif
