/* nonlinearity - the nonlinear part of the change of elastic energy in a step
 *
 *   U(x + s) - U(x) - grad U(x).s,  s = lambda h d, d a change of velocities.
 * It is summed from the nonlinear parts of single springs, without cancellation: a difference of
 * energies would be lost in rounding errors. */
#ifndef MS_NONLINEARITY_H
#define MS_NONLINEARITY_H

#include "physics/model.h"

/* d must be 0 on pinned rows, and ghosts of x and d current (halo.h); collective. work: scratch, a
 * vector. */
double ms_nonlinearity_compute(const ms_model *model, const double *x, double h, const double *d,
                               double lambda, double *work);

#endif
