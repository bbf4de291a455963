#include "scene/motions.h"

#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "base/vector.h"

const char *const ms_motion_interpolations[2] = {"linear", "cubic"};

/*------------------------------------- interpolation --------------------------------------------*/

static const double *point(const ms_motion *m, int32_t k, int32_t i) {
  return m->x + 3 * ((size_t)k * (size_t)m->n + (size_t)i);
}

/* Times that differ by less are the same: sums of steps are rounded. */
static double find_rounding(double t) { return 1e-12 * fabs(t); }

/* The last knot before the instant, or at it; -1: none */
static int32_t find_interval(const ms_motion *m, ms_instant at) {
  const double t = at.t + (at.before ? -find_rounding(at.t) : find_rounding(at.t));
  int32_t low = -1, high = m->nt;
  while (high - low > 1) {
    const int32_t middle = (low + high) / 2;
    if (m->t[middle] <= t) low = middle;
    else high = middle;
  }
  return low;
}

/* The slope of the parabola through three points: (d0/h0 h1 + d1/h1 h0)/(h0 + h1) */
static double find_slope(const ms_motion *m, int32_t k, int32_t i, int c) {
  if (k == 0 || k == m->nt - 1) return 0;
  const double h0 = m->t[k] - m->t[k - 1], h1 = m->t[k + 1] - m->t[k];
  const double d0 = point(m, k, i)[c] - point(m, k - 1, i)[c],
               d1 = point(m, k + 1, i)[c] - point(m, k, i)[c];
  return (d0 / h0 * h1 + d1 / h1 * h0) / (h0 + h1);
}

static void interpolate_interval(const ms_motion *m, int32_t k, int32_t i, double t, double x[3],
                                 double v[3]) {
  const double H = m->t[k + 1] - m->t[k], s = fmin(fmax((t - m->t[k]) / H, 0), 1), u = 1 - s;
  for (int c = 0; c < 3; c++) {
    const double x0 = point(m, k, i)[c], d = point(m, k + 1, i)[c] - x0;
    x[c] = x0 + s * d, v[c] = d / H;
    if (m->interpolation != MSIM_MOTION_CUBIC) continue;
    const double v0 = find_slope(m, k, i, c), v1 = find_slope(m, k + 1, i, c);
    x[c] = x0 + s * s * (3 - 2 * s) * d + H * s * u * (u * v0 - s * v1);
    v[c] = 6 * s * u * d / H + u * (1 - 3 * s) * v0 + s * (3 * s - 2) * v1;
  }
}

void ms_motion_evaluate(const ms_motion *motion, int32_t i, ms_instant at, double x[3],
                        double v[3]) {
  const int32_t k = find_interval(motion, at);
  if (k >= 0 && k < motion->nt - 1) {
    interpolate_interval(motion, k, i, at.t, x, v);
    return;
  }
  memcpy(x, point(motion, k < 0 ? 0 : k, i), 3 * sizeof *x);
  v[0] = v[1] = v[2] = 0;
}

/* x'' = ((6 - 12 s) (x1 - x0) + H ((6 s - 4) v0 + (6 s - 2) v1))/H^2 */
static void find_interval_acceleration(const ms_motion *m, int32_t k, int32_t i, double s,
                                       double a[3]) {
  const double H = m->t[k + 1] - m->t[k];
  for (int c = 0; c < 3; c++) {
    const double d = point(m, k + 1, i)[c] - point(m, k, i)[c];
    const double v0 = find_slope(m, k, i, c), v1 = find_slope(m, k + 1, i, c);
    a[c] = ((6 - 12 * s) * d / H + (6 * s - 4) * v0 + (6 * s - 2) * v1) / H;
  }
}

void ms_motion_find_acceleration(const ms_motion *motion, int32_t i, ms_instant at, double a[3]) {
  const int32_t k = find_interval(motion, at);
  a[0] = a[1] = a[2] = 0;
  if (k < 0 || k >= motion->nt - 1 || motion->interpolation != MSIM_MOTION_CUBIC) return;
  const double s = (at.t - motion->t[k]) / (motion->t[k + 1] - motion->t[k]);
  find_interval_acceleration(motion, k, i, fmin(fmax(s, 0), 1), a);
}

/* x' is a quadratic, with Bernstein coefficients v0, 3 (x1 - x0)/H - v0 - v1 and v1; x'' is
 * linear. */
static void add_interval_bounds(const ms_motion *m, int32_t k, int32_t i, ms_motion_bounds *b) {
  const double H = m->t[k + 1] - m->t[k];
  double v[3][3], a[2][3];
  for (int c = 0; c < 3; c++) {
    const double mean = (point(m, k + 1, i)[c] - point(m, k, i)[c]) / H;
    v[0][c] = v[1][c] = v[2][c] = mean;
    if (m->interpolation != MSIM_MOTION_CUBIC) continue;
    v[0][c] = find_slope(m, k, i, c), v[2][c] = find_slope(m, k + 1, i, c);
    v[1][c] = 3 * mean - v[0][c] - v[2][c];
  }
  for (int j = 0; j < 3; j++) b->speed = fmax(b->speed, ms_vec3_norm(v[j]));
  for (int j = 0; j < 2 && m->interpolation == MSIM_MOTION_CUBIC; j++) {
    find_interval_acceleration(m, k, i, j, a[j]);
    b->acceleration = fmax(b->acceleration, ms_vec3_norm(a[j]));
  }
}

