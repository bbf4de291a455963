/* events - one step of any method, with its impacts and contacts (collision = event, and reflect in
 * implicit methods)
 *
 *   velocity Verlet follows the path of each particle itself (verlet_contact.h);
 *   explicit methods, and implicit ones whose step resolves the springs, h omega <= 2, locate
 *   impacts or follow particle paths (impact_location.h);
 *   implicit methods with h omega > 2 constrain velocities (implicit_contact.h), also with
 *   collision = reflect where there are colliders or self-contact; among planes alone reflection is
 *   the method of Teschner's exercises. */
#ifndef MS_EVENTS_H
#define MS_EVENTS_H

#include "integrate/integrator.h"

/* One step of the method, as its own step(), for any option `collision`. A step made in substeps
 * leaves s->cached_stage = 0, also if it failed, as cached stages are overwritten. */
msim_status ms_events_step(const ms_integrator *method, ms_stepper *s, msim_error *err);

#endif
