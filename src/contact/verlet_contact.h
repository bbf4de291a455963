/* verlet_contact - impacts and contact in a step of velocity Verlet (collision = event)
 *
 * Each particle near a plane follows a path of its own (contact/particle_path.h): first with the
 * acceleration at the start of the step, which gives its position at the end; then, with the
 * acceleration there, through the same impacts at the same times, which gives its velocity. This
 * takes one force evaluation a step and is of order 2, for any number of impacts. */
#ifndef MS_VERLET_CONTACT_H
#define MS_VERLET_CONTACT_H

#include "contact/contact_set.h"

/* Corrects x_next = x + h v + h^2/2 a and v_predicted = v + h a of particles near planes. Does
 * nothing unless e->method_handles_contact is set. */
void ms_verlet_contact_correct_positions(ms_stepper *s, const double *a, double *v_predicted);

/* Corrects v_next = v + h/2 (a + a_next) of the same particles. */
void ms_verlet_contact_correct_velocities(ms_stepper *s, const double *a, const double *a_next);

#endif
