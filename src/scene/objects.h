/* objects - creation of ropes, cloths, lattices and meshes from tables that describe the members of
 * their structs */
#ifndef MS_OBJECTS_H
#define MS_OBJECTS_H

#include "msim/mesh.h"
#include "scene/scene.h"
#include "scene/shape.h"

/* A key of an object in a scene file and the members of its struct that it sets. */
typedef struct ms_object_member {
  ms_scene_key key;
  const char *names[3]; /* of members of the struct; a single one is followed by an index */
  const char *parts[3]; /* keys of the JSON object that may replace a single number, or NULL */
  size_t offset;
} ms_object_member;

typedef struct ms_object_type {
  const char *name;
  size_t size; /* of the struct; its first member must have this value, or, of older programs, */
  size_t least_size; /* at least that */
  const ms_object_member *members;
  int32_t nmembers;
  const ms_scene_key *pinned;
  const char *doc;
  /* Make a shape from the struct, whose members are in their ranges. */
  msim_status (*make)(const msim_allocator *alloc, const void *object, const char *subject,
                      ms_shape *shape, msim_error *err);
} ms_object_type;

enum { MS_MAX_MEMBERS = 9 };

/* Large enough for any type of object. */
typedef union ms_object {
  size_t size;
  msim_rope rope;
  msim_cloth cloth;
  msim_lattice lattice;
  msim_mesh mesh;
} ms_object;

/* Get the i-th type, NULL past the end. */
const ms_object_type *ms_objects_get_type(int32_t i);

/* Make a shape from the struct `object` and check it. `subject` is its name in messages: "cloth",
 * "objects[3]". The array of pinned particles is borrowed.
 * The caller deletes the shape, also after an error. */
msim_status ms_objects_make_shape(const msim_allocator *alloc, const ms_object_type *type,
                                  const void *object, const char *subject, ms_shape *shape,
                                  msim_error *err);

void ms_objects_free_shape(const msim_allocator *alloc, ms_shape *shape);

/* Call these in this order, the last one for springs and angular springs; the array of pinned
 * particles is needed by the first only. After a failure, particles may remain in the scene, which
 * the caller must remove. */
msim_status ms_objects_add_particles(msim_scene *scene, ms_shape *shape, const char *subject,
                                     msim_error *err);
msim_status ms_objects_add_faces(msim_scene *scene, const ms_shape *shape, msim_error *err);
msim_status ms_objects_add_springs(msim_scene *scene, const ms_shape *shape, msim_error *err);

#endif
