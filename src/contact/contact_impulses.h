/* contact_impulses - the impulses of planes and colliders on particles in a step of collision =
 * event, for the contact log (contact_log.h)
 *
 * An impact changes the velocity by the impulse over the mass. A contact that lasts from t to t + h
 * exerts what the forces F without it leave of the change of velocity,
 *   J/m = v(t + h) - v(t) - h (a(t) + a(t + h))/2,  a = F/m,
 * with the integral of F by the trapezoidal rule, whose error is of order h^3; for explicit methods
 * of order 1 by a(t), and for implicit ones by a(t + h), as they do. */
#ifndef MS_CONTACT_IMPULSES_H
#define MS_CONTACT_IMPULSES_H

#include "contact/contact_set.h"

/* Adds the change of a velocity from `from` to `to` by the planes `on`, at x, to the log, if there
 * is one. */
void ms_contact_impulses_add(const ms_stepper *s, int32_t row, const ms_plane_set *on,
                             const double x[3], const double from[3], const double to[3]);

/* The same of a path that began with the velocity v */
void ms_contact_impulses_add_path(const ms_stepper *s, int32_t row, const ms_particle_path *p,
                                  const double v[3]);

/* The same of all contacts in a substep by `method` from the velocities v_start, with free
 * accelerations a and a_end, but those of particles that followed paths of their own */
void ms_contact_impulses_add_lasting(const ms_integrator *method, const ms_stepper *s,
                                     const double *v_start);

#endif
