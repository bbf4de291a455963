/* simd - as many doubles as one register of the build's instruction set holds. Lanes never meet, so
 * the bits of a result do not depend on their number, which divides 8. */
#ifndef MS_SIMD_H
#define MS_SIMD_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#if defined(__AVX512F__)
#  define MS_LANES 8
#elif defined(__AVX__)
#  define MS_LANES 4
#else
#  define MS_LANES 2
#endif

typedef double ms_lanes __attribute__((vector_size(8 * MS_LANES)));
typedef int64_t ms_mask __attribute__((vector_size(8 * MS_LANES))); /* lanes 0 or -1 */

/* From and to any address. */
static inline ms_lanes ms_load(const double *from) {
  ms_lanes v;
  memcpy(&v, from, sizeof v);
  return v;
}

static inline void ms_store(double *to, ms_lanes v) { memcpy(to, &v, sizeof v); }

/* a where the mask says so, else b */
static inline ms_lanes ms_select(ms_mask mask, ms_lanes a, ms_lanes b) {
  return (ms_lanes)((mask & (ms_mask)a) | (~mask & (ms_mask)b));
}

static inline ms_lanes ms_sqrt(ms_lanes v) {
  double lane[MS_LANES];
  ms_store(lane, v);
  for (int l = 0; l < MS_LANES; l++) lane[l] = sqrt(lane[l]);
  return ms_load(lane);
}

#endif
