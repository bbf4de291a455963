/* history - what steps to come owe to steps made, beside x and v
 *
 *   warm       the method's note, and the vectors that it speaks of (integrator.h, `carried`): the
 *              last a, the state before, stages' coefficients
 *   h_before   of methods of two steps, and of Newmark's carried a
 *   held, a    of what rests on planes, under collision = event: who rests follows from x, v
 *   the last step, where somebody is to look inside: its start, h and what is known of its slopes
 *
 * All other vectors are written before they are read. */
#ifndef MS_HISTORY_H
#define MS_HISTORY_H

#include "base/bytes.h"
#include "integrate/integrator.h"

/* x and v with all that. Taken by a stepper that was just started. inside: 1, the last step too. */
void ms_stepper_history(ms_bytes *bytes, const ms_integrator *method, ms_stepper *s, int inside);

/* The vectors that a note of the method's speaks of; 0: of none. */
void ms_carried_history(ms_bytes *bytes, const ms_integrator *method, const ms_stepper *s,
                        int note);

#endif
