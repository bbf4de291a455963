/* objects - creation of ropes, cloths and lattices, which are all grids of particles, from tables
 * that describe the members of their structs */
#ifndef MS_OBJECTS_H
#define MS_OBJECTS_H

#include "scene/scene.h"

/* A key of an object in a scene file and the members of its struct that it sets. */
typedef struct ms_object_member {
  ms_scene_key key;
  const char *names[3]; /* of members of the struct; a single one is followed by an index */
  const char *parts[3]; /* keys of the JSON object that may replace a single number, or NULL */
  size_t offset;
} ms_object_member;

/* Offset in the grid from one end of a spring to the other. */
typedef struct ms_grid_spring {
  int8_t offset[3];
  int8_t stiffness; /* index of the stiffness in the grid's k */
} ms_grid_spring;

/* Particle (a n[1] + b) n[2] + c is at origin + a/(n[0]-1) edge[0] + b/(n[1]-1) edge[1] +
 * c/(n[2]-1) edge[2]. */
typedef struct ms_grid {
  int32_t n[3];
  double origin[3], edge[3][3];
  int has_last; /* 1: the last particle is exactly at `last` */
  double last[3];
  double mass, k[3], damping;
  double bending; /* of angular springs along the first two axes */
  const ms_grid_spring *springs;
  int32_t nsprings, npinned;
  const int32_t *pinned;
  int32_t law;   /* of its springs */
  int32_t first; /* index of its first particle in the scene */
} ms_grid;

typedef struct ms_object_type {
  const char *name;
  size_t size; /* of the struct; its first member must have this value, or, of older programs, */
  size_t least_size; /* at least that */
  const ms_object_member *members;
  int32_t nmembers;
  const ms_scene_key *pinned;
  const char *doc;
  void (*make)(const void *object, ms_grid *grid);
} ms_object_type;

enum { MS_MAX_MEMBERS = 9 };

/* Large enough for any type of object. */
typedef union ms_object {
  size_t size;
  msim_rope rope;
  msim_cloth cloth;
  msim_lattice lattice;
} ms_object;

/* Get the i-th type, NULL past the end. */
const ms_object_type *ms_objects_get_type(int32_t i);

/* Build a grid from the struct `object` and check it. `subject` is its name in messages: "cloth",
 * "objects[3]". The array of pinned particles is borrowed. */
msim_status ms_objects_make_grid(const ms_object_type *type, const void *object,
                                 const char *subject, ms_grid *grid, msim_error *err);
int32_t ms_objects_grid_size(const ms_grid *grid);

/* Call these in this order, the last one for springs and angular springs; the borrowed arrays are
 * needed by the first only. After a failure, particles may remain in the scene, which the caller
 * must remove. */
msim_status ms_objects_add_particles(msim_scene *scene, ms_grid *grid, const char *subject,
                                     msim_error *err);
msim_status ms_objects_add_faces(msim_scene *scene, const ms_grid *grid, msim_error *err);
msim_status ms_objects_add_springs(msim_scene *scene, const ms_grid *grid, msim_error *err);

#endif
