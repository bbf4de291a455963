/* simd - portable vectors of as many numbers as a register of the instruction set holds: doubles,
 * or floats in files that define MS_SINGLE
 *
 * Lanes never interact, so results do not depend on their number, which divides 8; but those of
 * ms_simd_fma, ms_simd_sqrt_and_inverse and ms_simd_two_over_sqrt depend on the instruction set. */
#ifndef MS_SIMD_H
#define MS_SIMD_H

/* The warning concerns calls with wide vectors, but all such functions are inlined. */
#pragma GCC diagnostic ignored "-Wpsabi"

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>
#ifdef __SSE2__
#  include <immintrin.h>
#endif

/* Floats fill registers of 8 lanes, as half-edges come in slices of 8; slice_pair_kernels.c defines
 * MS_LANES to fill 16. */
#ifdef MS_SINGLE
#  define MS_LANES_OF(doubles, floats) floats
#else
#  define MS_LANES_OF(doubles, floats) doubles
#endif
#ifndef MS_LANES
#  if defined(__AVX512F__)
#    define MS_LANES 8
#  elif defined(__AVX__)
#    define MS_LANES MS_LANES_OF(4, 8)
#  else
#    define MS_LANES MS_LANES_OF(2, 4)
#  endif
#endif

/* For functions with arguments that are constants of the caller. */
#define MS_INLINE static inline __attribute__((always_inline))

#ifdef MS_SINGLE
typedef float ms_real;
typedef int32_t ms_lane_mask;
#  define MS_LEAST_NORMAL FLT_MIN
#  define MS_SQRT         sqrtf
#else
typedef double ms_real;
typedef int64_t ms_lane_mask;
#  define MS_LEAST_NORMAL DBL_MIN
#  define MS_SQRT         sqrt
#endif

typedef ms_real ms_lanes __attribute__((vector_size(sizeof(ms_real) * MS_LANES)));
/* each lane 0 or -1 */
typedef ms_lane_mask ms_mask __attribute__((vector_size(sizeof(ms_real) * MS_LANES)));

typedef double ms_doubles __attribute__((vector_size(8 * MS_LANES)));
typedef float ms_floats __attribute__((vector_size(4 * MS_LANES)));

/* MS_WIDE(op): the intrinsic of AVX or AVX-512 for registers of ms_lanes */
#if defined(MS_SINGLE) && MS_LANES == 16
#  define MS_WIDE(op) _mm512_##op##_ps
#elif defined(MS_SINGLE) && defined(__AVX__)
#  define MS_WIDE(op) _mm256_##op##_ps
#elif defined(MS_SINGLE)
#elif defined(__AVX512F__)
#  define MS_WIDE(op) _mm512_##op##_pd
#elif defined(__AVX__)
#  define MS_WIDE(op) _mm256_##op##_pd
#endif

/* 4 doubles with every instruction set. */
typedef double ms_quad __attribute__((vector_size(32)));
typedef float ms_float_quad __attribute__((vector_size(16)));

/* Load and store at any alignment. */
static inline ms_lanes ms_simd_load(const ms_real *from) {
  ms_lanes v;
  memcpy(&v, from, sizeof v);
  return v;
}

static inline void ms_simd_store(ms_real *to, ms_lanes v) { memcpy(to, &v, sizeof v); }

/* A sweep over more bytes than that reads them from memory each time. As prefetchers of processors
 * stop at the ends of pages, and fall behind, it then fetches them ahead itself, in cache lines. */
enum { MS_CACHE = 8 << 20, MS_CACHE_LINE = 64 };

/* Fetch the cache lines of so many bytes that far ahead of `from`, if there are any: into the L2
 * cache, which has more misses under way than L1, and room for what is fetched. Always inlined, as
 * GCC 12 drops calls of functions that only prefetch. */
MS_INLINE void ms_simd_prefetch(const void *from, size_t bytes, size_t ahead) {
  enum { L2 = 2 };
  for (size_t at = 0; at < bytes; at += MS_CACHE_LINE)
    __builtin_prefetch((const void *)((uintptr_t)from + ahead + at), 0, L2);
}

/* from and to doubles, whatever the lanes hold */
static inline ms_lanes ms_simd_load_doubles(const double *from) {
  ms_doubles v;
  memcpy(&v, from, sizeof v);
  return __builtin_convertvector(v, ms_lanes);
}

static inline void ms_simd_store_doubles(double *to, ms_lanes v) {
  const ms_doubles wide = __builtin_convertvector(v, ms_doubles);
  memcpy(to, &wide, sizeof wide);
}

/* to += a v, in doubles */
static inline void ms_simd_add_to_doubles(double *to, double a, ms_lanes v) {
  ms_doubles sum;
  memcpy(&sum, to, sizeof sum);
  sum += a * __builtin_convertvector(v, ms_doubles);
  memcpy(to, &sum, sizeof sum);
}

