/* planes - reflection of a predicted state at half spaces */
#ifndef MS_PLANES_H
#define MS_PLANES_H

#include "physics/model.h"

/* For each unknown, planes in their order, each sees what the one before left, one pass:
 *   s = n.x - d; if s < 0:  x -= (1 + e) s n, and if also n.v < 0:
 *   J = -(1 + e) n.v,  v += J n,  tangential part of v times max(0, 1 - mu J/|v_t|).
 * e = 1, mu = 0 is Teschner's. A particle that leaves already is not pushed back in. Where one pass
 * leaves it behind a plane, between planes closer than its way or in a corner, passes go on, and
 * after some tens of them it is put on the nearest point that is behind none.
 * Returns the number of particles reflected. */
int64_t ms_planes_reflect(const ms_model *model, double *x, double *v);

/* Refuses planes of which every point is behind one. */
msim_status ms_planes_check(const ms_scene *scene, msim_error *err);

#endif
