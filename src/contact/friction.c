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

/* u0^-p times the integral of u^(p-1) from u0 e^d to u0 */
static double power_integral(double p, double d) {
  return fabs(p) > 1e-12 ? -expm1(p * d) / p : -d;
}

/* d with power_integral(p, d) = value; -INFINITY: there is none */
static double invert_power_integral(double p, double value) {
  if (fabs(p) <= 1e-12) return -value;
  return p * value < 1 ? log1p(-p * value) / p : -INFINITY;
}

/* d = ln(u/u0) <= 0 after the time t: power_integral(k - 1, d) + E power_integral(k + 1, d) = t A
 * (1 + E)/|v| =: time with E = u0^2. Newton's method between bounds; each term alone gives a lower
 * bound. */
static double find_log_tangent(double k, double E, double time) {
  enum { MOST = 100 };
  double high = 0,
         low = fmax(invert_power_integral(k - 1, time), invert_power_integral(k + 1, time / E));
  double d = low = fmax(low, -700 / fabs(k - 1)); /* so that exp((k - 1) d) does not overflow */
  for (int i = 0; i < MOST; i++) {
    const double off = power_integral(k - 1, d) + E * power_integral(k + 1, d) - time;
    if (off > 0) low = d;
    else high = d;
    double next = d + off / (exp((k - 1) * d) + E * exp((k + 1) * d));
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (fabs(next - d) <= DBL_EPSILON * fmax(1, fabs(d))) return next;
    d = next;
  }
  return d;
}

/* The components of v along a and across it */
typedef struct components {
  double A, along, across; /* |a|, v.a/A, |side| */
  double side[3];
} components;

/* v and a are not parallel. */
static void slide_curved(const double a[3], double F, double t, const components *of, double v[3],
                         double dx[3]) {
  const double A = of->A, along = of->along, across = of->across, *side = of->side;
  const double speed = ms_vec3_norm(v), k = F / A;
  const double u0 = along > 0 ? across / (speed + along) : (speed - along) / across, E = u0 * u0;
  const double stop = ms_friction_stop(a, F, v), q = speed / (1 + E);
  const double d = t < stop ? find_log_tangent(k, E, t * A / q) : -INFINITY;
  const double u = u0 * exp(d), size = t < stop ? q * exp((k - 1) * d) : 0;
  const double x =
      q * q / A * (power_integral(2 * k - 2, d) - E * E * power_integral(2 * k + 2, d));
  const double y =
      2 * q * q * u0 / A * (power_integral(2 * k - 1, d) + E * power_integral(2 * k + 1, d));
  for (int c = 0; c < 3; c++) {
    dx[c] += x / A * a[c] + y / across * side[c];
    v[c] = size * ((1 - u * u) / A * a[c] + 2 * u / across * side[c]);
  }
}

void ms_friction_slide(const double a[3], double F, double t, double v[3], double dx[3]) {
  const double A = ms_vec3_norm(a), speed = ms_vec3_norm(v);
  double unused[3], *way = dx ? dx : unused;
  components of = {.A = A, .along = A > 0 ? ms_vec3_dot(v, a) / A : 0, .side = {v[0], v[1], v[2]}};
  if (A > 0) ms_vec3_axpy(-of.along / A, a, of.side);
  of.across = ms_vec3_norm(of.side);
  for (int c = 0; c < 3; c++) way[c] = 0;
  if (F <= 0) advance_uniformly(a, t, v, way);
  else if (A == 0 || of.across <= 1e-9 * speed || speed <= STILL * t * A)
    slide_straight(a, F, t, v, way);
  else slide_curved(a, F, t, &of, v, way);
}
