/* islands - splits a scene into islands: no spring connects particles of different ones
 *
 * Free particles joined by a spring, also an angular one, belong to one connected component. A
 * pinned particle connects nothing: it belongs to each island that has a spring to it. The free
 * particles without springs count as one component. Components below MS_MIN_ISLAND particles would
 * cost more on their own than they save: they are collected, in the order of their first particles,
 * into islands of at least that size; a remainder too small for another island joins the last of
 * these.
 *
 * Islands are numbered by their first particle; they follow from the scene's springs and pins. */
#ifndef MS_ISLANDS_H
#define MS_ISLANDS_H

#include "base/buckets.h"
#include "scene/scene.h"

enum { MS_MIN_ISLAND = 512 };

struct ms_rank_order;

/* The contents of an island, by their numbers in the scene, each list ascending. */
typedef struct ms_island {
  int32_t nfree, npinned, nsprings, nangles;
  const int32_t *free, *pinned; /* particles */
  const int32_t *spring;        /* springs with a free end */
  const int32_t *angle;         /* angular springs with a free corner */
  int32_t *row_scratch;         /* for each particle of the scene: scratch of ms_springs_create */
  /* A rank's part of the scene (rank_part.h); else 0 and NULL */
  int32_t nghosts;                   /* the first `pinned`: unknowns of other ranks */
  const struct ms_rank_order *order; /* of `free`, which are not ascending, and of half-edges */
} ms_island;

typedef struct ms_islands {
  int32_t n; /* >= 1; a scene without free particles has one, which is empty */
  ms_buckets free, pinned, springs, angles;
  int32_t *row_scratch; /* nparticles */
  int32_t nghosts;      /* as in ms_island */
  const struct ms_rank_order *order;
} ms_islands;

/* whole: 1 for a single island, whatever the springs connect. */
msim_status ms_islands_create(const ms_scene *scene, int whole, ms_islands *islands,
                              msim_error *err);
void ms_islands_destroy(const ms_scene *scene, ms_islands *islands);

ms_island ms_islands_get(const ms_islands *islands, int32_t i);

#endif
