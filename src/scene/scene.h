/* scene - the data of a scene: arrays in the order of the particles, validated on entry, shared by
 * sims
 *
 * A handle (msim_scene) points to reference-counted data. A sim takes a reference; the first setter
 * that finds the data shared makes a copy for its handle (copy on write), so shared data never
 * changes. */
#ifndef MS_SCENE_H
#define MS_SCENE_H

#include <stdatomic.h>

#include "base/text.h"
#include "msim/mesh.h"
#include "scene/collider_motions.h"
#include "scene/colliders.h"
#include "scene/scene_keys.h"

typedef struct ms_run_option {
  char *name, *value; /* in the form that msim_options_set takes */
} ms_run_option;

/* The parameters of forces on particles (physics/external_force.h) */
typedef struct ms_external {
  double gravity[3]; /* m/s^2 */
  double drag;       /* N s/m */
} ms_external;

/* Contact of faces and ropes with each other (contact/self_contact.h) */
typedef struct ms_scene_self_contact {
  double thickness; /* m; 0: none */
  double friction;
} ms_scene_self_contact;

/* Angular springs (angles.h) */
typedef struct ms_scene_angles {
  int32_t n, capacity;
  int32_t *ijk;               /* 3 n: the vertex j in the middle */
  double *k, *rest, *damping; /* n: N m/rad^2, rad, N m s/rad */
} ms_scene_angles;

struct ms_law;

typedef struct ms_scene {
  msim_allocator alloc;
  atomic_int references;
  char *name;   /* never NULL */
  char *source; /* text of the scene file; NULL after any change of the scene */

  int32_t nparticles, particle_capacity;
  double *x, *v, *mass; /* 3n, 3n, n */
  uint8_t *pinned;      /* n */
  double *force;        /* 3n: constant forces, N; NULL: none */

  int32_t nsprings, spring_capacity;
  int32_t *ij; /* 2 nsprings */
  double *k, *rest, *damping;

  int32_t nlaws, law_capacity;
  struct ms_law *laws; /* nlaws: law 1 is laws[0] (laws.h) */
  int32_t *law;        /* nsprings: numbers of laws, 0: linear; NULL: all are linear */
  uint8_t *broken;     /* nsprings, of a sim: MS_INTACT, ... (laws.h); NULL: no spring breaks */
  int hides_broken;    /* 1: only those MS_BROKEN_BEFORE count as broken */

  ms_scene_angles angles;

  int32_t nfaces, face_capacity;
  int32_t *faces; /* 3 nfaces: triangles of particles, for viewers and self-contact */

  int32_t nends; /* of the whole scene: springs and faces refer to so many particles, of which the
                    scene has a part; 0: to its own ones */

  int32_t nplanes, plane_capacity;
  msim_plane *planes;
  int32_t planes_constrain; /* 1: in implicit methods they are treated as colliders are */

  int32_t ncolliders, collider_capacity;
  msim_collider *colliders;
  ms_solid *solids;                     /* ncolliders: the same, at rest */
  ms_collider_motion *collider_motions; /* ncolliders */

  int32_t nmotions, motion_capacity;
  ms_motion *motions;

  msim_force_function force_function; /* evaluate NULL: none; owns its name */

  int32_t nrun, run_capacity;
  ms_run_option *run;

  ms_external external;
  ms_scene_self_contact self_contact;

  msim_mesh_repairs repairs; /* of all its meshes */
} ms_scene;

/* The rows of a scene that one of several ranks has read of its file */
typedef struct ms_scene_part {
  ms_scene *rows; /* particles, springs and faces of ms_section_of_rank, nothing else */
  int32_t rank, nranks;
  int32_t nparticles, nsprings, nfaces; /* of the whole scene */
  int lacks_rest; /* 1: the file has no rest lengths, for which ranks need each other's particles */
} ms_scene_part;

struct msim_scene {
  ms_scene *data;
  ms_scene_part *part; /* NULL: data has all; else data has no particles, springs and faces */
};

ms_scene *ms_scene_retain(ms_scene *scene); /* increments the number of references */
void ms_scene_release(ms_scene *scene);     /* decrements it, frees the data at 0; accepts NULL */

/* The number of particles that springs and faces may refer to */
static inline int32_t ms_scene_count_ends(const ms_scene *s) {
  return s->nends ? s->nends : s->nparticles;
}

/* 1: the program computes forces, which have these flags. */
static inline int ms_scene_has_function(const ms_scene *s) {
  return s->force_function.evaluate != NULL;
}
static inline int ms_scene_function_has(const ms_scene *s, uint32_t flags) {
  return (s->force_function.flags & flags) != 0;
}

