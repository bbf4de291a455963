/* contact_change - when in a substep a contact changes: the particle is lifted, slips, stops, turns
 */
#ifndef MS_CONTACT_CHANGE_H
#define MS_CONTACT_CHANGE_H

#include "contact/contact_set.h"

/* Puts particles in contact on their planes (ms_contact_set_place), computes the free accelerations
 * a_end, and sets `change` of each contact. Without contacts it does nothing. */
void ms_contact_change_finish_substep(ms_stepper *s);

/* 1: a sliding particle of this rank would stop in the substep to be made, as with constant free
 * accelerations */
int ms_contact_change_any_stops(const ms_stepper *s);

#endif