/* from and to floats */
#ifdef MS_SINGLE
static inline ms_lanes ms_simd_load_floats(const float *from) { return ms_simd_load(from); }
#else
/* floats to doubles; intrinsics, because GCC 12 converts half a register at a time otherwise */
static inline ms_lanes ms_simd_load_floats(const float *from) {
#  if defined(__AVX512F__)
  return (ms_lanes)_mm512_cvtps_pd(_mm256_loadu_ps(from));
#  elif defined(__AVX__)
  return (ms_lanes)_mm256_cvtps_pd(_mm_loadu_ps(from));
#  else
  ms_floats v;
  memcpy(&v, from, sizeof v);
  return __builtin_convertvector(v, ms_lanes);
#  endif
}

static inline void ms_simd_store_floats(float *to, ms_lanes v) {
#  if defined(__AVX512F__)
  _mm256_storeu_ps(to, _mm512_cvtpd_ps(v));
#  elif defined(__AVX__)
  _mm_storeu_ps(to, _mm256_cvtpd_ps(v));
#  else
  const ms_floats narrow = __builtin_convertvector(v, ms_floats);
  memcpy(to, &narrow, sizeof narrow);
#  endif
}
#endif

static inline ms_quad ms_simd_load_quad(const double *from) {
  ms_quad v;
  memcpy(&v, from, sizeof v);
  return v;
}

static inline void ms_simd_store_quad(double *to, ms_quad v) { memcpy(to, &v, sizeof v); }

static inline ms_quad ms_simd_load_float_quad(const float *from) {
#if defined(__AVX__)
  return (ms_quad)_mm256_cvtps_pd(_mm_loadu_ps(from));
#else
  ms_float_quad v;
  memcpy(&v, from, sizeof v);
  return __builtin_convertvector(v, ms_quad);
#endif
}

static inline void ms_simd_store_float_quad(float *to, ms_quad v) {
  const ms_float_quad narrow = __builtin_convertvector(v, ms_float_quad);
  memcpy(to, &narrow, sizeof narrow);
}

/* 8 floats with every instruction set, from integers */
typedef float ms_float_octet __attribute__((vector_size(32)));

static inline ms_float_octet ms_simd_load_integer_octet(const int16_t *from) {
#ifdef __AVX2__
  return (ms_float_octet)_mm256_cvtepi32_ps(
      _mm256_cvtepi16_epi32(_mm_loadu_si128((const __m128i *)(const void *)from)));
#else
  return (ms_float_octet){from[0], from[1], from[2], from[3], from[4], from[5], from[6], from[7]};
#endif
}

/* x[0] ... x[3] twice */
static inline ms_float_octet ms_simd_repeat_quad(const float *x) {
  return (ms_float_octet){x[0], x[1], x[2], x[3], x[0], x[1], x[2], x[3]};
}

/* x[0] and x[1], each 4 times */
static inline ms_float_octet ms_simd_spread_pair(const float *x) {
  return (ms_float_octet){x[0], x[0], x[0], x[0], x[1], x[1], x[1], x[1]};
}

/* a b + c, rounded as by ms_simd_fma */
static inline ms_float_octet ms_simd_fma_octet(ms_float_octet a, ms_float_octet b,
                                               ms_float_octet c) {
#ifdef __FMA__
  return (ms_float_octet)_mm256_fmadd_ps((__m256)a, (__m256)b, (__m256)c);
#else
  return a * b + c;
#endif
}

static inline void ms_simd_store_octet(float *to, ms_float_octet v) { memcpy(to, &v, sizeof v); }

/* Lanes i, j, k, l of the lanes of a (0 to 3) and b (4 to 7). */
#if defined(__clang__) || __GNUC__ >= 12
#  define MS_SHUFFLE(a, b, i, j, k, l) __builtin_shufflevector(a, b, i, j, k, l)
#else
typedef int64_t ms_quad_mask __attribute__((vector_size(32)));
#  define MS_SHUFFLE(a, b, i, j, k, l) __builtin_shuffle(a, b, (ms_quad_mask){i, j, k, l})
#endif

/* The four horizontal sums (0 + 1) + (2 + 3) of the lanes of a, b, c and d. */
static inline ms_quad ms_simd_quad_sums(ms_quad a, ms_quad b, ms_quad c, ms_quad d) {
  const ms_quad ab = MS_SHUFFLE(a, b, 0, 4, 2, 6) + MS_SHUFFLE(a, b, 1, 5, 3, 7);
  const ms_quad cd = MS_SHUFFLE(c, d, 0, 4, 2, 6) + MS_SHUFFLE(c, d, 1, 5, 3, 7);
  return MS_SHUFFLE(ab, cd, 0, 1, 4, 5) + MS_SHUFFLE(ab, cd, 2, 3, 6, 7);
}

/* mask ? a : b in each lane */
static inline ms_lanes ms_simd_select(ms_mask mask, ms_lanes a, ms_lanes b) {
#if defined(MS_WIDE) && MS_LANES == MS_LANES_OF(4, 8)
  return MS_WIDE(blendv)(b, a, (ms_lanes)mask);
#else
  return (ms_lanes)((mask & (ms_mask)a) | (~mask & (ms_mask)b));
#endif
}

