/* whole_order - the order of unknowns, half-edges and angular springs that a scene has in one
 * process, for a rank that computes a part of it: sums over the springs of a row then have the same
 * bits */
#ifndef MS_WHOLE_ORDER_H
#define MS_WHOLE_ORDER_H

#include "layout/adjacency.h"
#include "layout/rank_part.h"

typedef struct ms_whole_order {
  ms_whole_islands islands;
  int32_t *position; /* 2 nsprings: of the half-edge at ij[2e], ij[2e + 1] among those of its row */
  uint8_t *is_split; /* nparticles: 1 if the row is split (half_edges.h) */
  int32_t nangles;
  int32_t *angle_position; /* nangles: of each angular spring in its island (angles.h) */
} ms_whole_order;

/* whole: as ms_islands_create. Time and memory are those of the layout of the whole scene. */
msim_status ms_whole_order_create(const ms_scene *scene, int whole, ms_whole_order *order,
                                  msim_error *err);
void ms_whole_order_destroy(const ms_scene *scene, ms_whole_order *order);

/* Sort the half-edges of the part `island`, which has all springs of its unknowns, and mark the
 * rows that are split, as island->order has them. */
msim_status ms_whole_order_apply(const ms_scene *scene, const ms_island *island,
                                 const ms_unknowns *rows, const ms_springs *springs,
                                 ms_adjacency *a, msim_error *err);

#endif
