/* emulated_avx512 - intrinsics of AVX-512 by loops, for kernels compiled for AVX2
 *
 * Included before their sources. The kernels then run, slowly, on any processor with AVX2, and give
 * the same bits: all operations but VRSQRT14 are those of IEEE 754, and lanes do not interact. */
#ifndef EMULATED_AVX512_H
#define EMULATED_AVX512_H

#include <immintrin.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#define __AVX512F__  1
#define __AVX512VL__ 1

/* The 16 bits after the point of 2/sqrt(m), for 1 <= m < 2, and for 2 <= m < 4 with odd = 1; `bits`
 * are the first 15 of m's fraction. VRSQRT14 interpolates linearly in 32 intervals: 2^18 times the
 * values at their left ends, and 512 times the decrease per unit of `bits`. All 65 536 results are
 * those in the tables of Bochs (bochs/cpu/avx/avx512_rsqrt14.cc, recorded from Intel's Software
 * Development Emulator), and hashes of runs are those of processors with AVX-512. */
static inline uint32_t emulated_rsqrt14_fraction(int odd, uint32_t bits) {
  static const int32_t value[2][32] = {
      {262121, 254113, 246469, 239154, 232142, 225415, 218957, 212753, 206778, 201025, 195479,
       190132, 184962, 179962, 175135, 170459, 165927, 161539, 157279, 153144, 149133, 145235,
       141448, 137763, 134175, 130683, 127286, 123966, 120735, 117590, 114511, 111514},
      {108565, 102905, 97500, 92324, 87372, 82615, 78049, 73657, 69437, 65371, 61445,
       57661,  54005,  50474, 47057, 43755, 40551, 37443, 34431, 31513, 28675, 25918,
       23236,  20632,  18098, 15629, 13223, 10878, 8597,  6365,  4192,  2070}};
  static const int32_t slope[2][32] = {
      {1001, 955, 915, 877, 841, 807, 775, 747, 719, 693, 669, 647, 625, 603, 585, 567,
       549,  533, 517, 501, 487, 473, 461, 449, 437, 425, 415, 403, 393, 385, 375, 367},
      {707, 675, 647, 619, 595, 571, 549, 527, 509, 491, 473, 457, 441, 427, 413, 401,
       389, 377, 365, 355, 345, 335, 325, 317, 309, 301, 293, 285, 279, 271, 265, 259}};
  const uint32_t interval = bits >> 10;
  const int32_t within = (int32_t)(bits & 1023);
  return (uint32_t)((128 * value[odd][interval] - slope[odd][interval] * within) >> 9);
}

/* Of normal numbers above 0, and NaN: kernels have no others. Even powers of 2 have exact roots. */
static inline double emulated_rsqrt14(double v) {
  uint64_t bits;
  memcpy(&bits, &v, sizeof bits);
  if (isnan(v)) return v;
  const uint64_t fraction = bits & 0xfffffffffffff;
  const int32_t power = (int32_t)(bits >> 52) - 1023, odd = power & 1;
  const int is_exact = fraction == 0 && !odd;
  const uint64_t exponent = (uint64_t)(1022 - (power >> 1) + is_exact);
  const uint64_t root = is_exact ? 0 : emulated_rsqrt14_fraction(odd, (uint32_t)(fraction >> 37));
  bits = exponent << 52 | root << 36;
  memcpy(&v, &bits, sizeof v);
  return v;
}

/* The exponents of floats are those of doubles, and so are the first bits of fractions. */
static inline float emulated_rsqrt14f(float v) { return (float)emulated_rsqrt14((double)v); }

/* A function of each lane */
#define EMULATED(name, vector, lanes, parameters, expression) \
  static inline vector emulated##name parameters {            \
    vector of = a;                                            \
    for (int l = 0; l < (lanes); l++) of[l] = (expression);   \
    return of;                                                \
  }

EMULATED(_fmadd_pd, __m512d, 8, (__m512d a, __m512d b, __m512d c), fma(a[l], b[l], c[l]))
EMULATED(_fmadd_ps, __m512, 16, (__m512 a, __m512 b, __m512 c), fmaf(a[l], b[l], c[l]))
EMULATED(_fnmadd_pd, __m512d, 8, (__m512d a, __m512d b, __m512d c), fma(-a[l], b[l], c[l]))
EMULATED(_fnmadd_ps, __m512, 16, (__m512 a, __m512 b, __m512 c), fmaf(-a[l], b[l], c[l]))
EMULATED(_max_pd, __m512d, 8, (__m512d a, __m512d b), a[l] > b[l] ? a[l] : b[l])
EMULATED(_max_ps, __m512, 16, (__m512 a, __m512 b), a[l] > b[l] ? a[l] : b[l])
EMULATED(_min_pd, __m512d, 8, (__m512d a, __m512d b), a[l] < b[l] ? a[l] : b[l])
EMULATED(_min_ps, __m512, 16, (__m512 a, __m512 b), a[l] < b[l] ? a[l] : b[l])
EMULATED(_rsqrt14_pd, __m512d, 8, (__m512d a), emulated_rsqrt14(a[l]))
EMULATED(_rsqrt14_ps, __m512, 16, (__m512 a), emulated_rsqrt14f(a[l]))
EMULATED(_256_rsqrt14_ps, __m256, 8, (__m256 a), emulated_rsqrt14f(a[l]))

static inline __m512d emulated_from_floats(__m256 v) { return __builtin_convertvector(v, __m512d); }
static inline __m256 emulated_to_floats(__m512d v) { return __builtin_convertvector(v, __m256); }

static inline __m512d emulated_insert_high(__m512d to, __m256d high) {
  memcpy((char *)&to + sizeof high, &high, sizeof high);
  return to;
}

static inline __m512d emulated_widen(__m256d low) {
  __m512d wide = {0};
  memcpy(&wide, &low, sizeof low);
  return wide;
}

#undef _mm512_insertf64x4
#define _mm512_fmadd_pd                    emulated_fmadd_pd
#define _mm512_fmadd_ps                    emulated_fmadd_ps
#define _mm512_fnmadd_pd                   emulated_fnmadd_pd
#define _mm512_fnmadd_ps                   emulated_fnmadd_ps
#define _mm512_max_pd                      emulated_max_pd
#define _mm512_max_ps                      emulated_max_ps
#define _mm512_min_pd                      emulated_min_pd
#define _mm512_min_ps                      emulated_min_ps
#define _mm512_rsqrt14_pd                  emulated_rsqrt14_pd
#define _mm512_rsqrt14_ps                  emulated_rsqrt14_ps
#define _mm256_rsqrt14_ps                  emulated_256_rsqrt14_ps
#define _mm512_cvtps_pd                    emulated_from_floats
#define _mm512_cvtpd_ps                    emulated_to_floats
#define _mm512_castpd256_pd512             emulated_widen
#define _mm512_insertf64x4(to, high, half) emulated_insert_high(to, high)

#endif