static inline ms_lanes ms_simd_sqrt(ms_lanes v) {
  ms_real lane[MS_LANES];
  ms_simd_store(lane, v);
  for (int l = 0; l < MS_LANES; l++) lane[l] = MS_SQRT(lane[l]);
  return ms_simd_load(lane);
}

/* x[index[0]], x[index[1]], ... */
static inline ms_lanes ms_simd_gather(const ms_real *x, const int32_t *index) {
#if MS_LANES == 8 /* by assignments, GCC 12 writes the lanes one after the other */
  return (ms_lanes){x[index[0]], x[index[1]], x[index[2]], x[index[3]],
                    x[index[4]], x[index[5]], x[index[6]], x[index[7]]};
#else
  ms_lanes v;
  /* cppcheck-suppress uninitvar; assigning a lane does not read v */
  for (int l = 0; l < MS_LANES; l++) v[l] = x[index[l]];
  return v;
#endif
}

/* max(v, least) in each lane; NaN if v is NaN */
static inline ms_lanes ms_simd_max(ms_lanes v, ms_real least) {
  const ms_lanes low = (ms_lanes){0} + least;
#ifdef MS_WIDE
  return MS_WIDE(max)(low, v);
#else
  return ms_simd_select(v < low, low, v);
#endif
}

/* min(a, b) and max(a, b) in each lane; b where a is NaN */
static inline ms_lanes ms_simd_lower(ms_lanes a, ms_lanes b) {
#ifdef MS_WIDE
  return MS_WIDE(min)(a, b);
#elif defined(__SSE2__) && MS_LANES == 2
  return _mm_min_pd(a, b);
#else
  return ms_simd_select(a < b, a, b);
#endif
}

static inline ms_lanes ms_simd_upper(ms_lanes a, ms_lanes b) {
#ifdef MS_WIDE
  return MS_WIDE(max)(a, b);
#elif defined(__SSE2__) && MS_LANES == 2
  return _mm_max_pd(a, b);
#else
  return ms_simd_select(a > b, a, b);
#endif
}

/* a b + c, rounded once if the instruction set has a fused multiply-add, which is faster, else
 * twice: the last bits of forces depend on it. */
static inline ms_lanes ms_simd_fma(ms_lanes a, ms_lanes b, ms_lanes c) {
#if defined(MS_WIDE) && (defined(__FMA__) || defined(__AVX512F__))
  return MS_WIDE(fmadd)(a, b, c);
#else
  return a * b + c;
#endif
}

/* c - a b, rounded as ms_simd_fma */
static inline ms_lanes ms_simd_fnma(ms_lanes a, ms_lanes b, ms_lanes c) {
#if defined(MS_WIDE) && (defined(__FMA__) || defined(__AVX512F__))
  return MS_WIDE(fnmadd)(a, b, c);
#else
  return c - a * b;
#endif
}

#ifdef MS_SINGLE
/* 2/sqrt(v) with a relative error of at most 2.6 u, u = 2^-24; v must be normal and > 0, or NaN.
 *
 * AVX-512 has an approximation r of 14 bits, which one Newton step turns into
 *   2/sqrt(v) = r (3 - v r^2).
 * The bits of that of AVX2 depend on the manufacturer of the processor, so that it is not used. */
static inline ms_lanes ms_simd_two_over_sqrt(ms_lanes v) {
#  if defined(__AVX512VL__)
  const ms_lanes zero = {0}, r = MS_WIDE(rsqrt14)(v);
  return r * ms_simd_fnma(v * r, r, zero + 3);
#  else
  return 2 / ms_simd_sqrt(v);
#  endif
}
#else
/* sqrt(v), and *inverse = 1/sqrt(v) with an error of at most 1.6 units in the last place with
 * AVX-512, else 1.5; v must be normal and > 0, or NaN.
 *
 * AVX-512 has an approximation r of 14 bits over the full range. With e = 1 - v r^2 < 2^-12.99,
 *   1/sqrt(v) = r (1 - e)^(-1/2) = r (1 + e/2 + 3/8 e^2 + 5/16 e^3 + 35/128 e^4 + ...),
 * truncated after e^3: what follows is below 2^-53.8. l = v/sqrt(v) gets one Newton step,
 * l + (v - l^2)/(2 l). With other instruction sets, a chain of such steps would take as long as the
 * hardware's square root. */
static inline ms_lanes ms_simd_sqrt_and_inverse(ms_lanes v, ms_lanes *inverse) {
#  if defined(__AVX512F__)
  const ms_lanes zero = {0}, r = _mm512_rsqrt14_pd(v);
  const ms_lanes e = _mm512_fnmadd_pd(v * r, r, zero + 1);
  ms_lanes series = ms_simd_fma(e, zero + 5. / 16, zero + 3. / 8);
  series = ms_simd_fma(e, series, zero + 1. / 2);
  *inverse = ms_simd_fma(e * r, series, r);
  const ms_lanes l = v * *inverse;
  return ms_simd_fma(_mm512_fnmadd_pd(l, l, v), 0.5 * *inverse, l);
#  else
  const ms_lanes l = ms_simd_sqrt(v);
  *inverse = 1 / l;
  return l;
#  endif
}
#endif

#endif
