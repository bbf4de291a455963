/* Compiled once for each instruction set, with MS_ISA defined as its name. */
#include "contact/bounds_kernels.h"

#include "base/simd.h"

/* Whole blocks of `registers` registers; returns the first row that is left. */
MS_INLINE int32_t bound_blocks(int registers, const double *x, int32_t r, int32_t end,
                               ms_lanes *least, ms_lanes *most) {
  for (; r + registers * MS_LANES <= end; r += registers * MS_LANES)
    for (int i = 0; i < registers; i++) {
      const ms_lanes at = ms_simd_load(x + r + i * MS_LANES);
      *least = ms_simd_lower(at, *least), *most = ms_simd_upper(at, *most);
    }
  return r;
}

static double lower(double a, double b) { return a < b ? a : b; }
static double upper(double a, double b) { return a > b ? a : b; }

static void bound(ms_shape s, const double *x, int32_t begin, int32_t end, double *low,
                  double *high) {
  for (int32_t c = 0; c < s.dims; c++, x += s.stride) {
    ms_lanes least = (ms_lanes){0} + INFINITY, most = (ms_lanes){0} - INFINITY;
    int32_t r = bound_blocks(8, x, begin, end, &least, &most);
    r = bound_blocks(1, x, r, end, &least, &most);
    low[c] = INFINITY, high[c] = -INFINITY;
    for (int l = 0; l < MS_LANES; l++)
      low[c] = lower(least[l], low[c]), high[c] = upper(most[l], high[c]);
    for (; r < end; r++) low[c] = lower(x[r], low[c]), high[c] = upper(x[r], high[c]);
  }
}

const ms_bounds_kernels MS_TABLE(ms_bounds_kernels) = {bound};
