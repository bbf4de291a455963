/* rank_gather - the arrays of a scene of which each rank has a slice, on one rank or on all */
#ifndef MS_RANK_GATHER_H
#define MS_RANK_GATHER_H

#include "base/ranks.h"
#include "sim/rank_scene.h"

enum { MS_ALL_RANKS = -1, MS_MOST_FIELDS = 10 };

/* An array of a scene */
typedef enum ms_element { MS_PARTICLES, MS_SPRINGS, MS_FACES } ms_element;
typedef struct ms_field {
  ms_element of;
  size_t size; /* bytes an element */
  void *data;
  int has_numbers; /* of particles */
} ms_field;

/* The same ones for a slice and the whole scene; returns their number. */
int ms_rank_gather_list(const ms_scene *scene, ms_field fields[MS_MOST_FIELDS]);

/* The sections of an array of all ranks, to all of them or to one. scratch: room for the ends of
 * own springs or faces; a failure of the communicator is kept for the next agreement. */
void ms_rank_gather_field(ms_ranks *ranks, const ms_rank_scene *kept, int32_t root,
                          const ms_field *field, int32_t *scratch, void *all);

/* Of all fields, to a scene that has the counts of the whole one, and on `root` room for
 * them, if `fits`. Collective */
msim_status ms_rank_gather_fields(ms_ranks *ranks, const ms_rank_scene *kept, int32_t root,
                                  ms_scene *to, int fits, msim_error *err);

#endif
