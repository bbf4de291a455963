/* matrix_kernels - the loops over half-edges that compute the matrix and products with it, one
 * table for each instruction set
 *
 * Each kernel processes the slice ranges [begin, end) (half_edges.h): it writes the rows of slices
 * to the result, and the sums of split rows to half_edges.part_sums. It uses fused multiply-add if
 * the instruction set has it: last bits depend on the instruction set, but not on the number of
 * threads. */
#ifndef MS_MATRIX_KERNELS_H
#define MS_MATRIX_KERNELS_H

#include "base/isa.h"
#include "physics/force.h"

typedef struct ms_matrix_kernels {
  void (*coefficients)(const ms_model *model, const double *x, double h, int clamp,
                       ms_coefficients *a, int32_t begin, int32_t end);
  /* y = (A - (1 - share) M) x, without constraints */
  void (*apply)(const ms_model *model, const ms_coefficients *a, double share, const double *x,
                double *y, int32_t begin, int32_t end);
  /* The same for a->block = 1, on vectors of `components` */
  void (*apply_scalar)(const ms_model *model, const ms_coefficients *a, double share,
                       int32_t components, const double *x, double *y, int32_t begin, int32_t end);
  /* ms_nonlinearity_compute of these half-edges; those between two unknowns count half */
  double (*nonlinearity)(const ms_model *model, const double *x, double h, const double *d,
                         double lambda, int32_t begin, int32_t end);
} ms_matrix_kernels;

#endif