/* Copy the force function of `from` to a scene without one. 0: out of memory */
static inline int ms_scene_copy_function(const ms_scene *from, ms_scene *to) {
  const char *name = from->force_function.name;
  to->force_function = from->force_function;
  to->force_function.name = name ? ms_memory_copy_string(&to->alloc, name) : NULL;
  return !name || to->force_function.name;
}

/* A parameter of ms_external: its key in scene files, and its numbers. */
typedef struct ms_scene_parameter {
  ms_scene_key key;
  size_t offset;
  msim_status (*set)(msim_scene *scene, const double *numbers, msim_error *err);
} ms_scene_parameter;

enum { MS_SCENE_PARAMETERS = 2 };
extern const ms_scene_parameter ms_scene_parameters[MS_SCENE_PARAMETERS];

/* The numbers of a parameter in a scene */
const double *ms_scene_get_parameter(const ms_scene *scene, const ms_scene_parameter *parameter);

/* Get the handle's data for writing: copies them if they are shared, and discards `source`. NULL:
 * out of memory. */
ms_scene *ms_scene_make_writable(msim_scene *scene, msim_error *err);

/* 1: particles may collide with planes or colliders. */
static inline int ms_scene_has_obstacles(const ms_scene *s) {
  return s->nplanes > 0 || s->ncolliders > 0;
}

/* 1: surfaces do not pass through each other. */
static inline int ms_scene_has_self_contact(const ms_scene *s) {
  return s->self_contact.thickness > 0;
}

/* 1: implicit methods may constrain particles in contact by their matrix. */
static inline int ms_scene_constrains(const ms_scene *s, int32_t collision) {
  const int holds =
      collision == MSIM_COLLISION_EVENT || ms_scene_has_self_contact(s) || s->planes_constrain;
  return holds ? ms_scene_has_obstacles(s) : s->ncolliders > 0;
}

/* Make room for `needed` elements in `count` arrays of n, all of *capacity, as those of particles,
 * springs or colliders. Return 0 if there is no memory. */
int ms_scene_reserve(const ms_scene *s, const ms_array *arrays, int count, int32_t n,
                     int32_t *capacity, int64_t needed, msim_error *err);
int ms_scene_reserve_particles(ms_scene *s, int64_t needed, msim_error *err);
int ms_scene_reserve_springs(ms_scene *s, int64_t needed, msim_error *err);
int ms_scene_reserve_colliders(ms_scene *s, int64_t needed, msim_error *err);

/* Append n springs without a copy: make room, fill ij, k, damping and, where has_rest, rest behind
 * those of the present springs, and then let them be checked and counted. */
msim_status ms_scene_begin_springs(msim_scene *scene, int32_t n, msim_error *err);
msim_status ms_scene_end_springs(ms_scene *s, int32_t n, int has_rest, msim_error *err);

/* The same for faces */
msim_status ms_scene_begin_faces(msim_scene *scene, int32_t n, msim_error *err);
msim_status ms_scene_end_faces(ms_scene *s, int32_t n, msim_error *err);

/* Remove the particle from its motion, if it has one. */
void ms_scene_remove_motion(ms_scene *scene, int32_t particle);

/* 1: a motion prescribes where the particle is. */
int ms_scene_has_motion(const ms_scene *scene, int32_t particle);

/* Refuse a negative number of `what`. */
msim_status ms_scene_check_count(int64_t n, const char *what, msim_error *err);

/* Refuse a number of values[n] that is not finite; indices in messages are those of groups of
 * `width` numbers. */
msim_status ms_scene_check_finite(const char *what, int64_t n, int width, const double *values,
                                  msim_error *err);

/* The length of a spring between two points */
double ms_scene_distance(const double *a, const double *b);

/* Refuse the length of spring e, which is not finite. */
msim_status ms_scene_refuse_length(int64_t e, msim_error *err);

/* Append an option of the scene file's `run`; the caller has checked it by msim_options_set. */
msim_status ms_scene_add_run_option(msim_scene *scene, const char *name, const char *value,
                                    msim_error *err);

/* Write the scene as JSON: the text it was read from, if it has not changed since. */
msim_status ms_scene_write_json(const ms_scene *scene, ms_text *text, msim_error *err);

/* 1: valid UTF-8, 0: not, -1: out of memory. */
int ms_scene_is_utf8(const char *text);

/* Refuse a scene that a scene file cannot represent: without particles, or with an invalid name. */
msim_status ms_scene_check_savable(const ms_scene *scene, msim_error *err);

/* Conditions under which a scene file stores one number for all, or none. Comparisons are bitwise,
 * so -0 is not 0. */
int ms_scene_all_equal(int64_t count, const double *numbers);
int ms_scene_all_zero(int64_t count, const double *numbers);

#endif
