/* whole_order - the order of unknowns, half-edges and angular springs of a scene in one process */
#ifndef MS_WHOLE_ORDER_H
#define MS_WHOLE_ORDER_H

#include "layout/rank_part.h"

typedef struct ms_whole_order {
  ms_whole_islands islands;
  int32_t *position; /* 2 nsprings: of the half-edge at ij[2e], ij[2e + 1] among those of its row */
  uint8_t *is_split; /* nparticles: 1 if the row is split (half_edges.h) */
  int32_t *angle_position; /* of each angular spring in its island (angles.h) */
} ms_whole_order;

/* whole: as ms_islands_create. Time and memory are those of the layout of the whole scene. */
msim_status ms_whole_order_create(const ms_scene *scene, int whole, ms_whole_order *order,
                                  msim_error *err);
void ms_whole_order_destroy(const ms_scene *scene, ms_whole_order *order);

#endif
