/* Tests of the first downward zero of a polynomial in Bernstein form, against products of known
 * roots and closed forms. */
#include <math.h>

#include "physics/bernstein.h"
#include "testing.h"

/* (a + b q) s */
static ms_bernstein scale_values(const ms_bernstein *s, double a, double b) {
  const int n = s->degree;
  ms_bernstein p = {.degree = n + 1};
  for (int i = 0; i <= n; i++) {
    p.c[i] += s->c[i] * a * (n + 1 - i) / (n + 1);
    p.c[i + 1] += s->c[i] * (a + b) * (i + 1) / (n + 1);
  }
  return p;
}

/* Roots inside, outside and in pairs: the first one at which the polynomial falls is found, up to
 * rounding. */
static void first_falls_are_found(void **state) {
  (void)state;
  unsigned seed = 5;
  for (int k = 0; k < 3000; k++) {
    const int n = 1 + k % MS_BERNSTEIN_MAX_DEGREE;
    double first = MS_NOWHERE, root[MS_BERNSTEIN_MAX_DEGREE];
    ms_bernstein s = {.degree = 0, .c = {1}};
    for (int i = 0; i < n; i++) {
      root[i] = 4 * uniform(&seed) - 1.5;
      if (fabs(root[i]) < 1e-3) root[i] = -1;
      s = scale_values(&s, root[i] > 0 ? root[i] : -root[i], root[i] > 0 ? -1 : 1);
    }
    double second = MS_NOWHERE;
    for (int i = 0; i < n; i++) {
      if (root[i] < 0 || root[i] > 1) continue;
      second = fmin(second, fmax(first, root[i]));
      first = fmin(first, root[i]);
    }
    if (second - first < 1e-3) continue; /* a close pair may vanish by rounding */
    const double found = ms_bernstein_find_crossing(&s, 1e-12 * fabs(s.c[0]));
    assert_close(found, first, 1e-7);
  }
}

/* 4 (q - 1/2)^2 - depth, in degrees 2 to 7: the shortest dip below 0 is found, and a near miss is
 * not. */
static void short_dips_are_found(void **state) {
  (void)state;
  for (int exponent = 2; exponent <= 14; exponent++) {
    const double depth = pow(10, -exponent);
    ms_bernstein dip = {2, {1 - depth, -1 - depth, 1 - depth}},
                 miss = {2, {1 + depth, -1 + depth, 1 + depth}};
    for (int n = 2; n <= MS_BERNSTEIN_MAX_DEGREE; n++) {
      assert_close(ms_bernstein_find_crossing(&dip, 1e-16), 0.5 - sqrt(depth) / 2,
                   1e-15 / sqrt(depth));
      assert_true(ms_bernstein_find_crossing(&miss, 1e-16) > 1);
      if (n < MS_BERNSTEIN_MAX_DEGREE) ms_bernstein_elevate(&dip), ms_bernstein_elevate(&miss);
    }
  }
}

/* A polynomial that rises from 0: its return to 0 is found, its start is not. */
static void a_return_to_zero_is_found(void **state) {
  (void)state;
  const ms_bernstein back = ms_bernstein_cubic(0, 1, -1, -3); /* q - 2 q^2 */
  const ms_bernstein away = ms_bernstein_cubic(1e-15, 1, 1, 1);
  const ms_bernstein down = ms_bernstein_cubic(0, -1, -1, -1);
  assert_close(ms_bernstein_find_crossing(&back, 1e-12), 0.5, 1e-15);
  assert_true(ms_bernstein_find_crossing(&away, 1e-12) > 1);
  assert_true(ms_bernstein_find_crossing(&down, 1e-12) == 0);
  const ms_bernstein bad = {3, {NAN, 1, 1, 1}}, worse = {3, {1, 1, NAN, -1}};
  assert_true(ms_bernstein_find_crossing(&bad, 0) > 1);
  assert_true(ms_bernstein_find_crossing(&worse, 0) <= MS_NOWHERE);
}

static void hermites_polynomials_meet_their_ends(void **state) {
  (void)state;
  const ms_bernstein q = ms_bernstein_quintic(1, 2, 3, -4, 5, -6);
  const double d = 1e-5;
  assert_true(q.c[0] == 1 && q.c[5] == -4);
  assert_close((ms_bernstein_evaluate(&q, d) - 1) / d, 2, 1e-4);
  assert_close((ms_bernstein_evaluate(&q, 2 * d) - 2 * ms_bernstein_evaluate(&q, d) + 1) / d / d, 3,
               1e-2);
  assert_close((-4 - ms_bernstein_evaluate(&q, 1 - d)) / d, 5, 1e-4);
  assert_close(
      (ms_bernstein_evaluate(&q, 1 - 2 * d) - 2 * ms_bernstein_evaluate(&q, 1 - d) - 4) / d / d, -6,
      1e-2);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(first_falls_are_found),
                                     cmocka_unit_test(short_dips_are_found),
                                     cmocka_unit_test(a_return_to_zero_is_found),
                                     cmocka_unit_test(hermites_polynomials_meet_their_ends)};
  return cmocka_run_group_tests_name("bernstein", tests, NULL, NULL);
}
