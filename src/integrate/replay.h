/* replay - impacts and contact in a step of velocity Verlet, under collision = event
 *
 * Each particle near a plane follows a path of its own (physics/path.h), first with the
 * acceleration at the start of the step, which gives its position at the end; then, once the
 * acceleration there is known, through the same impacts at the same times for its velocity. One
 * evaluation of forces a step, whatever happens in it; of order 2, for any number of impacts. */
#ifndef MS_REPLAY_H
#define MS_REPLAY_H

#include "integrate/contacts.h"

/* Corrects x_next = x + h v + h^2/2 a and v_predicted = v + h a near planes. */
void ms_replay_positions(ms_stepper *s, const double *a, double *v_predicted);

/* Corrects v_next = v + h/2 (a + a_next) of the same particles. */
void ms_replay_velocities(ms_stepper *s, const double *a, const double *a_next);

#endif
