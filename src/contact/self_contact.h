/* self_contact - keeps surfaces from passing through each other and themselves in a step
 *
 * A step leads from x0, where no two features of the surface touch, to x1 on straight lines. Three
 * stages correct x1 and the velocity v at the end:
 *   1. Each pair of features (a point and a triangle, or two edges) that is close at x0, or
 *      collides on its path, gets a plane: the normal n and the weights w of its closest points at
 *      x0, or where it collides. Sweeps over these pairs move the corners apart until
 *      sum_c w_c n.x1_c is the thickness, or the distance at x0 if that is less: by impulses
 *      J w_c n, whose sum is 0, and Coulomb's friction, at most mu J, against the tangential motion
 *      (Bridson, Fedkiw and Anderson, ACM Trans. Graph. 21 (2002) 594). Impulses without
 *      restitution act on v where it points inwards, and reduce the kinetic energy. In implicit
 *      methods the springs take part (contact_projection.h), as sweeps would stretch stiff ones.
 *   2. What still collides after a fixed number of rounds stays at x0, at rest, and so do those
 *      that collide with it then, until none does. As x0 is free of collisions this ends, and by
 *      induction no step passes through a surface.
 *   3. If the energy has grown by the correction, the displacements and the velocities of bodies
 *      that touch are halved until it has not, again without collisions: around those of their
 *      centre of mass (contact_bodies.h), or, where pins or obstacles hold them, around no motion.
 * Particles are reflected at obstacles in between; those that stay are where they were before. */
#ifndef MS_SELF_CONTACT_H
#define MS_SELF_CONTACT_H

#include "integrate/integrator.h"

typedef struct ms_self_contact ms_self_contact;

/* For a model of the whole scene, whose self-contact has a thickness. On failure the caller
 * destroys what is there. */
msim_status ms_self_contact_create(const ms_integrator *method, const ms_model *model,
                                   ms_self_contact **contact, msim_error *err);
void ms_self_contact_destroy(const ms_model *model, ms_self_contact *contact);

/* MSIM_ERR_ARG if surfaces touch or intersect at x (3 nparticles). */
msim_status ms_self_contact_check(ms_self_contact *contact, int32_t nparticles, const double *x,
                                  msim_error *err);

/* Correct the end of the step just made. MSIM_NOT_CONVERGED: pinned particles that move force a
 * surface through another one. May allocate. */
msim_status ms_self_contact_correct(ms_self_contact *contact, ms_stepper *s, msim_error *err);

#endif
