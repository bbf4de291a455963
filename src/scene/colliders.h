/* colliders - solids that particles cannot enter, or cannot leave: their types, the keys of each
 * type, and the form in which distances from them are computed */
#ifndef MS_COLLIDERS_H
#define MS_COLLIDERS_H

#include <stdatomic.h>

#include "base/memory.h"
#include "msim/scene.h"
#include "scene/scene_keys.h"

/* Samples of a collider on a regular grid, shared by scenes */
typedef struct ms_samples {
  atomic_int references;
  int32_t n[3];        /* n[2] = 1: heights */
  double spacing[3];   /* m */
  double least_cosine; /* of heights: of the steepest slope */
  double highest;      /* m: the largest of the values */
  double values[];     /* m: n[0] n[1] n[2] */
} ms_samples;

/* A solid in coordinates of its own, q = axis (x - center): a sphere or capsule is the points at
 * most `radius` from the axis |q_2| <= half_2, q_0 = q_1 = 0; a cylinder is |(q_0, q_1)| <= radius,
 * |q_2| <= half_2; a box is |q_i| <= half_i; a half-space is q_2 <= -half_2; samples begin at
 * q = 0. */
typedef struct ms_solid {
  int32_t type;           /* msim_collider_type, or MS_SOLID_HALF_SPACE */
  int32_t inside;         /* 1: particles stay inside */
  double center[3];       /* m */
  double axis[3][3];      /* orthonormal rows */
  double half[3];         /* m; 0 where the type has none */
  double radius;          /* m */
  double reach;           /* m: no point of the solid is farther from the origin */
  double velocity[3];     /* m/s: of the center; 0 at rest */
  double spin[3];         /* rad/s: angular velocity about the center */
  double acceleration[3]; /* m/s^2: of the center */
  double spin_rate[3];    /* rad/s^2: angular acceleration */
  ms_samples *samples;    /* NULL: without samples */
} ms_solid;

/* The face of a solid inside out that moves, as a solid of its own (obstacles.h) */
enum { MS_SOLID_HALF_SPACE = MSIM_COLLIDER_SDF + 1 };

/* A key of colliders and the member of msim_collider, one or more doubles, that it sets */
typedef struct ms_collider_member {
  ms_scene_key key;
  size_t offset;
  unsigned types; /* bit 1 << t is set if type t has this key */
} ms_collider_member;

enum { MS_COLLIDER_MEMBERS = 11 };
extern const ms_collider_member ms_collider_members[MS_COLLIDER_MEMBERS];
extern const ms_scene_key ms_collider_type_key, ms_collider_inside_key, ms_collider_motion_key;

static inline int ms_colliders_type_has(int32_t type, const ms_collider_member *member) {
  return (int)(member->types >> type & 1);
}

/* The numbers of a member: member->key.count doubles */
static inline const double *ms_colliders_get_member(const msim_collider *c,
                                                    const ms_collider_member *member) {
  return (const double *)(const void *)((const char *)c + member->offset);
}

typedef struct ms_collider_type {
  const char *name, *doc;
} ms_collider_type;

/* The keys of the samples of a type; NULL: it has none */
const ms_scene_key *ms_colliders_get_count_key(int32_t type);
const ms_scene_key *ms_colliders_get_values_key(int32_t type);

/* The number of samples of a collider; 0 without */
size_t ms_colliders_count_values(const msim_collider *c);

/* A hash of the solid and its samples, added to `hash` */
uint64_t ms_colliders_hash(const msim_collider *c, uint64_t hash);

/* Get type `type`, from MSIM_COLLIDER_SPHERE on; NULL: there is no such type. */
const ms_collider_type *ms_colliders_get_type(int32_t type);

#endif
