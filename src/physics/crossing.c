#include "physics/crossing.h"

#include <math.h>

ms_cubic ms_cubic_between(double s0, double slope0, double s1, double slope1) {
  const double rise = s1 - s0;
  return (ms_cubic){{s0, slope0, 3 * rise - 2 * slope0 - slope1, slope0 + slope1 - 2 * rise}};
}

double ms_cubic_at(const ms_cubic *s, double q) {
  return s->c[0] + q * (s->c[1] + q * (s->c[2] + q * s->c[3]));
}

double ms_cubic_slope(const ms_cubic *s, double q) {
  return s->c[1] + q * (2 * s->c[2] + q * 3 * s->c[3]);
}

/* The roots of a q^2 + 2 b q + c, the smaller one first, without cancellation; how many. */
static int solve_quadratic(double a, double b, double c, double root[2]) {
  const double d = b * b - a * c;
  if (!(d > 0)) return 0;
  const double t = b > 0 ? -b - sqrt(d) : -b + sqrt(d);
  if (a == 0) {
    root[0] = c / t; /* t = -2 b */
    return 1;
  }
  const double p = c / t, r = t / a;
  root[0] = fmin(p, r), root[1] = fmax(p, r);
  return 2;
}

/* s falls from above 0 at lo to below 0 at hi. Newton's method, kept between the two. */
static double find_root(const ms_cubic *s, double lo, double hi) {
  enum { MOST = 100 };
  double q = 0.5 * (lo + hi);
  for (int i = 0; i < MOST; i++) {
    const double value = ms_cubic_at(s, q);
    if (value > 0) lo = q;
    else hi = q;
    double next = q - value / ms_cubic_slope(s, q);
    if (!(next >= lo && next <= hi)) next = 0.5 * (lo + hi);
    if (next == q) break;
    q = next;
  }
  return q;
}

/* A cubic lies between the least and the largest of its Bezier points. */
static int may_fall_below(const ms_cubic *s, double depth) {
  const double *c = s->c, first = c[0] + c[1] / 3, second = first + (c[1] + c[2]) / 3;
  return fmin(fmin(c[0], first), fmin(second, c[0] + c[1] + c[2] + c[3])) < -depth;
}

double ms_first_crossing(const ms_cubic *s, double from, double depth) {
  double knot[4] = {from}, turn[2];
  int last = 0;
  if (!may_fall_below(s, depth)) return MS_NOWHERE;
  const int turns = solve_quadratic(3 * s->c[3], s->c[2], s->c[1], turn);
  for (int i = 0; i < turns; i++)
    if (turn[i] > from && turn[i] < 1) knot[++last] = turn[i];
  knot[++last] = 1;
  for (int i = 0; i < last; i++)
    if (ms_cubic_at(s, knot[i + 1]) < -depth)
      return ms_cubic_at(s, knot[i]) > 0 ? find_root(s, knot[i], knot[i + 1]) : knot[i];
  return MS_NOWHERE;
}
