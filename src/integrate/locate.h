/* locate - a step of an explicit method with its impacts located inside, under collision = event
 *
 * The step is made. The distance of each particle from each plane is then a polynomial: the
 * method's dense output, or Hermite's quintic, of x, v and a at both ends, where his cubic comes
 * near the plane. Its Bernstein coefficients tell the first impact, however short (bernstein.h).
 * The step is cut there, all particles that touch a plane bounce at once, and the rest of the step
 * is made from there: the order of the method is kept.
 * After MS_MAX_CUTS cuts each particle with an impact goes on along a path of its own (path.h),
 * which is of order 2.
 *
 * What rests or slides on planes is held there in each evaluation (contacts.h). Where it stops,
 * begins to slip, turns sharply, or is lifted in a part of the step, that part is replaced by the
 * particle's own path. */
#ifndef MS_LOCATE_H
#define MS_LOCATE_H

#include "integrate/contacts.h"

enum { MS_FEW_CUTS = 8, MS_MAX_CUTS = 64 };

/* One step of the method, as ms_step (events.h) */
msim_status ms_locate_step(const ms_integrator *method, ms_stepper *s, msim_error *err);

/* The longest step that is cut at impacts, so that the method keeps its order p; of methods with p
 * = 2 none is. omega: a bound on frequencies (1/s) */
double ms_locate_longest(const ms_integrator *method, double omega);

#endif
