#include "contact/friction.h"

#include <float.h>
#include <math.h>

#include "base/vec3.h"

/* Rounding tolerance of v over t |a|: below it the direction of v is meaningless. */
#define STILL 1e-12

double ms_friction_stop(const double a[3], double F, const double v[3]) {
  const double A = ms_vec3_norm(a), speed = ms_vec3_norm(v);
  if (!(F > A)) return INFINITY;
  return (F * speed + ms_vec3_dot(a, v)) / ((F - A) * (F + A));
}

/* Advance dx and v by t at the constant acceleration b. */
static void advance_uniformly(const double b[3], double t, double v[3], double dx[3]) {
  for (int c = 0; c < 3; c++) {
    dx[c] += t * (v[c] + 0.5 * t * b[c]);
    v[c] += t * b[c];
  }
}

/* v and a are parallel: friction has a constant direction until v reaches 0. */
static void slide_straight(const double a[3], double F, double t, double v[3], double dx[3]) {
  const double A = ms_vec3_norm(a), speed = ms_vec3_norm(v);
  double b[3] = {a[0], a[1], a[2]};
  const double slowed = F - copysign(A, ms_vec3_dot(a, v)); /* -d|v|/dt */
  double left = t;
  if (speed > STILL * t * A) {
    const double still = slowed > 0 ? speed / slowed : INFINITY;
    ms_vec3_axpy(-F / speed, v, b);
    advance_uniformly(b, fmin(t, still), v, dx);
    if (t < still) return;
    left = t - still;
  }
  for (int c = 0; c < 3; c++) v[c] = 0, b[c] = A > F ? (1 - F / A) * a[c] : 0;
  advance_uniformly(b, left, v, dx);
}

/* u0^-p times the integral of u^(p-1) from u0 e^d to u0; *rate: e^(p d), its negative derivative */
static double power_integral(double p, double d, double *rate) {
  const double less = expm1(p * d);
  *rate = 1 + less;
  return p != 0 ? -less / p : -d;
}

/* d with power_integral(p, d) = value; -INFINITY: there is none */
static double invert_power_integral(double p, double value) {
  if (p == 0) return -value;
  return p * value < 1 ? log1p(-p * value) / p : -INFINITY;
}

/* What find_log_tangent() solves: power_integral(k - 1, d) + E power_integral(k + 1, d) = time */
typedef struct tangent_equation {
  double k, E, time;
} tangent_equation;

/* Newton's method: *off, left side minus right side, and the change of d that follows */
static double newton_change(const tangent_equation *e, double d, double *off) {
  double rate[2];
  *off = power_integral(e->k - 1, d, &rate[0]) + e->E * power_integral(e->k + 1, d, &rate[1]) -
         e->time;
  return *off / (rate[0] + e->E * rate[1]);
}

/* 1: after the change d is off by (k + 1) change^2/2 at most, which is rounding. */
static int is_last_change(const tangent_equation *e, double d, double change) {
  const double SMALL = 1e-8;
  return fabs(change) <= SMALL * fabs(d) && fabs(change) * (e->k + 1) <= SMALL;
}

/* The same between bounds; each term of the equation alone gives a lower one. */
static double find_bounded_root(const tangent_equation *e, double d) {
  enum { MOST = 100 };
  const double k = e->k;
  double high = 0, low = fmax(invert_power_integral(k - 1, e->time),
                              invert_power_integral(k + 1, e->time / e->E));
  low = fmax(low, -700 / fabs(k - 1)); /* so that exp((k - 1) d) does not overflow */
  d = fmax(low, fmin(0, d));
  for (int i = 0; i < MOST; i++) {
    double off;
    const double change = newton_change(e, d, &off);
    if (off > 0) low = d;
    else high = d;
    if (is_last_change(e, d, change)) return d + change;
    d = d + change > low && d + change < high ? d + change : 0.5 * (low + high);
  }
  return d;
}