ms_motion_bounds ms_motion_find_bounds(const ms_motion *motion) {
  ms_motion_bounds b = {0};
  for (int32_t k = 0; k + 1 < motion->nt; k++)
    for (int32_t i = 0; i < motion->n; i++) add_interval_bounds(motion, k, i, &b);
  return b;
}

double ms_motion_next_time(const ms_motion *motion, double t) {
  const int32_t k = find_interval(motion, (ms_instant){.t = t}) + 1;
  return k < motion->nt ? motion->t[k] : INFINITY;
}

double ms_motion_find_speed(const ms_motion *motion) {
  double most = 0;
  for (int32_t k = 0; k + 1 < motion->nt; k++)
    for (int32_t i = 0; i < motion->n; i++) {
      double d[3];
      for (int c = 0; c < 3; c++) d[c] = point(motion, k + 1, i)[c] - point(motion, k, i)[c];
      most = fmax(most, ms_vec3_norm(d) / (motion->t[k + 1] - motion->t[k]));
    }
  return most;
}

/*------------------------------------- checks ---------------------------------------------------*/

msim_status ms_motion_check_times(int32_t nt, const double *t, int32_t interpolation,
                                  msim_error *err) {
  if (interpolation != MSIM_MOTION_LINEAR && interpolation != MSIM_MOTION_CUBIC)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "interpolation is %d; it must be MSIM_MOTION_LINEAR or MSIM_MOTION_CUBIC",
                        interpolation);
  for (int32_t k = 0; k < nt; k++) {
    if (!isfinite(t[k]))
      return ms_error_set(err, MSIM_ERR_ARG, "t[%d] is %g; it must be finite", k, t[k]);
    if (k > 0 && !(t[k] > t[k - 1]))
      return ms_error_set(err, MSIM_ERR_ARG, "t[%d] is %g; it must exceed t[%d] = %g", k, t[k],
                          k - 1, t[k - 1]);
  }
  return MSIM_OK;
}

msim_status ms_motion_check_range(const char *what, const ms_motion *m, msim_error *err) {
  const size_t row = 3 * (size_t)m->n;
  for (int32_t k = 0; k < m->nt; k++)
    for (size_t i = 0; i < row; i++) {
      const double *x = m->x + (size_t)k * row + i;
      const double speed = k > 0 ? fabs(*x - *(x - row)) / (m->t[k] - m->t[k - 1]) : 0;
      if (!(fabs(*x) <= MS_LARGEST_VALID))
        return ms_error_set(err, MSIM_ERR_ARG,
                            "%s[%d] contains %g, whose square is beyond the range of double; use "
                            "smaller numbers",
                            what, k, *x);
      if (!(speed <= MS_LARGEST_VALID))
        return ms_error_set(err, MSIM_ERR_ARG,
                            "%s[%d] is reached at a speed of %g, whose square is beyond the range "
                            "of double; use times t that lie further apart",
                            what, k, speed);
    }
  return MSIM_OK;
}

int ms_motion_is_equal(const ms_motion *a, const ms_motion *b) {
  const size_t n = (size_t)a->n, nt = (size_t)a->nt;
  if (a->n != b->n || a->nt != b->nt || a->interpolation != b->interpolation) return 0;
  if (nt == 0) return 1;
  return (!a->particles || memcmp(a->particles, b->particles, n * sizeof *a->particles) == 0) &&
         memcmp(a->t, b->t, nt * sizeof *a->t) == 0 &&
         memcmp(a->x, b->x, 3 * n * nt * sizeof *a->x) == 0;
}

/*------------------------------------- storage --------------------------------------------------*/

void ms_motion_free(const msim_allocator *alloc, ms_motion *motion) {
  MS_FREE(alloc, motion->particles, motion->t, motion->x);
  *motion = (ms_motion){0};
}

msim_status ms_motion_copy(const msim_allocator *alloc, const ms_motion *from, ms_motion *to,
                           msim_error *err) {
  const size_t n = (size_t)from->n, nt = (size_t)from->nt;
  *to = (ms_motion){.n = from->n, .nt = from->nt, .interpolation = from->interpolation};
  if ((from->particles && !MS_NEW(alloc, to->particles, n)) || !MS_NEW(alloc, to->t, nt) ||
      !MS_NEW(alloc, to->x, 3 * n * nt)) {
    ms_motion_free(alloc, to);
    return ms_error_set_memory(err, "a motion");
  }
  if (from->particles) memcpy(to->particles, from->particles, n * sizeof *to->particles);
  memcpy(to->t, from->t, nt * sizeof *to->t);
  memcpy(to->x, from->x, 3 * n * nt * sizeof *to->x);
  return MSIM_OK;
}
