/* Tests of ms_simd_two_over_sqrt for the widest registers that the build supports, against double
 * precision. */
#define MS_SINGLE
#include "base/simd.h"
#include "testing.h"

#define U 0x1p-24 /* the largest relative error of an operation */

/* |2/sqrt(v) sqrt(v)/2 - 1| of the lanes */
static double largest_error(const float v[MS_LANES]) {
  float found[MS_LANES];
  double largest = 0;
  ms_simd_store(found, ms_simd_two_over_sqrt(ms_simd_load(v)));
  for (int l = 0; l < MS_LANES; l++)
    largest = fmax(largest, fabs(found[l] * (sqrt((double)v[l]) / 2) - 1));
  return largest;
}

/* All floats from 1 to 4, on which those of other exponents depend by powers of 2. r is off by
 * 2^-14, hence Newton's step by 1.5 x 2^-28 = 0.1 u; v r is rounded by u, which counts half, and so
 * is, close to 2, the difference; and the product by u. */
static void all_floats_of_two_exponents(void **state) {
  (void)state;
  double largest = 0;
  for (uint32_t bits = 0; bits < 1u << 24; bits += MS_LANES) {
    float v[MS_LANES];
    for (int l = 0; l < MS_LANES; l++)
      v[l] = ldexpf(1 + (float)((bits + (uint32_t)l) % (1u << 23)) * 0x1p-23f, (int)(bits >> 23));
    largest = fmax(largest, largest_error(v));
  }
  print_message("  %d lanes: 2/sqrt(v) off by %.3f u\n", MS_LANES, largest / U);
  assert_true(largest <= 2.6 * U);
}

static void from_the_least_to_the_largest(void **state) {
  (void)state;
  unsigned seed = 1;
  float v[MS_LANES];
  for (int exponent = FLT_MIN_EXP - 1; exponent < FLT_MAX_EXP; exponent++) {
    for (int l = 0; l < MS_LANES; l++)
      v[l] = ldexpf(1 + (float)(l ? uniform(&seed) / 2 : 0), exponent);
    assert_true(largest_error(v) <= 2.6 * U);
  }
}

static void no_number_has_no_root(void **state) {
  (void)state;
  float v[MS_LANES], found[MS_LANES];
  for (int l = 0; l < MS_LANES; l++) v[l] = l ? 4 : NAN;
  ms_simd_store(found, ms_simd_two_over_sqrt(ms_simd_load(v)));
  assert_true(isnan(found[0]));
  for (int l = 1; l < MS_LANES; l++) assert_true(found[l] == 1);
}

int main(void) {
#if defined(__AVX512VL__) && !defined(EMULATED_AVX512_H)
  if (!__builtin_cpu_supports("avx512vl")) return 77;
#endif
  const struct CMUnitTest tests[] = {cmocka_unit_test(all_floats_of_two_exponents),
                                     cmocka_unit_test(from_the_least_to_the_largest),
                                     cmocka_unit_test(no_number_has_no_root)};
  return cmocka_run_group_tests_name("single_root", tests, NULL, NULL);
}