/* d = ln(u/u0) <= 0 after the time t, with E = u0^2 and time = t A (1 + E)/|v|. With s = time/(1 +
 * E) and the weighted means m_j = ((k - 1)^j + E (k + 1)^j)/(1 + E) the equation is
 *   -d - m_1 d^2/2 - m_2 d^3/6 - m_3 d^4/24 - ... = s,
 * so that d = -s - m_1 s^2/2 - (m_1^2/2 - m_2/6) s^3 - (5 m_1^3/8 - 5 m_1 m_2/12 + m_3/24) s^4 -
 * ...: for most steps that needs one change. */
static double find_log_tangent(double k, double E, double time) {
  const tangent_equation e = {k, E, time};
  const double s = time / (1 + E), p = (k - 1) / (1 + E), q = E * (k + 1) / (1 + E);
  const double m1 = p + q, m2 = p * (k - 1) + q * (k + 1),
               m3 = p * (k - 1) * (k - 1) + q * (k + 1) * (k + 1);
  const double third = m1 * m1 / 2 - m2 / 6, fourth = (5 * m1 * (3 * m1 * m1 - 2 * m2) + m3) / 24,
               d = -s * (1 + s * (m1 / 2 + s * (third + s * fourth)));
  double off;
  const double change = newton_change(&e, d, &off);
  return is_last_change(&e, d, change) ? d + change : find_bounded_root(&e, d);
}

/* The components of v along a and across it */
typedef struct components {
  double A, along, across; /* |a|, v.a/A, |side| */
  double side[3];
} components;

/* The end of a path that is not straight: d = ln(u/u0); q: |v|/(1 + u0^2) at its start */
typedef struct curve {
  double k, u0, q, d;
} curve;

/* dx += the displacement */
static void add_curved_displacement(const double a[3], const components *of, const curve *on,
                                    double dx[3]) {
  const double k = on->k, u0 = on->u0, q = on->q, d = on->d, E = u0 * u0;
  double unused;
  const double x = q * q / of->A *
                   (power_integral(2 * k - 2, d, &unused) -
                    E * E * power_integral(2 * k + 2, d, &unused)),
               y = 2 * q * q * u0 / of->A *
                   (power_integral(2 * k - 1, d, &unused) +
                    E * power_integral(2 * k + 1, d, &unused));
  for (int c = 0; c < 3; c++) dx[c] += x / of->A * a[c] + y / of->across * of->side[c];
}

/* v and a are not parallel. dx is nullable. */
static void slide_curved(const double a[3], double F, double t, const components *of, double v[3],
                         double *dx) {
  const double A = of->A, along = of->along, across = of->across, speed = ms_vec3_norm(v);
  curve on = {.k = F / A,
              .u0 = along > 0 ? across / (speed + along) : (speed - along) / across,
              .d = -INFINITY};
  const double E = on.u0 * on.u0;
  const int moves = t < ms_friction_stop(a, F, v);
  on.q = speed / (1 + E);
  if (moves) on.d = find_log_tangent(on.k, E, t * A / on.q);
  const double u = on.u0 * exp(on.d), size = moves ? on.q * exp((on.k - 1) * on.d) : 0;
  if (dx) add_curved_displacement(a, of, &on, dx);
  for (int c = 0; c < 3; c++) v[c] = size * ((1 - u * u) / A * a[c] + 2 * u / across * of->side[c]);
}

void ms_friction_slide(const double a[3], double F, double t, double v[3], double dx[3]) {
  const double A = ms_vec3_norm(a), speed = ms_vec3_norm(v);
  double unused[3], *displacement = dx ? dx : unused;
  components of = {.A = A, .along = A > 0 ? ms_vec3_dot(v, a) / A : 0, .side = {v[0], v[1], v[2]}};
  if (A > 0) ms_vec3_axpy(-of.along / A, a, of.side);
  of.across = ms_vec3_norm(of.side);
  for (int c = 0; c < 3; c++) displacement[c] = 0;
  if (F <= 0) advance_uniformly(a, t, v, displacement);
  else if (A == 0 || of.across <= 1e-9 * speed || speed <= STILL * t * A)
    slide_straight(a, F, t, v, displacement);
  else slide_curved(a, F, t, &of, v, dx);
}
