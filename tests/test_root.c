/* Tests of ms_simd_sqrt_and_inverse for the widest registers that the build supports: square roots
 * and their inverses against long double. */
#include "base/simd.h"
#include "testing.h"

enum { MANY = 1 << 21 };

/* In units in the last place of double precision */
static double distance_in_ulp(double value, long double exact) {
  return (double)(fabsl(value - exact) / scalbnl(1, ilogbl(exact) - 52));
}

/* the error of 1/sqrt(v) in units in the last place, as base/simd.h states it */
#ifdef __AVX512F__
static const double most = 1.6;
#else
static const double most = 1.5;
#endif

/* Over the whole range of exponents. sqrt(v) is almost always correctly rounded. */
static void roots_of_all_sizes(void **state) {
  (void)state;
  unsigned seed = 1;
  double inverse_error = 0, root_error = 0;
  for (int i = 0; i < MANY; i += MS_LANES) {
    double v[MS_LANES], root[MS_LANES], inverse[MS_LANES];
    for (int l = 0; l < MS_LANES; l++)
      v[l] =
          ldexp(1 + uniform(&seed) + 0x1p-24 * uniform(&seed), (int)(2000 * uniform(&seed)) - 1000);
    ms_lanes of_all;
    ms_simd_store(root, ms_simd_sqrt_and_inverse(ms_simd_load(v), &of_all));
    ms_simd_store(inverse, of_all);
    for (int l = 0; l < MS_LANES; l++) {
      const long double exact = sqrtl(v[l]);
      root_error = fmax(root_error, distance_in_ulp(root[l], exact));
      inverse_error = fmax(inverse_error, distance_in_ulp(inverse[l], 1 / exact));
    }
  }
  print_message("  %d lanes: sqrt(v) off by %.4f ulp, 1/sqrt(v) by %.4f\n", MS_LANES, root_error,
                inverse_error);
  assert_true(root_error <= 0.501);
  assert_true(inverse_error <= most);
}

static void no_number_has_no_root(void **state) {
  (void)state;
  double v[MS_LANES], root[MS_LANES], inverse[MS_LANES];
  for (int l = 0; l < MS_LANES; l++) v[l] = l ? 4 : NAN;
  ms_lanes of_all;
  ms_simd_store(root, ms_simd_sqrt_and_inverse(ms_simd_load(v), &of_all));
  ms_simd_store(inverse, of_all);
  for (int l = 0; l < MS_LANES; l++) {
    assert_true(l ? root[l] == 2 : isnan(root[l]));
    assert_true(l ? inverse[l] == 0.5 : isnan(inverse[l]));
  }
}

int main(void) {
#if defined(__AVX512F__) && !defined(EMULATED_AVX512_H)
  if (!__builtin_cpu_supports("avx512f") || !__builtin_cpu_supports("avx512vl")) return 77;
#endif
  const struct CMUnitTest tests[] = {cmocka_unit_test(roots_of_all_sizes),
                                     cmocka_unit_test(no_number_has_no_root)};
  return cmocka_run_group_tests_name("root", tests, NULL, NULL);
}
