/* solid_contact - contact with solids in the steps of implicit_contact.h
 *
 * The condition of a solve is a plane: on a solid that curves outwards the one that touches it
 * where the particle starts or enters, which no solid of this kind crosses. In a solid inside out,
 * and on samples, the particle is to end on the surface: the plane touches where the last solve has
 * led, so that the iteration converges to implicit Euler's step on the surface, which does not
 * increase the energy, and in the end the position is moved onto the surface exactly.
 *
 * Solids that move are where they are at the end of the step, and the displacement of a particle is
 * counted from where the point of the solid at its start has moved. */
#ifndef MS_SOLID_CONTACT_H
#define MS_SOLID_CONTACT_H

#include "contact/contact_set.h"

/* Places solids that move at the end of the step, and the tangent planes of all contacts. */
void ms_solid_contact_move_to_end(ms_stepper *s);

/* displacement += that of the point x of solid i in the step; 0 if the solid rests */
void ms_solid_contact_add_displacement(const ms_stepper *s, int32_t i, const double x[3],
                                       double displacement[3]);

/* Sets the frame of a contact for a step with prescribed velocities: its displacement in the step,
 * and its velocity at the end, which friction and bounces are relative to. */
void ms_solid_contact_set_frame(const ms_stepper *s, ms_contact *c);

/* 1: a solid of a contact, of any rank, may move. Collective */
int ms_solid_contact_any_moves(const ms_stepper *s);

/* The work of moving solids in the step just made, J: of the impulses that changed velocities from
 * v_start, beside those of forces, along the mean velocity of the surfaces. Sets the free
 * accelerations at the end, a_end of the contact set. Collective; each rank has its own part. */
double ms_solid_contact_find_work(ms_stepper *s, const double *v_start);

/* 1: the path of an unknown from s->x to s->x_next meets solid i; c: its contact, or NULL. `at`:
 * the tangent plane at the point of the surface nearest to it stops the unknown. */
int ms_solid_contact_meets(const ms_stepper *s, int32_t row, const ms_contact *c, int32_t i,
                           double at[3]);

/* 1: a plane of the contact, nullable, is tangent to solid i. */
int ms_solid_contact_contains(const ms_stepper *s, const ms_contact *c, int32_t i);

/* 1: s->x_next is off the surfaces by more than a small part of its displacement, but not beyond an
 * edge. */
int ms_solid_contact_is_off(const ms_stepper *s, const ms_contact *c);

/* Sets the tangent planes of a contact to those near x. */
void ms_solid_contact_set_tangents(const ms_stepper *s, const ms_contact *c, const double x[3]);

/* 1: a plane of the contact is tangent to a solid that may curve towards the particle: inside out,
 * or with samples. */
int ms_solid_contact_may_be_concave(const ms_stepper *s, const ms_contact *c);

/* Moves particles in contact onto the surfaces, to the last bit, in s->x_next, and turns s->v_next;
 * those that bounce or keep their distances, only out of solids. Where that is impossible they stay
 * where they were, at rest. Returns 1 if x_next has changed. */
int ms_solid_contact_finish(ms_stepper *s, int keeps_distance);

#endif
