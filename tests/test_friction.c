/* Tests of the closed form of Coulomb friction, against its differential equation and closed forms
 * on a line. */
#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "contact/friction.h"
#include "testing.h"

static void rate(const double a[3], double F, const double v[3], double to[3]) {
  const double speed = ms_vec3_norm(v);
  for (int c = 0; c < 3; c++) to[c] = a[c] - F * v[c] / speed;
}

/* x and v by n steps of the classical Runge-Kutta method */
static void integrate(const double a[3], double F, double t, int n, double v[3], double x[3]) {
  static const double reach[4] = {0, 0.5, 0.5, 1}, weight[4] = {1. / 6, 1. / 3, 1. / 3, 1. / 6};
  const double h = t / n;
  for (int i = 0; i < n; i++) {
    double k[3] = {0}, stage[3], sum[3] = {v[0], v[1], v[2]};
    for (int s = 0; s < 4; s++) {
      for (int c = 0; c < 3; c++) stage[c] = v[c] + h * reach[s] * k[c];
      ms_vec3_axpy(h * weight[s], stage, x);
      rate(a, F, stage, k);
      ms_vec3_axpy(h * weight[s], k, sum);
    }
    memcpy(v, sum, sizeof sum);
  }
}

/* F below, near and above |a|; v in all directions; up to nine tenths of the time to the stop */
static void sliding_solves_its_equation(void **state) {
  (void)state;
  unsigned seed = 7;
  for (int i = 0; i < 400; i++) {
    double a[3] = {0}, v[3] = {0}, x[3] = {0}, dx[3], w[3];
    for (int c = 0; c < 2; c++) a[c] = 4 * uniform(&seed) - 2, v[c] = 4 * uniform(&seed) - 2;
    if (i % 5 == 0) v[1] = v[0] * a[1] / a[0] + 1e-4;
    const double F = i % 7 == 0 ? ms_vec3_norm(a) : 4 * uniform(&seed);
    const double t =
        fmin(0.9 * ms_friction_stop(a, F, v), 0.3 * ms_vec3_norm(v) / (F + ms_vec3_norm(a)));
    memcpy(w, v, sizeof w);
    integrate(a, F, t, 400, w, x);
    ms_friction_slide(a, F, t, v, dx);
    for (int c = 0; c < 3; c++) {
      assert_close(v[c], w[c], 1e-10);
      assert_close(dx[c], x[c], 1e-10);
    }
  }
}

/* Two substeps give the same as one, across sharp turns, stops and starts */
static void parts_add_up(void **state) {
  (void)state;
  unsigned seed = 3;
  for (int i = 0; i < 1000; i++) {
    double a[3] = {0}, v[3] = {0}, w[3], whole[3], one[3], two[3];
    const double narrow = pow(10, -12 * uniform(&seed)), slow = pow(10, -6 * uniform(&seed));
    for (int c = 0; c < 2; c++) a[c] = 4 * uniform(&seed) - 2, v[c] = slow * (uniform(&seed) - 0.5);
    if (i % 3 == 0)
      for (int c = 0; c < 2; c++) v[c] = -slow * (a[c] + narrow * uniform(&seed));
    const double F = 3 * uniform(&seed), t = 2 * uniform(&seed), first = t * uniform(&seed);
    memcpy(w, v, sizeof w);
    ms_friction_slide(a, F, t, v, whole);
    ms_friction_slide(a, F, first, w, one);
    ms_friction_slide(a, F, t - first, w, two);
    for (int c = 0; c < 3; c++) {
      assert_close(v[c], w[c], 1e-9);
      assert_close(whole[c], one[c] + two[c], 1e-9);
    }
  }
}

/* F near |a|, v nearly against a: F |v| + a.v grows at the rate A^2 - F^2 until it is 0, through
 * the turn and long after it. */
static void critical_friction_turns(void **state) {
  (void)state;
  const double a[3] = {1, 0, 0};
  for (int i = 0; i < 24; i++) {
    const double narrow = pow(10, -1 - i / 3.), F = 1 + (i % 3 - 1) * 1e-13;
    for (double t = 1; t < 1e5; t *= 10) {
      double v[3] = {-1, narrow, 0}, dx[3];
      const double before = F * ms_vec3_norm(v) + v[0], slope = (1 - F) * (1 + F);
      ms_friction_slide(a, F, t, v, dx);
      assert_close(F * ms_vec3_norm(v) + v[0], fmax(0, before + slope * t), 1e-12);
      assert_true(ms_vec3_norm(v) <= 1 + narrow);
    }
  }
}

static void stops_at_its_time_and_stays(void **state) {
  (void)state;
  const double a[3] = {0.6, 0.8, 0}, F = 1.5, v[3] = {2, -1, 0};
  const double stop = (F * sqrt(5) + 0.4) / (F * F - 1);
  double before[3] = {2, -1, 0}, after[3] = {2, -1, 0}, dx[3], later[3];
  assert_close(ms_friction_stop(a, F, v), stop, 1e-15);
  ms_friction_slide(a, F, stop * (1 - 1e-6), before, dx);
  ms_friction_slide(a, F, stop + 3, after, later);
  assert_true(ms_vec3_norm(before) > 0 && ms_vec3_norm(before) < 1e-5);
  for (int c = 0; c < 3; c++) {
    assert_true(after[c] == 0);
    assert_close(dx[c], later[c], 1e-10);
  }
  assert_true(isinf(ms_friction_stop(a, 1, v)));
}

/* On a line: deceleration, reversal, a stop, and no start if |a| <= F. */
static void on_a_line(void **state) {
  (void)state;
  const double a[3] = {0, -2, 0};
  double v[3] = {0, 3, 0}, dx[3];
  ms_friction_slide(a, 1, 2, v, dx);
  assert_close(v[1], -1, 1e-15);
  assert_close(dx[1], 1.5 - 0.5, 1e-15);
  double w[3] = {0, 3, 0};
  ms_friction_slide(a, 4, 2, w, dx);
  assert_true(w[1] == 0);
  assert_close(dx[1], 0.75, 1e-15);
  double still[3] = {0};
  ms_friction_slide(a, 2, 5, still, dx);
  assert_true(ms_vec3_norm(still) == 0 && ms_vec3_norm(dx) == 0);
  ms_friction_slide(a, 0.5, 2, still, dx);
  assert_close(still[1], -3, 1e-15);
  assert_close(dx[1], -3, 1e-15);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(sliding_solves_its_equation), cmocka_unit_test(parts_add_up),
      cmocka_unit_test(critical_friction_turns), cmocka_unit_test(stops_at_its_time_and_stays),
      cmocka_unit_test(on_a_line)};
  return cmocka_run_group_tests_name("friction", tests, NULL, NULL);
}
