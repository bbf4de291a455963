/* simd - as many doubles as one register of the build's instruction set holds. Lanes never meet, so
 * the bits of a result do not depend on their number, which divides 8. */
#ifndef MS_SIMD_H
#define MS_SIMD_H

/* Wide vectors never leave the functions into which these here are inlined. */
#pragma GCC diagnostic ignored "-Wpsabi"

#include <math.h>
#include <stdint.h>
#include <string.h>
#if defined(__AVX__)
#  include <immintrin.h>
#endif

#if defined(__AVX512F__)
#  define MS_LANES 8
#elif defined(__AVX__)
#  define MS_LANES 4
#else
#  define MS_LANES 2
#endif

/* Arguments that are constants of the caller are constants inside. */
#define MS_INLINE static inline __attribute__((always_inline))

typedef double ms_lanes __attribute__((vector_size(8 * MS_LANES)));
typedef int64_t ms_mask __attribute__((vector_size(8 * MS_LANES))); /* lanes 0 or -1 */

typedef float ms_floats __attribute__((vector_size(4 * MS_LANES)));

/* 4 doubles on every instruction set. */
typedef double ms_quad __attribute__((vector_size(32)));
typedef float ms_float_quad __attribute__((vector_size(16)));

/* From and to any address. */
static inline ms_lanes ms_load(const double *from) {
  ms_lanes v;
  memcpy(&v, from, sizeof v);
  return v;
}

static inline void ms_store(double *to, ms_lanes v) { memcpy(to, &v, sizeof v); }

/* floats as doubles; GCC 12 converts half a register at a time where it is left to it */
static inline ms_lanes ms_load_floats(const float *from) {
#if defined(__AVX512F__)
  return (ms_lanes)_mm512_cvtps_pd(_mm256_loadu_ps(from));
#elif defined(__AVX__)
  return (ms_lanes)_mm256_cvtps_pd(_mm_loadu_ps(from));
#else
  ms_floats v;
  memcpy(&v, from, sizeof v);
  return __builtin_convertvector(v, ms_lanes);
#endif
}

static inline ms_quad ms_load_quad(const double *from) {
  ms_quad v;
  memcpy(&v, from, sizeof v);
  return v;
}

static inline void ms_store_quad(double *to, ms_quad v) { memcpy(to, &v, sizeof v); }

static inline ms_quad ms_load_float_quad(const float *from) {
#if defined(__AVX__)
  return (ms_quad)_mm256_cvtps_pd(_mm_loadu_ps(from));
#else
  ms_float_quad v;
  memcpy(&v, from, sizeof v);
  return __builtin_convertvector(v, ms_quad);
#endif
}

typedef int64_t ms_quad_mask __attribute__((vector_size(32)));

/* The sums (0 + 1) + (2 + 3) over the lanes of each of four. */
static inline ms_quad ms_quad_sums(ms_quad a, ms_quad b, ms_quad c, ms_quad d) {
  const ms_quad_mask even = {0, 4, 2, 6}, odd = {1, 5, 3, 7};
  const ms_quad_mask low = {0, 1, 4, 5}, high = {2, 3, 6, 7};
  const ms_quad ab = __builtin_shuffle(a, b, even) + __builtin_shuffle(a, b, odd);
  const ms_quad cd = __builtin_shuffle(c, d, even) + __builtin_shuffle(c, d, odd);
  return __builtin_shuffle(ab, cd, low) + __builtin_shuffle(ab, cd, high);
}

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
