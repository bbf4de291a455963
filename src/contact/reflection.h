/* reflection - reflects particles that a step has left behind planes or in colliders (collision =
 * reflect) */
#ifndef MS_REFLECTION_H
#define MS_REFLECTION_H

#include "contact/contact_log.h"

/* For each unknown, at all planes one after the other:
 *   s = n.x - d; if s < 0:  x -= (1 + e) s n, and if also n.v < 0:
 *   J = -(1 + e) n.v,  v += J n,  tangential part of v times max(0, 1 - mu J/|v_t|).
 * e = 1, mu = 0 is the method of Teschner's exercises. A particle that already moves away from the
 * plane keeps its velocity. If it is still behind a plane, between planes closer than its
 * displacement or in a corner, this is repeated, up to 64 times in all; then it is moved to the
 * nearest point in front of all planes, with an impact there.
 *
 * Then the same at colliders, each replaced by the plane that touches it at its point nearest to x,
 * which moves with the velocity u of that point: v - u is reflected, and the impulse m J does the
 * work m J.u, which is added to *work (J). solids: the colliders at the end of the step.
 * If particles cannot be moved in front of all planes and out of all colliders, they stay where
 * they were before the step, in `from`, at rest.
 * Returns the number of particles reflected. log: records their impulses (nullable). */
int64_t ms_reflection_apply(const ms_model *model, const ms_solid *solids, const double *from,
                            ms_contact_log *log, double *x, double *v, double *work);

/* MSIM_ERR_ARG if each point of space is behind some plane. */
msim_status ms_reflection_check(const ms_scene *scene, msim_error *err);

#endif
