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

/* Compute a's coefficients at x. */
typedef struct ms_coefficients_job {
  const ms_model *model;
  const double *x;
  double h;
  int clamp;
  ms_coefficients *a;
} ms_coefficients_job;

/* y = (A - (1 - share) M) x, without constraints */
typedef struct ms_product_job {
  const ms_model *model;
  const ms_coefficients *a;
  double share;
  int32_t components; /* of x and y; those of the model unless a->block = 1 */
  const double *x;
  double *y;
} ms_product_job;

/* The sum of ms_nonlinearity_compute */
typedef struct ms_nonlinearity_job {
  const ms_model *model;
  const double *x, *d;
  double h, lambda;
} ms_nonlinearity_job;

typedef struct ms_matrix_kernels {
  void (*coefficients)(const ms_coefficients_job *job, int32_t begin, int32_t end);
  void (*apply)(const ms_product_job *job, int32_t begin, int32_t end);
  void (*apply_scalar)(const ms_product_job *job, int32_t begin, int32_t end); /* a->block = 1 */
  /* half-edges between two unknowns count half */
  double (*nonlinearity)(const ms_nonlinearity_job *job, int32_t begin, int32_t end);
} ms_matrix_kernels;

#endif
