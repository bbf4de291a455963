/* objects - ropes, cloths and lattices: tables of what their structs hold, and one builder, for
 * all of them are grids */
#ifndef MS_OBJECTS_H
#define MS_OBJECTS_H

#include "scene/scene.h"

/* What a number may be; all are finite. */
typedef enum ms_range {
  MS_ANY,
  MS_NOT_NEGATIVE,
  MS_POSITIVE,
  MS_FRACTION, /* [0, 1] */
  MS_COUNT     /* whole, >= 1, an int32_t */
} ms_range;

int ms_in_range(ms_range range, double value);
const char *ms_range_text(ms_range range); /* "a number > 0" */

/* One key of an object in a scene file and the member of its struct, or members in a row. */
typedef struct ms_member {
  const char *key;
  const char *names[3]; /* in the struct; where there is only the first, an index follows it */
  const char *parts[3]; /* of the file's object of numbers that may stand for one number */
  ms_range range;
  int32_t count;
  size_t offset;
  int optional;
} ms_member;

/* A step from a particle of a grid to another that a spring ties it to. */
typedef struct ms_tie {
  int8_t step[3];
  int8_t law; /* which of the grid's k */
} ms_tie;

/* Particle (a n[1] + b) n[2] + c lies at origin + a/(n[0]-1) edge[0] + b/(n[1]-1) edge[1] + ... */
typedef struct ms_grid {
  int32_t n[3];
  double origin[3], edge[3][3];
  const double *last; /* where the last particle lies to the bit, borrowed; NULL: as above */
  double mass, k[3], damping;
  const ms_tie *ties;
  int32_t nties, npinned;
  const int32_t *pinned;
  int32_t first; /* its first particle, once added */
} ms_grid;

typedef struct ms_object_type {
  const char *name;
  size_t size; /* of the struct, whose first member says it again */
  const ms_member *members;
  int32_t nmembers;
  void (*make)(const void *object, ms_grid *grid);
} ms_object_type;

enum { MS_MOST_MEMBERS = 8 };

/* Room for any object. */
typedef union ms_object {
  size_t size;
  msim_rope rope;
  msim_cloth cloth;
  msim_lattice lattice;
} ms_object;

/* The i-th type, NULL past the end. */
const ms_object_type *ms_object_type_info(int32_t i);

/* `subject` stands for the object in errors: "cloth", "objects[3]". The pinned are borrowed. */
msim_status ms_grid_make(const ms_object_type *type, const void *object, const char *subject,
                         ms_grid *grid, msim_error *err);
int32_t ms_grid_size(const ms_grid *grid);

/* In this order; what the grid borrows is not needed after the first. Where one fails, particles
 * may stay behind: the caller takes them back. */
msim_status ms_grid_add_particles(msim_scene *scene, ms_grid *grid, const char *subject,
                                  msim_error *err);
msim_status ms_grid_add_springs(msim_scene *scene, const ms_grid *grid, msim_error *err);

#endif
