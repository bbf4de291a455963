/* excess - what a step takes springs beyond the linear part of their energy
 *
 *   U(x + s) - U(x) - grad U(x).s,  s = lambda h d, d a change of velocities.
 * Each spring adds a number of the size of its own excess, so that the sum is accurate where a
 * difference of energies would drown in rounding. */
#ifndef MS_EXCESS_H
#define MS_EXCESS_H

#include "physics/model.h"

/* Pinned rows of d are 0. work: scratch, a vector of the model's rows. */
double ms_excess(const ms_model *model, const double *x, double h, const double *d, double lambda,
                 double *work);

#endif
