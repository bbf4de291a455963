/* contact_joining - particles that join the contact set in a step of implicit_contact.h */
#ifndef MS_CONTACT_JOINING_H
#define MS_CONTACT_JOINING_H

#include "contact/contact_set.h"

/* 1: at the end of the step, s->x_next, the unknown is behind a plane, or has met a solid, that its
 * contact c, nullable, does not have. */
int ms_contact_joining_is_new(const ms_stepper *s, int32_t row, const ms_contact *c);

/* 1: that is so of some unknown of any rank. Collective */
int ms_contact_joining_any_is_new(const ms_stepper *s);

/* Adds particles that end behind planes or meet solids to the contact set, sorted by row; keeps:
 * they keep their distances. Returns the number of contacts of this rank that are new or have new
 * planes. Collective */
int32_t ms_contact_joining_add_penetrating(ms_stepper *s, int keeps);

/* Predicts which particles near solids will be in contact; the solves remove those that springs
 * hold back. Particles that slide along a solid end above it, on the plane that touches it where
 * they started, and so are found here. Returns the number of impacts, of all ranks. Collective */
int64_t ms_contact_joining_add_predicted(ms_stepper *s);

#endif
