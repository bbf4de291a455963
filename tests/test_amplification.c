/* Tests of the theoretical steps of the benchmarks (amplification of a damped oscillator): each
 * agrees with the exact motion to the order of its method, and the coefficients of force-gradient
 * satisfy its order conditions. */
#include <math.h>

#include "../tools/bench_reference/amplification.h"
#include "testing.h"

/* The exact solution of x'' = -2 zeta w x' - w^2 x over z = w t for zeta < 1; y = (x, v/w) */
static void move_exactly(double zeta, double z, double y[2]) {
  const double w = sqrt(1 - zeta * zeta), c = exp(-zeta * z) * cos(w * z);
  const double s = exp(-zeta * z) * sin(w * z) / w, x = y[0], v = y[1];
  y[0] = (c + zeta * s) * x + s * v;
  y[1] = -s * x + (c - zeta * s) * v;
}

static double error_of(amplification_step *step, double zeta, double z) {
  double largest = 0;
  for (int i = 0; i < 2; i++) {
    double y[2] = {i == 0, i == 1}, exact[2] = {i == 0, i == 1};
    step(zeta, z, y);
    move_exactly(zeta, z, exact);
    largest = fmax(largest, hypot(y[0] - exact[0], y[1] - exact[1]));
  }
  return largest;
}

static double half_trace(amplification_step *step, double z) {
  double p[2] = {1, 0}, q[2] = {0, 1};
  step(0, z, p);
  step(0, z, q);
  return (p[0] + q[1]) / 2;
}

/* Half the step has 2^-(order + 1) of the error. */
static void steps_have_their_order(void **state) {
  (void)state;
  const struct {
    amplification_step *step;
    double zeta, z, order;
  } cases[] = {{amplify_rkc, 0, 0.05, 2},     {amplify_rkc, 0.1, 0.05, 2},
               {amplify_ssprk102, 0, 0.3, 2}, {amplify_ssprk102, 0.1, 0.3, 2},
               {amplify_ssprk104, 0, 0.6, 4}, {amplify_ssprk104, 0.1, 0.6, 4},
               {amplify_rk6, 0, 0.3, 6},      {amplify_rk6, 0.1, 0.3, 6},
               {amplify_dop853, 0, 0.6, 8},   {amplify_dop853, 0.1, 0.6, 8},
               {amplify_rkn6, 0, 0.3, 6},     {amplify_force_gradient, 0, 0.5, 6}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    const double z = cases[i].z, zeta = cases[i].zeta;
    const double ratio = error_of(cases[i].step, zeta, z) / error_of(cases[i].step, zeta, z / 2);
    print_message("  case %d: order %.3g\n", (int)i, log2(ratio) - 1);
    assert_true(fabs(log2(ratio) - 1 - cases[i].order) < 0.3);
  }
}

/* Its order 4 holds in transformed variables, not in x and v. The trace of the step is invariant
 * under such a transformation, and agrees with that of the exact motion to one power of z more. */
static void takahashi_imada_has_its_order(void **state) {
  (void)state;
  const double z = 0.2;
  const double ratio = (half_trace(amplify_takahashi_imada, z) - cos(z)) /
                       (half_trace(amplify_takahashi_imada, z / 2) - cos(z / 2));
  assert_true(fabs(log2(ratio) - 6) < 0.1);
}

/* If damping is proportional to stiffness, the eigenvalues of all modes that oscillate are on the
 * circle |z + r| = r, r = h k/c, at |z| = 2 zeta r (docs/theory.md). */
static double growth_on_circle(amplification_step *step, double r) {
  double largest = -INFINITY;
  for (double zeta = 0.001; zeta < 1; zeta += 0.001)
    largest = fmax(largest, amplification_rate(step, zeta, 2 * zeta * r));
  return largest;
}

static void circles_of_proportional_damping_are_stable(void **state) {
  (void)state;
  const struct {
    amplification_step *step;
    double r;
  } cases[] = {
      {amplify_ssprk102, 9}, {amplify_ssprk104, 6}, {amplify_rk6, 4.97}, {amplify_dop853, 3.19}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    assert_true(growth_on_circle(cases[i].step, cases[i].r) <= 1e-12);
    assert_true(growth_on_circle(cases[i].step, 1.01 * cases[i].r) > 1e-3);
  }
}

/*------------------------------------- force-gradient -------------------------------------------*/

/* Omelyan, Mryglod and Folk (2002) leave four numbers a, b1, b2, g free in
 *   b1 a b2 a' b3 a' b2 a b1,  a' = 1/2 - a,  b3 = (1 - 2 b1 - 2 b2)(1 - g z^2).
 * The step of an oscillator has order 6 if four coefficients of its power series in z are those of
 * cos z and sin z; the others follow, as the step is symmetric and its determinant is 1. */
