/* angle_kernels - the loops over angular springs of force sweeps and of products with the matrix,
 * one table for each instruction set; bits do not depend on it, as no fused multiply-add is used */
#ifndef MS_ANGLE_KERNELS_H
#define MS_ANGLE_KERNELS_H

#include "base/isa.h"
#include "physics/force.h"

/* Ranges of angles begin and end at multiples of MS_SLICE, or end at angles.nslots. */
typedef struct ms_angle_kernels {
  /* the forces of angular springs (angle.h) at x, v on their corners, to angles.corner; v NULL:
   * without damping */
  void (*forces)(const ms_model *model, const double *x, const double *v, int32_t begin,
                 int32_t end);
  /* their elements times x, to angles.corner. Returns the sum of x.(element x). */
  double (*multiply)(const ms_model *model, const ms_coefficients *a, ms_operands o, int32_t begin,
                     int32_t end);
  /* y += by times the sum of the corners of each row, for the rows of slices [begin, end) */
  void (*add_corners)(const ms_model *model, double by, ms_operands o, int32_t begin, int32_t end);
} ms_angle_kernels;

#endif
