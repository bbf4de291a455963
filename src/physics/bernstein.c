#include "physics/bernstein.h"

#include <float.h>
#include <math.h>

ms_bernstein ms_bernstein_cubic(double s0, double slope0, double s1, double slope1) {
  return (ms_bernstein){3, {s0, s0 + slope0 / 3, s1 - slope1 / 3, s1}};
}

ms_bernstein ms_bernstein_quintic(double s0, double slope0, double bend0, double s1, double slope1,
                                  double bend1) {
  return (ms_bernstein){5,
                        {s0, s0 + slope0 / 5, s0 + 0.4 * slope0 + bend0 / 20,
                         s1 - 0.4 * slope1 + bend1 / 20, s1 - slope1 / 5, s1}};
}

void ms_bernstein_elevate(ms_bernstein *s) {
  const int n = ++s->degree;
  s->c[n] = s->c[n - 1];
  for (int i = n - 1; i > 0; i--) s->c[i] += (double)i / n * (s->c[i - 1] - s->c[i]);
}

/* De Casteljau's algorithm: subdivision at q; the last coefficient of `left` is s(q). Coefficients
 * are handed on in `here`, as vectors of those just stored could not be loaded at once. */
static void subdivide(const ms_bernstein *s, double q, ms_bernstein *left, ms_bernstein *right) {
  const int n = s->degree;
  *right = *s;
  left->degree = n;
  for (int i = 0; i <= n; i++) {
    double here = left->c[i] = right->c[0];
    for (int k = 0; k < n - i; k++) {
      const double next = right->c[k + 1];
      right->c[k] = here + q * (next - here), here = next;
    }
  }
}

double ms_bernstein_evaluate(const ms_bernstein *s, double q) {
  ms_bernstein left, right;
  subdivide(s, q, &left, &right);
  return right.c[0];
}

/* ds/dq has the coefficients n (s_(i+1) - s_i). */
double ms_bernstein_evaluate_slope(const ms_bernstein *s, double q) {
  ms_bernstein slope = {.degree = s->degree - 1};
  for (int i = 0; i < s->degree; i++) slope.c[i] = s->degree * (s->c[i + 1] - s->c[i]);
  return ms_bernstein_evaluate(&slope, q);
}

double ms_bernstein_lower_bound(const ms_bernstein *s) {
  double least = s->c[0];
  for (int i = 1; i <= s->degree; i++) least = fmin(least, s->c[i]);
  return least;
}

static int count_sign_changes(const ms_bernstein *s) {
  int count = 0;
  for (int i = 0; i < s->degree; i++) count += (s->c[i] > 0) != (s->c[i + 1] > 0);
  return count;
}

/* The only root of an s with s(0) > 0 > s(1): the Illinois method, false position with halved
 * values (Dowell and Jarratt, BIT 11 (1971) 168). */
static double find_single_root(const ms_bernstein *s) {
  enum { MOST = 100 };
  double lo = 0, hi = 1, above = s->c[0], below = s->c[s->degree];
  int side = 0;
  for (int i = 0; i < MOST && hi - lo > DBL_EPSILON * hi; i++) {
    double q = lo + (hi - lo) * above / (above - below);
    if (!(q > lo && q < hi)) q = 0.5 * (lo + hi);
    const double value = ms_bernstein_evaluate(s, q);
    if (value == 0) return q;
    if (value > 0) {
      lo = q, above = value;
      if (side > 0) below /= 2;
    } else {
      hi = q, below = value;
      if (side < 0) above /= 2;
    }
    side = value > 0 ? 1 : -1;
  }
  return hi;
}

/* s covers [from, from + width] of the original polynomial; the result refers to the latter. */
static double find_crossing_in(const ms_bernstein *s, double tolerance, double from, double width) {
  const double NARROWEST = 1e-14;
  if (!(ms_bernstein_lower_bound(s) < -tolerance)) return MS_NOWHERE;
  if (s->c[0] <= 0 || width < NARROWEST) return from;
  if (s->c[s->degree] < 0 && count_sign_changes(s) == 1) return from + width * find_single_root(s);
  ms_bernstein left, right;
  subdivide(s, 0.5, &left, &right);
  const double q = find_crossing_in(&left, tolerance, from, width / 2);
  return q <= 1 ? q : find_crossing_in(&right, tolerance, from + width / 2, width / 2);
}

/* s - s(0) = q r(q) with r_i = n/(i + 1) (s_(i+1) - s_0) */
double ms_bernstein_find_crossing(const ms_bernstein *s, double tolerance) {
  if (s->c[0] > tolerance) return find_crossing_in(s, tolerance, 0, 1);
  const int n = s->degree;
  ms_bernstein r = {.degree = n - 1};
  for (int i = 0; i < n; i++) r.c[i] = (s->c[i + 1] - s->c[0]) * n / (i + 1);
  return find_crossing_in(&r, tolerance, 0, 1);
}