enum { TERMS = 8, NUMBERS = 4 };

typedef struct series {
  double x[TERMS], v[TERMS]; /* coefficients of z^0, z^1, ... */
} series;

static void kick(series *s, double b, double g) {
  for (int k = TERMS - 1; k > 0; k--) s->v[k] -= b * (s->x[k - 1] - (k > 2 ? g * s->x[k - 3] : 0));
}

static void drift(series *s, double a) {
  for (int k = TERMS - 1; k > 0; k--) s->x[k] += a * s->v[k - 1];
}

static void expand(const double n[NUMBERS], series *s) {
  const double b3 = 1 - 2 * (n[1] + n[2]);
  kick(s, n[1], 0), drift(s, n[0]), kick(s, n[2], 0), drift(s, 0.5 - n[0]);
  kick(s, b3, n[3]);
  drift(s, 0.5 - n[0]), kick(s, n[2], 0), drift(s, n[0]), kick(s, n[1], 0);
}

static void conditions(const double n[NUMBERS], double off[NUMBERS]) {
  series from_x = {.x = {1}}, from_v = {.v = {1}};
  expand(n, &from_x);
  expand(n, &from_v);
  off[0] = from_x.x[4] - 1. / 24, off[1] = from_x.x[6] + 1. / 720;
  off[2] = from_v.x[3] + 1. / 6, off[3] = from_v.x[5] - 1. / 120;
}

/* J d = off by Gauss-Jordan elimination with pivots, in place: the last column of J is off, then
 * d. */
static void solve(double J[NUMBERS][NUMBERS + 1]) {
  for (int k = 0; k < NUMBERS; k++) {
    int pivot = k;
    for (int r = k; r < NUMBERS; r++)
      if (fabs(J[r][k]) > fabs(J[pivot][k])) pivot = r;
    for (int c = 0; c <= NUMBERS; c++) {
      const double swapped = J[k][c];
      J[k][c] = J[pivot][c], J[pivot][c] = swapped;
    }
    for (int r = 0; r < NUMBERS; r++) {
      const double factor = r == k ? 0 : J[r][k] / J[k][k];
      for (int c = k; c <= NUMBERS; c++) J[r][c] -= factor * J[k][c];
    }
  }
  for (int k = 0; k < NUMBERS; k++) J[k][NUMBERS] /= J[k][k];
}

static void newton_step(double n[NUMBERS]) {
  const double d = 1e-6;
  double J[NUMBERS][NUMBERS + 1], off[NUMBERS];
  conditions(n, off);
  for (int c = 0; c < NUMBERS; c++) {
    double moved[NUMBERS] = {n[0], n[1], n[2], n[3]}, ahead[NUMBERS], behind[NUMBERS];
    moved[c] = n[c] + d, conditions(moved, ahead);
    moved[c] = n[c] - d, conditions(moved, behind);
    for (int r = 0; r < NUMBERS; r++) J[r][c] = (ahead[r] - behind[r]) / (2 * d);
  }
  for (int r = 0; r < NUMBERS; r++) J[r][NUMBERS] = off[r];
  solve(J);
  for (int c = 0; c < NUMBERS; c++) n[c] -= J[c][NUMBERS];
}

/* The step agrees with one by the numbers that Newton's method finds from a rough initial guess. */
static void force_gradient_solves_the_order_conditions(void **state) {
  (void)state;
  double n[NUMBERS] = {0.25, 0.1, 0.3, 0.02};
  for (int i = 0; i < 30; i++) newton_step(n);
  print_message("  a %.15f, b1 %.15f, b2 %.15f, g %.15f\n", n[0], n[1], n[2], n[3]);
  const double drifts[4] = {n[0], 0.5 - n[0], 0.5 - n[0], n[0]};
  const double kicks[5] = {n[1], n[2], 1 - 2 * (n[1] + n[2]), n[2], n[1]};
  for (double z = 0.5; z < 4; z += 0.5) {
    double y[2] = {1, 0.5}, derived[2] = {1, 0.5};
    amplify_force_gradient(0, z, y);
    for (int i = 0; i < 5; i++) {
      derived[1] -= z * kicks[i] * (i == 2 ? 1 - n[3] * z * z : 1) * derived[0];
      if (i < 4) derived[0] += z * drifts[i] * derived[1];
    }
    assert_true(hypot(y[0] - derived[0], y[1] - derived[1]) < 1e-11);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(steps_have_their_order),
                                     cmocka_unit_test(circles_of_proportional_damping_are_stable),
                                     cmocka_unit_test(takahashi_imada_has_its_order),
                                     cmocka_unit_test(force_gradient_solves_the_order_conditions)};
  return cmocka_run_group_tests_name("amplification", tests, NULL, NULL);
}
