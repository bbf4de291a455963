/* implicit_contact - impacts and contact in a step of an implicit method that does not resolve the
 * springs
 *
 * Where springs oscillate many times within a step, an impact involves more than one particle: the
 * particles connected to it push on. So impacts are not located. The method first makes its own
 * step, which is the result if no contact changes. Otherwise implicit Euler, which damps the
 * vibrations that an impact excites, makes the step anew, with velocities as unknowns and
 * constraints on positions (Stewart and Trinkle, Int. J. Numer. Meth. Eng. 39 (1996) 2673): along
 * the normals n of its planes a particle has a prescribed velocity during the step,
 *   n.v = -gap/h       it reaches the plane,
 *   n.v = -e n.v_n     it bounces, if this speed exceeds 2 h |g|,
 *   n.v = 0            it rests,
 * and the matrix contains these constraints. Friction is viscous in this step: -mu N v/w, with N
 * and the speed w = |v| of the previous solve, so that it dissipates energy for any N. A particle
 * that nearly stops sticks until more than mu N is necessary to hold it. A particle that ends
 * behind a plane joins the contact set, one that its only plane would have to pull leaves it, and
 * the step is solved again until nothing changes. In stiff solids, more than four solves change
 * only which few particles stick: from the fourth on particles only join, until none is behind a
 * plane. The matrix enforces the velocities by large weights, and in the end x and v along the
 * normals are set to the prescribed values, a correction of the size of rounding and the solver's
 * tolerance: a larger one would add energy to a stiff solid.
 *
 * Velocities prescribed to many particles of a stiff solid do work on it. If the energy has grown,
 * impacts are repeated without restitution; if it has grown again, planes have pulled, and the step
 * is made with n.v = 0 at all distances, which does no work. The first attempt for
 * linearly-implicit-euler uses this method's own steps, of one solve each. */
#ifndef MS_IMPLICIT_CONTACT_H
#define MS_IMPLICIT_CONTACT_H

#include "contact/contact_set.h"

/* Number of work vectors that ms_implicit_contact_step() needs: those of implicit Euler */
enum { MS_IMPLICIT_CONTACT_WORK = 6 };

/* One step of s->h by `method`. May change s->x and s->v, which ms_events_step() restores. */
msim_status ms_implicit_contact_step(const ms_integrator *method, ms_stepper *s, msim_error *err);

#endif
