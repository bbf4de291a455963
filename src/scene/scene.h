/* scene - what there is: flat arrays in particle order, validated on entry, shared by sims.
 *
 * A handle (msim_scene) points to counted data. A sim takes a reference to the data; the first
 * setter that finds the data shared makes its own copy. Data that is shared never changes. */
#ifndef MS_SCENE_H
#define MS_SCENE_H

#include <stdatomic.h>

#include "base/text.h"

typedef struct ms_run_entry {
  char *name, *value; /* as msim_options_set takes them */
} ms_run_entry;

typedef struct ms_scene {
  msim_allocator alloc;
  atomic_int references;
  char *name;   /* never NULL */
  char *source; /* the file's text; NULL once the scene differs from it */

  int32_t nparticles, particle_capacity;
  double *x, *v, *mass; /* 3n, 3n, n */
  uint8_t *pinned;      /* n */

  int32_t nsprings, spring_capacity;
  int32_t *ij; /* 2 nsprings */
  double *k, *rest, *damping;

  int32_t nplanes, plane_capacity;
  msim_plane *planes;

  int32_t nrun, run_capacity;
  ms_run_entry *run;

  double gravity[3], drag;
} ms_scene;

struct msim_scene {
  ms_scene *data;
};

ms_scene *ms_scene_share(ms_scene *scene); /* one more reference */
void ms_scene_release(ms_scene *scene);    /* one less; accepts NULL */

/* The handle's data for writing: alone, and no longer what the file said. NULL: no memory. */
ms_scene *ms_scene_writable(msim_scene *scene, msim_error *err);

/* Remember a default for the command line; checked by msim_options_set. */
msim_status ms_scene_add_run(msim_scene *scene, const char *name, const char *value,
                             msim_error *err);

/* The scene as a scene file: the text it was read from where that still holds. */
msim_status ms_scene_to_json(const ms_scene *scene, ms_text *text, msim_error *err);

/* 1: it is UTF-8, 0: it is not, -1: there is no memory to know. */
int ms_is_utf8(const char *text);

/* Refuse a scene that no file can hold. */
msim_status ms_scene_check_file(const ms_scene *scene, msim_error *err);

/* What a scene file leaves out: of numbers that are the same to the bit all but one, and those that
 * are 0, as by default; -0 is not 0. */
int ms_all_equal(int64_t count, const double *numbers);
int ms_all_zero(int64_t count, const double *numbers);

#endif
