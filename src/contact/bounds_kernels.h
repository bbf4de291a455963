/* bounds_kernels - bounds on the particles of some rows, for broad_phase.h */
#ifndef MS_BOUNDS_KERNELS_H
#define MS_BOUNDS_KERNELS_H

#include "base/isa.h"
#include "contact/broad_phase.h"

typedef struct ms_bounds_kernels {
  /* The first row in [row, end) whose particle may meet one of the planes but the tangents of
   * solids, `end`: there is none. Reads whole registers, padding included. */
  int32_t (*find_near_plane)(const ms_broad_phase *b, int32_t row, int32_t end);
  /* The least and the largest number of each component in rows [begin, end), NaN left out */
  void (*bound)(ms_shape s, const double *x, int32_t begin, int32_t end, double *low, double *high);
} ms_bounds_kernels;

#endif
