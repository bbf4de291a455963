/* shortened_step - ends a step at an impact by dense output, instead of making it anew, under
 * collision = event */
#ifndef MS_SHORTENED_STEP_H
#define MS_SHORTENED_STEP_H

#include "contact/contact_set.h"

/* x_next, v_next = the dense output at that share of the step just made, which multiplies s->h. */
void ms_shortened_step_interpolate(const ms_integrator *method, ms_stepper *s, double share);

/* Under error control, for the step just made by a method with dense output (`path`): 1 if that
 * shows the state at any of its times, which may be those of impacts in other islands. Particles
 * that followed paths of their own have none. */
int ms_shortened_step_is_possible(const ms_stepper *s);

/* Ends that step at this share of its length; 1: where it ends. Dense output remains that of the
 * whole step. */
void ms_shortened_step_end(const ms_integrator *method, ms_stepper *s, double share);

#endif
