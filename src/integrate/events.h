/* events - a step of any method with impacts and contact inside, under collision = event
 *
 *   velocity Verlet follows the path of each particle by itself (replay.h);
 *   explicit methods, and implicit ones whose step resolves the springs, h omega <= 2, locate
 *   impacts or follow paths (locate.h);
 *   implicit methods with springs that are stiff for the step are constrained (constrain.h). */
#ifndef MS_EVENTS_H
#define MS_EVENTS_H

#include "integrate/integrator.h"

/* One step of the method, as its own step(), for any option `collision`. A step made in parts
 * leaves s->warm = 0: what the method carried over is gone, also where the step failed. */
msim_status ms_step(const ms_integrator *method, ms_stepper *s, msim_error *err);

#endif
