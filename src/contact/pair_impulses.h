/* pair_impulses - sweeps over pairs of features that push these apart, one after the other
 *
 * The planes of pairs (surface_pairs.h) move the corners by impulses J w_c n, whose sum is 0, and
 * by Coulomb's friction, at most mu J, against the tangential motion. */
#ifndef MS_PAIR_IMPULSES_H
#define MS_PAIR_IMPULSES_H

#include "contact/surface_pairs.h"

/* One sweep over the planes of all pairs; returns the number of pairs that had to push. x0, x1: 3
 * nnodes, the positions at the start and the end of the step */
int64_t ms_pair_impulses_push_positions(ms_surface_pairs *pairs, double friction, const double *x0,
                                        double *x1);

/* The same for the velocities v of pairs that were pushed in this step and move towards each other:
 * without restitution. *work += the work of pinned corners that move, J */
int64_t ms_pair_impulses_push_velocities(ms_surface_pairs *pairs, double friction, double *v,
                                         double *work);

int64_t ms_pair_impulses_count(const ms_surface_pairs *pairs);

#endif
