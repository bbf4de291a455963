/* contact_curvature - contacts at rest as constraints of the stiffness matrix
 *
 * With the constraints s_i(x) >= 0, s_i the distances from obstacles, and the reactions N_i the
 * matrix of a small motion along the obstacles is the Hessian of the Lagrangian,
 *   K - sum N_i d^2 s_i/dx^2
 * (Nocedal and Wright, Numerical Optimization, 2006, 12.5): a particle on a ball of radius R,
 * pressed by N, is unstable with the stiffness -N/R, and in a bowl stable with N/R. */
#ifndef MS_CONTACT_CURVATURE_H
#define MS_CONTACT_CURVATURE_H

#include "contact/contact_set.h"

/* Finds the contacts of particles at rest in s->x: without friction none sticks. May let s->x and
 * s->v point to copies (ms_contact_set_make_writable). */
void ms_contact_curvature_update(ms_stepper *s);

/* Sets the constraints of the contact set, nullable, and adds them to a linear system. least: the
 * least stiffness by curvature, which replaces smaller ones. Returns 0 if they are not all: without
 * springs, or where particles touch samples, which bend at their edges only. */
int ms_contact_curvature_constrain(ms_stepper *s, double least, ms_linear_system_spec *spec);

#endif
