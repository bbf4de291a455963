/* contact_bodies - groups of bodies in contact, whose common momentum contact does not change
 *
 * A body is a connected component of the springs. Forces of contact have the sum 0 over bodies that
 * touch each other, and those of springs over each body, so that on a group that nothing else holds
 * the translation 1 satisfies 1.A d = 1.W d = 0, W = M + h drag (momentum.h). */
#ifndef MS_CONTACT_BODIES_H
#define MS_CONTACT_BODIES_H

#include "contact/surface_pairs.h"
#include "linear/momentum.h"

typedef struct ms_contact_bodies {
  ms_momentum_components body; /* those without pinned particles */
  int32_t *parent;             /* body.n + 1: of each body, or itself; the last: what is held */
  int8_t *touches;             /* body.n + 1: of groups: 1: bodies in it were joined */
  double *sum;                 /* 4 (body.n + 1): W, and W d, of groups */
} ms_contact_bodies;

/* On failure the caller destroys what is there. */
msim_status ms_contact_bodies_create(const ms_model *model, ms_contact_bodies *bodies,
                                     msim_error *err);
void ms_contact_bodies_destroy(const ms_model *model, ms_contact_bodies *bodies);

/* Each body is a group. */
void ms_contact_bodies_separate(ms_contact_bodies *bodies);

/* The bodies of two unknowns touch, or the one of both itself; -1: a particle that is held. */
void ms_contact_bodies_join(ms_contact_bodies *bodies, int32_t row, int32_t other);

/* Subtract from d, in each group that nothing holds, its mean weighted with W = M + drag. */
void ms_contact_bodies_balance(ms_contact_bodies *bodies, const ms_model *model, double drag,
                               double *d);

/* In groups of bodies that touch, d = (d + mean)/2, with the mean weighted with M, and only what of
 * it is along the planes that hold nodes of the group, where is_active; 0 in place of the mean in
 * the group that is held. plane: one per node of the surface, or NULL */
void ms_contact_bodies_halve(ms_contact_bodies *bodies, const ms_model *model,
                             const ms_contact_surface *surface, const ms_surface_pair *plane,
                             double *d);

#endif
