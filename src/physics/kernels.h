/* kernels - the loops over half springs that serve the matrix, one set for each instruction set.
 *
 * Each works on the segments [begin, end) of the halves: a group's rows are written where they
 * belong, the sums of a part to halves.part_sums. With fused multiply-add where the instruction set
 * has it: last bits differ between these, and never between numbers of threads. */
#ifndef MS_KERNELS_H
#define MS_KERNELS_H

#include "base/isa.h"
#include "physics/force.h"

typedef struct ms_kernels {
  void (*coefficients)(const ms_model *model, const double *x, double h, int clamp,
                       ms_coefficients *a, int32_t begin, int32_t end);
  /* y = (A - (1 - share) M) x, without holds */
  void (*apply)(const ms_model *model, const ms_coefficients *a, double share, const double *x,
                double *y, int32_t begin, int32_t end);
  /* a->block = 1: on vectors of so many components */
  void (*apply_alike)(const ms_model *model, const ms_coefficients *a, double share,
                      int32_t components, const double *x, double *y, int32_t begin, int32_t end);
  /* ms_excess of the springs of these segments; those between two unknowns are halved */
  double (*excess)(const ms_model *model, const double *x, double h, const double *d, double lambda,
                   int32_t begin, int32_t end);
} ms_kernels;

#endif
