/* implicit_contact - impacts and contact in a step of an implicit method that does not resolve the
 * springs
 *
 * Where springs oscillate many times within a step, an impact involves more than one particle: the
 * particles connected to it push on. So impacts are not located. The method first makes its own
 * step, which is the result if no contact changes; but not implicit Euler, where the state at its
 * start predicts a change. Otherwise implicit Euler, which damps the vibrations that an impact
 * excites, makes the step anew, with velocities as unknowns and constraints on positions (Stewart
 * and Trinkle, Int. J. Numer. Meth. Eng. 39 (1996) 2673): along the normals n of its planes a
 * particle has a prescribed velocity during the step,
 *   n.v = -gap/h       it reaches the plane,
 *   n.v = -e n.v_n     it bounces, if this speed exceeds 2 h |g|,
 *   n.v = 0            it rests,
 * and the matrix contains these constraints. Friction is viscous in this step: -mu N v/w, with N
 * and the speed w = |v| of the previous solve, so that it dissipates energy for any N. A particle
 * that nearly stops sticks until more than mu N is necessary to hold it. The matrix enforces the
 * velocities by large weights, and in the end x and v along the normals are set to the prescribed
 * values, a correction of the size of rounding and the solver's tolerance: a larger one would add
 * energy to a stiff solid.
 *
 * The cost of a step is bounded. Two solves to a residual of a few percent determine the contact
 * set: a particle that ends behind a plane joins it, and one that its only plane would have to pull
 * leaves it. A third solve, to the full accuracy, is the step. Each solve starts from the solution
 * of the last one, and the reactions follow from its weights, so that three solves take about twice
 * the iterations of one. The first set contains the particles that, moved by h v + h^2 a, would end
 * in a solid; it follows from the state, and steps need not carry it. Particles that still end in
 * a solid after the third solve are moved out, unless that adds energy: then another solve includes
 * them.
 *
 * Energy: for a convex potential U implicit Euler with the normal forces J/h reduces it by the
 * work J g/h of planes in front of which the particle was by g >= 0. So a plane that is tangent to
 * a convex solid where the particle starts is safe, also if it pulls, where g = 0, and a particle
 * that joins after the first solve keeps its distance, n.v = 0. The particle then ends above the
 * solid by (h v)^2/(2 R). In solids inside out, planes touch where the last solve has led.
 * Velocities prescribed to many particles of a stiff solid may still do work on it, and
 * linearization stretches springs that turn. If the energy has grown, impacts are repeated without
 * restitution; if it has grown again, a linear method near solids makes the step in substeps, and
 * others make it with n.v = 0 at all distances, which does no work. The allowed energy includes the
 * work of pins, which implicit Euler moves before the other particles.
 *
 * With collision = reflect a linear method makes a rough solve and an accurate one, and particles
 * that still end inside are reflected. If energy less work has grown, the step is shortened
 * (step_energy.h), as by a line search of Newton's method from v' = 0, which is feasible. */
#ifndef MS_IMPLICIT_CONTACT_H
#define MS_IMPLICIT_CONTACT_H

#include "contact/contact_set.h"

/* Number of work vectors that ms_implicit_contact_step() needs: those of implicit Euler */
enum { MS_IMPLICIT_CONTACT_WORK = 6 };

/* One step of s->h by `method`. May change s->x and s->v, which ms_events_step() restores. */
msim_status ms_implicit_contact_step(const ms_integrator *method, ms_stepper *s, msim_error *err);

#endif
