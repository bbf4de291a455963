/* damping_kernels - the products with the damping derivative (damping_derivative.h), one table for
 * each instruction set. None fuses multiply-add: their bits are the same. */
#ifndef MS_DAMPING_KERNELS_H
#define MS_DAMPING_KERNELS_H

#include "base/isa.h"
#include "physics/damping_derivative.h"

typedef struct ms_damping_job {
  const ms_model *model;
  const ms_damping_derivative *t;
  const double *z;
  double *y;
} ms_damping_job;

typedef struct ms_damping_kernels {
  /* y -= the products of the slice ranges [begin, end); those of parts: to part_sums */
  void (*apply)(const ms_damping_job *job, int32_t begin, int32_t end);
} ms_damping_kernels;

#endif
