/* rank_order - the order of unknowns, half-edges and angular springs that a scene has in one
 * process, for a rank that computes a part of it: sums over the springs of a row then have the same
 * bits
 *
 * Rank 0 finds the order of the whole scene (whole_order.h), and sends each rank that of its rows.
 */
#ifndef MS_RANK_ORDER_H
#define MS_RANK_ORDER_H

#include "layout/adjacency.h"
#include "layout/rank_part.h"

typedef struct ms_rank_order {
  ms_whole_islands islands;
  int32_t *own;      /* the own particles, in the order of their unknowns */
  int32_t *place;    /* of each own unknown, in the order of one process */
  int32_t *position; /* of each half-edge of an own row in this row: those of the first spring, at
                        ij[0] before ij[1], of the second one, ... */
  uint8_t *is_split; /* of each own row: 1 if it is split (half_edges.h) */
  int32_t nangles;
  int32_t *angle_position; /* nangles: of each angular spring in its island (angles.h) */
} ms_rank_order;

/* Collective, with the same status on all ranks. Only rank 0 needs ij, pinned and angles of the
 * scene, and part->owner. whole: as ms_islands_create. Time and memory of rank 0 are those of the
 * layout of the whole scene. After an error the order may be there, and must be destroyed. */
msim_status ms_rank_order_create(const ms_scene *scene, const ms_rank_part *part, int whole,
                                 ms_rank_order *order, msim_error *err);
void ms_rank_order_destroy(const ms_scene *scene, ms_rank_order *order);

/* Sort the half-edges of the own rows of `island`, which has all springs of its unknowns, and mark
 * the rows that are split, as island->order has them. */
msim_status ms_rank_order_apply(const ms_scene *scene, const ms_island *island,
                                const ms_unknowns *rows, const ms_springs *springs, ms_adjacency *a,
                                msim_error *err);

#endif
