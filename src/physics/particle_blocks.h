/* particle_blocks - what a force function adds to the matrix A = M - h D - h^2 J: a symmetric block
 * on the diagonal of each free particle
 *
 *   B = -sym(h df/dv + h^2 df/dx)
 * whose eigenvalues below -m/2 are raised to that, and for the clamped matrix those below 0: M + B
 * is positive definite, whatever the force. Blocks are stored as ms_coefficients.diagonal. */
#ifndef MS_PARTICLE_BLOCKS_H
#define MS_PARTICLE_BLOCKS_H

#include "physics/force.h"
#include "physics/force_function.h"

/* blocks: 6 first_pinned, from the last linearization of the force function */
void ms_particle_blocks_compute(const ms_model *model, double h, int clamp, double *blocks);

/* A third of the trace of the block of a row, kg */
static inline double ms_particle_blocks_mean(const ms_model *model, const double *blocks,
                                             int32_t row) {
  const size_t s = (size_t)model->unknowns.first_pinned, r = (size_t)row;
  return (blocks[r] + blocks[s + r] + blocks[2 * s + r]) / 3;
}

/* y += by B x, without the mean of each block if without_mean; returns by x.B x */
double ms_particle_blocks_apply(const ms_model *model, const double *blocks, int without_mean,
                                double by, ms_operands o);

#endif
