/* events - a step of any method with its impacts located inside, under collision = event
 *
 * The step is made. Over it the distance of each particle from each plane is Hermite's cubic, whose
 * values and slopes at both ends are known; that tells which impact comes first, also one that is
 * over before the step is. It is located to rounding on the method itself, by steps of other
 * lengths from the same state. There the particle bounces, and the rest of the step is made from
 * there: the order of the method is kept. In the same way are located: the stop of a particle that
 * slides, its start, and its release.
 *
 * Where more than MS_FEW of that happen in a step, or after MS_MOST_PARTS parts, each particle is
 * treated for itself on Hermite's cubic, and nothing is made anew: a velocity changed by an impact
 * moves the particle further by that change times the time left, and the forces are left as they
 * are. That is of second order, whatever the method.
 *
 * Springs that are stiff for the step, h omega > 2 under an implicit method, bear no such thing: a
 * layer that stops alone while the solid above flies on would take in more energy than there is.
 * There the crowd shares its parts: impacts a thousandth of a step apart are one, contacts end
 * between steps only, and who still runs into a plane after MS_MOST_PARTS is held above it for the
 * rest of the step, without a bounce. Between parts the springs relax, so that a stiff solid comes
 * to rest within a step or two. */
#ifndef MS_EVENTS_H
#define MS_EVENTS_H

#include "integrate/contacts.h"

enum { MS_FEW = 4, MS_MOST_PARTS = 16 };

/* One step of the method, as its own step(), for any option `collision`. A step that was made in
 * parts leaves s->warm = 0: what the method carried over is gone, also where the step failed. */
msim_status ms_step(const ms_integrator *method, ms_stepper *s, msim_error *err);

#endif
