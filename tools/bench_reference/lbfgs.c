/* L-BFGS with the prefactored matrix as the initial Hessian approximation (Liu, Bouaziz and Kavan
 * 2017). */
#include <math.h>
#include <string.h>

#include "prefactored_descent.h"

/* Eight partial sums, so that the additions do not depend on each other. */
static double lbfgs_dot(size_t n, const double *restrict a, const double *restrict b) {
  double sum[8] = {0}, rest = 0;
  const size_t whole = n - n % 8;
  for (size_t i = 0; i < whole; i += 8)
    for (size_t k = 0; k < 8; k++) sum[k] += a[i + k] * b[i + k];
  for (size_t i = whole; i < n; i++) rest += a[i] * b[i];
  return ((sum[0] + sum[1]) + (sum[2] + sum[3])) + ((sum[4] + sum[5]) + (sum[6] + sum[7])) + rest;
}

/* y += a x */
static void add_scaled(size_t n, double a, const double *restrict x, double *restrict y) {
  for (size_t i = 0; i < n; i++) y[i] += a * x[i];
}

/* direction = H grad P by the two-loop recursion, which visits the pairs from the newest to the
 * oldest and back (Nocedal 1980); H is the inverse Hessian approximation. next: scratch. */
static int find_lbfgs_direction(descent *d) {
  const int64_t oldest = d->pairs > PAIRS ? d->pairs - PAIRS : 0;
  double a[PAIRS + 1];
  memcpy(d->next, d->gradient, d->length * sizeof *d->next);
  for (int64_t i = d->pairs - 1; i >= oldest; i--) {
    const int at = (int)(i % (PAIRS + 1));
    a[at] = lbfgs_dot(d->length, d->s[at], d->next) / d->curvature[at];
    add_scaled(d->length, -a[at], d->y[at], d->next);
  }
  if (laplacian_solve(d->p->matrix, d->next, d->direction) != MSIM_OK) return 0;
  for (int64_t i = oldest; i < d->pairs; i++) {
    const int at = (int)(i % (PAIRS + 1));
    const double b = lbfgs_dot(d->length, d->y[at], d->direction) / d->curvature[at];
    add_scaled(d->length, a[at] - b, d->s[at], d->direction);
  }
  return 1;
}

/* Armijo condition P(x - t d) <= P(x) - c t slope, where slope = grad P(x) . d and c = 0.3. Where
 * rounding hides the change of P, the approximate Wolfe condition of Hager and Zhang (2005):
 * -grad P(x - t d) . d <= (1 - 2 c) slope. */
static int is_lower(const descent *d, double t, double slope, double value,
                    const double *gradient) {
  const double ENOUGH = 0.3, HIDDEN = 1e-9;
  if (value <= d->value - ENOUGH * t * slope) return 1;
  return value <= d->value + HIDDEN * fabs(d->value) &&
         -lbfgs_dot(d->length, gradient, d->direction) <= (1 - 2 * ENOUGH) * slope;
}

/* Backtracking: s = -t direction for the first t of 1, 1/2, ... that is_lower accepts;
 * next = x + s, y = the gradient there. */
static int search_line(descent *d, double *s, double *y) {
  enum { MOST = 40 };
  const double slope = lbfgs_dot(d->length, d->gradient, d->direction);
  double t = 1;
  for (int i = 0; i < MOST; i++, t *= 0.5) {
    for (size_t k = 0; k < d->length; k++) {
      s[k] = -t * d->direction[k];
      d->next[k] = d->x[k] + s[k];
    }
    const double value = potential_at(d->p, d->next, y);
    if (!is_lower(d, t, slope, value, y)) continue;
    d->value = value;
    return 1;
  }
  return 0;
}

/* Moves x and its gradient to `next`. y: on input the gradient there, on output its change. */
static void move_to_next(descent *d, double *restrict y) {
  double *restrict g = d->gradient, *restrict x = d->x;
  for (size_t k = 0; k < d->length; k++) {
    const double after = y[k];
    y[k] = after - g[k];
    g[k] = after;
    x[k] = d->next[k];
  }
}

static void lbfgs_begin(descent *d) {
  memcpy(d->x, d->p->y, d->length * sizeof *d->x);
  d->value = potential_at(d->p, d->x, d->gradient);
  d->pairs = 0;
}

/* A pair with y.s <= 0 is discarded, so that H stays positive definite. */
static int lbfgs_iterate(descent *d) {
  const int at = (int)(d->pairs % (PAIRS + 1));
  double *s = d->s[at], *y = d->y[at];
  if (!find_lbfgs_direction(d) || !search_line(d, s, y)) return 0;
  move_to_next(d, y);
  d->curvature[at] = lbfgs_dot(d->length, s, y);
  d->pairs += d->curvature[at] > 0;
  return 1;
}

const descent_method lbfgs = {"L-BFGS", lbfgs_begin, lbfgs_iterate};
