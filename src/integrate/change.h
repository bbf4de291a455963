/* change - where a contact ends in a part of a step, or becomes one of another kind */
#ifndef MS_CHANGE_H
#define MS_CHANGE_H

#include "integrate/contacts.h"

/* The share of the part just made, from s->x, s->v with the free accelerations a and a_end, after
 * which the particle is lifted, begins to slip, or stops; MS_NOWHERE: nothing of that. */
double ms_contact_change(const ms_stepper *s, const ms_contact *c);

/* Any of that, or it turns: */
int ms_contact_changes(const ms_stepper *s, const ms_contact *c);

/* It slides, and its direction changes by more than 45 degrees in the part, or is stiff there. */
int ms_contact_turns(const ms_stepper *s, const ms_contact *c);

#endif
