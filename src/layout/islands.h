/* islands - the parts of a scene that no spring connects: systems of their own
 *
 * Two free particles that share a spring are of one island. A pinned particle connects nothing: it
 * is of every island whose springs touch it. The free particles that no spring touches count as one
 * connected part. Parts below MS_LEAST_ISLAND particles would cost more alone than they save: those
 * are taken together in the order of their first particles until there are as many; what is left
 * then joins the last such island.
 *
 * Islands are numbered by their first particle. They follow from the scene's springs and pins. */
#ifndef MS_ISLANDS_H
#define MS_ISLANDS_H

#include "scene/scene.h"

enum { MS_LEAST_ISLAND = 512 };

/* What belongs to an island, by numbers of the scene, ascending each. */
typedef struct ms_island {
  int32_t nfree, npinned, nsprings;
  const int32_t *free, *pinned; /* particles */
  const int32_t *spring;        /* those that can push a free particle */
  int32_t *row;                 /* of each particle of the scene: scratch of who lays them out */
} ms_island;

/* Things by where they belong: those of b are item[first[b]] ... item[first[b + 1] - 1]. */
typedef struct ms_buckets {
  int32_t *first, *item;
} ms_buckets;

typedef struct ms_islands {
  int32_t n; /* at least 1, which may be empty */
  ms_buckets free, pinned, springs;
  int32_t *row; /* nparticles */
} ms_islands;

/* whole: 1 for a single island, whatever the springs connect. */
msim_status ms_islands_create(const ms_scene *scene, int whole, ms_islands *islands,
                              msim_error *err);
void ms_islands_destroy(const ms_scene *scene, ms_islands *islands);

ms_island ms_island_at(const ms_islands *islands, int32_t i);

#endif
