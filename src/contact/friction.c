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

/* d = ln(u/u0) <= 0 after the time t: power_integral(k - 1, d) + E power_integral(k + 1, d) = t A
 * (1 + E)/|v| =: time with E = u0^2. Newton's method between bounds, from the root of the terms of
 * the second order in d; each term alone gives a lower bound. A change e of d leaves an error of
 * (k + 1) e^2/2 at most. */
static double find_log_tangent(double k, double E, double time) {
  enum { MOST = 100 };
  const double SMALL = 1e-8, s = time / (1 + E), bend = (k - 1 + E * (k + 1)) / (1 + E);
  double high = 0,
         low = fmax(invert_power_integral(k - 1, time), invert_power_integral(k + 1, time / E));
  low = fmax(low, -700 / fabs(k - 1)); /* so that exp((k - 1) d) does not overflow */
  double d = fmax(low, fmin(0, -s - 0.5 * bend * s * s));
  for (int i = 0; i < MOST; i++) {
    double rate[2];
    const double off =
        power_integral(k - 1, d, &rate[0]) + E * power_integral(k + 1, d, &rate[1]) - time;
    if (off > 0) low = d;
    else high = d;
    const double change = off / (rate[0] + E * rate[1]);
    if (fabs(change) <= SMALL * fabs(d) && fabs(change) * (k + 1) <= SMALL) return d + change;
    d = d + change > low && d + change < high ? d + change : 0.5 * (low + high);
  }
  return d;
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
