/* mesh - makes the shape of an object from a mesh: its surface, and what fills it */
#ifndef MS_MESH_SHAPE_H
#define MS_MESH_SHAPE_H

#include "msim/mesh.h"
#include "scene/shape.h"

/* Set counts and lists of a shape, and shape->mesh, which the caller deletes, also after an error.
 * The members of `mesh` are in their ranges. */
msim_status ms_mesh_make(const msim_allocator *alloc, const msim_mesh *mesh, const char *subject,
                         ms_shape *shape, msim_error *err);

/* Nullable: mesh */
void ms_mesh_destroy(const msim_allocator *alloc, ms_mesh *mesh);

/* Add what was found in a mesh to what was found in those of the scene. */
void ms_mesh_add_repairs(const ms_mesh *mesh, msim_mesh_repairs *sum);

#endif
