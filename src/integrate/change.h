/* change - where a contact ends in a part of a step, or becomes one of another kind */
#ifndef MS_CHANGE_H
#define MS_CHANGE_H

#include "integrate/contacts.h"

/* Sets c->change by the part just made, from s->x, s->v with the free accelerations a
 * and a_end. */
void ms_contact_judge(const ms_stepper *s, ms_contact *c);

#endif
