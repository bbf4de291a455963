/* mesh_fill - the particles and springs inside a surface, which make it a soft body */
#ifndef MS_MESH_FILL_H
#define MS_MESH_FILL_H

#include "scene/mesh_topology.h"

typedef struct ms_fill {
  int32_t n, nsprings, capacity;
  double *x;   /* 3 n */
  int32_t *ij; /* 2 nsprings: vertices of the surface, and behind them the n points */
} ms_fill;

/* Fill a surface; spacing: see msim_mesh.fill. The caller deletes the result, also after an error.
 * subject: the mesh in messages */
msim_status ms_fill_create(const msim_allocator *alloc, const ms_surface *s, double spacing,
                           const char *subject, ms_fill *fill, msim_error *err);
void ms_fill_destroy(const msim_allocator *alloc, ms_fill *fill);

#endif
