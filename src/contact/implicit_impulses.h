/* implicit_impulses - reactions and impulses of the solves of implicit_contact.h
 *
 * A solve leads from the prescribed velocities u to v, and places particles on planes afterwards:
 *   J/m = (u - v_start) + r + (v_next - v),
 * with the reaction r of the solve, v - u - h F/m of implicit Euler, F at its end. In a linear step
 * r is what the last force sweep has added, h times, what the weights of the matrix add, -W sum n
 * n.dv/m, and its viscous friction, -friction (v - sum n n.v)/m. */
#ifndef MS_IMPLICIT_IMPULSES_H
#define MS_IMPLICIT_IMPULSES_H

#include "contact/contact_set.h"

/* The free acceleration that the reaction of contact i cancels: that which the last force sweep has
 * cancelled, and of a linear step what the weights of the matrix add. */
void ms_implicit_impulses_find_reaction(const ms_stepper *s, int32_t i, int is_linear, double a[3]);

/* Keeps v and J/m but for its last part of the solve just made, where contacts are recorded, and in
 * linear steps also where solids move. */
void ms_implicit_impulses_keep(ms_stepper *s, const double *v_start, int is_linear);

/* Adds the impulses of the last solve, with what particles were corrected by since, to the contact
 * log. */
void ms_implicit_impulses_add(const ms_stepper *s);

/* The work of moving solids by these impulses of a linear step, along their mean velocity, J */
double ms_implicit_impulses_find_work(const ms_stepper *s);

#endif
