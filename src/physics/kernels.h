/* kernels - the loops over half springs, one set for each instruction set. They form the same sums
 * in the same order without fused multiply-add: all sets give the same bits. */
#ifndef MS_KERNELS_H
#define MS_KERNELS_H

#include "base/isa.h"
#include "physics/force.h"

typedef struct ms_kernels {
  /* f += what springs do to their unknown ends; v NULL: without damping */
  void (*springs)(const ms_model *model, const double *x, const double *v, double *f);
  /* the same where all rest lengths and dampings are 0 */
  void (*linear_springs)(const ms_model *model, const double *x, double *f);
  void (*coefficients)(const ms_model *model, const double *x, double h, int clamp,
                       ms_coefficients *a);
  void (*apply)(const ms_model *model, const ms_coefficients *a, const double *x, double *y);
  /* a->block = 1: on vectors of so many components */
  void (*apply_alike)(const ms_model *model, const ms_coefficients *a, int32_t components,
                      const double *x, double *y);
} ms_kernels;

#endif
