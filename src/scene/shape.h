/* shape - what an object adds to a scene: particles, faces, springs and angular springs, counted
 * when it is made and listed one kind after the other, with indices within the object */
#ifndef MS_SHAPE_H
#define MS_SHAPE_H

#include "scene/grid.h"

typedef struct ms_shape ms_shape;
typedef struct ms_mesh ms_mesh;

/* What lists the parts of a kind of shape. Nullable: list_angles (there are none). */
typedef struct ms_shape_lists {
  void (*place_particles)(const ms_shape *shape, double *x);
  void (*list_faces)(const ms_shape *shape, int32_t *corners);
  void (*list_springs)(const ms_shape *shape, int32_t *ij, double *k);
  void (*list_angles)(const ms_shape *shape, int32_t *ijk);
} ms_shape_lists;

struct ms_shape {
  const ms_shape_lists *lists;
  int32_t nparticles;
  int64_t nfaces, nsprings, nangles;
  double mass; /* of the whole object */
  double damping, bending;
  int32_t law, npinned;
  const int32_t *pinned; /* borrowed */
  int32_t first;         /* index of its first particle in the scene */
  ms_grid grid;          /* of ropes, cloths and lattices */
  ms_mesh *mesh;         /* of meshes (mesh.h); owned */
};

#endif
