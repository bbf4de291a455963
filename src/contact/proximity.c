#include "contact/proximity.h"

#include <string.h>

#include "base/vec3.h"

static void subtract(const double a[3], const double b[3], double d[3]) {
  for (int c = 0; c < 3; c++) d[c] = a[c] - b[c];
}

static double clamp_to_unit(double t) { return t > 0 ? fmin(t, 1) : 0; }

/* The least distance so far, squared, and r = sum_c w_c x_c */
typedef struct closest {
  double square, r[3], weight[4];
} closest;

static void keep_closer(const double r[3], double w0, double w1, double w2, double w3,
                        closest *best) {
  const double square = ms_vec3_dot(r, r);
  if (!(square < best->square)) return;
  *best = (closest){square, {r[0], r[1], r[2]}, {w0, w1, w2, w3}};
}

/* From the point of the edge i j that is nearest to the point p to p; returns its share on the path
 * from i to j. */
static double find_offset_from_edge(double x[4][3], int p, int i, int j, double offset[3]) {
  double edge[3];
  subtract(x[j], x[i], edge), subtract(x[p], x[i], offset);
  const double square = ms_vec3_dot(edge, edge);
  const double t = square > 0 ? clamp_to_unit(ms_vec3_dot(edge, offset) / square) : 0;
  ms_vec3_axpy(-t, edge, offset);
  return t;
}

enum { IS_FLAT = 0, IS_INSIDE = 1, IS_OUTSIDE = 2 };

/* The projection of the point to the plane of the triangle, if it lies inside: barycentric
 * coordinates u = ((p - a) x e2).n/n^2, v = (e1 x (p - a)).n/n^2, n = e1 x e2. Returns IS_INSIDE if
 * these are accurate. */
static int try_inner_point(double x[4][3], closest *best) {
  const double FLAT = 1e-8; /* sin^2 of the angle of a triangle that is too sharp */
  double e1[3], e2[3], q[3], n[3], qe2[3], e1q[3];
  subtract(x[2], x[1], e1), subtract(x[3], x[1], e2), subtract(x[0], x[1], q);
  ms_vec3_cross(e1, e2, n), ms_vec3_cross(q, e2, qe2), ms_vec3_cross(e1, q, e1q);
  const double square = ms_vec3_dot(n, n);
  if (!(square > 0)) return IS_FLAT;
  const double u = ms_vec3_dot(qe2, n) / square, v = ms_vec3_dot(e1q, n) / square;
  if (!(u >= 0 && v >= 0 && u + v <= 1)) return IS_OUTSIDE;
  ms_vec3_axpy(-u, e1, q), ms_vec3_axpy(-v, e2, q);
  keep_closer(q, 1, u + v - 1, -u, -v, best);
  return square > FLAT * ms_vec3_dot(e1, e1) * ms_vec3_dot(e2, e2) ? IS_INSIDE : IS_FLAT;
}

static void find_point_and_triangle(double x[4][3], closest *best) {
  double r[3];
  if (try_inner_point(x, best) == IS_INSIDE) return;
  double t = find_offset_from_edge(x, 0, 1, 2, r);
  keep_closer(r, 1, t - 1, -t, 0, best);
  t = find_offset_from_edge(x, 0, 2, 3, r);
  keep_closer(r, 1, 0, t - 1, -t, best);
  t = find_offset_from_edge(x, 0, 3, 1, r);
  keep_closer(r, 1, -t, 0, t - 1, best);
}

/* The points of the common perpendicular of the two lines, if they lie inside the edges */
static int try_perpendicular(double x[4][3], closest *best) {
  const double FLAT = 1e-8; /* sin^2 of the angle of edges that are nearly parallel */
  double d1[3], d2[3], r[3];
  subtract(x[1], x[0], d1), subtract(x[3], x[2], d2), subtract(x[0], x[2], r);
  const double a = ms_vec3_dot(d1, d1), b = ms_vec3_dot(d1, d2), e = ms_vec3_dot(d2, d2),
               c = ms_vec3_dot(d1, r), f = ms_vec3_dot(d2, r), determinant = a * e - b * b;
  if (!(determinant > 0)) return IS_FLAT;
  const double s = (b * f - c * e) / determinant, t = (b * s + f) / e;
  if (!(s >= 0 && s <= 1 && t >= 0 && t <= 1)) return IS_OUTSIDE;
  ms_vec3_axpy(s, d1, r), ms_vec3_axpy(-t, d2, r);
  keep_closer(r, 1 - s, s, t - 1, -t, best);
  return determinant > FLAT * a * e ? IS_INSIDE : IS_FLAT;
}

static void find_edges(double x[4][3], closest *best) {
  double r[3];
  if (try_perpendicular(x, best) == IS_INSIDE) return;
  for (int c = 0; c < 2; c++) {
    const double t = find_offset_from_edge(x, c, 2, 3, r);
    keep_closer(r, 1 - c, c, t - 1, -t, best);
  }
  for (int c = 0; c < 2; c++) {
    const double t = find_offset_from_edge(x, 2 + c, 0, 1, r);
    for (int i = 0; i < 3; i++) r[i] = -r[i];
    keep_closer(r, 1 - t, t, c - 1, -c, best);
  }
}

/* The closest points lie inside both features, or one of them is a corner. Where the first is not
 * certain by far, all of these are tried, so that flat triangles, parallel edges and edges without
 * length are no special cases. */
ms_proximity ms_proximity_find(ms_feature_kind kind, double x[4][3]) {
  closest best = {.square = INFINITY};
  if (kind == MS_POINT_TRIANGLE) find_point_and_triangle(x, &best);
  else find_edges(x, &best);
  ms_proximity at = {.distance = sqrt(best.square)};
  for (int c = 0; c < 3; c++) at.normal[c] = at.distance > 0 ? best.r[c] / at.distance : 0;
  memcpy(at.weight, best.weight, sizeof at.weight);
  return at;
}

double ms_proximity_find_gap(ms_feature_kind kind, double x[4][3], const double n[3]) {
  double least = INFINITY, most = -INFINITY;
  for (int c = 0; c < 4; c++) {
    const double along = ms_vec3_dot(n, x[c]);
    if (c < (int)kind) least = along < least ? along : least;
    else most = along > most ? along : most;
  }
  return least - most;
}

/* Remove the mean of four displacements; returns ms_proximity_bound_change(). */
static double remove_mean(ms_feature_kind kind, double displacement[4][3]) {
  double longest[2] = {0, 0};
  for (int i = 0; i < 3; i++) {
    const double mean =
        (displacement[0][i] + displacement[1][i] + displacement[2][i] + displacement[3][i]) / 4;
    for (int c = 0; c < 4; c++) displacement[c][i] -= mean;
  }
  for (int c = 0; c < 4; c++) {
    const double square = ms_vec3_dot(displacement[c], displacement[c]);
    double *of = &longest[c >= (int)kind];
    *of = square > *of ? square : *of;
  }
  return sqrt(longest[0]) + sqrt(longest[1]);
}

double ms_proximity_bound_change(ms_feature_kind kind, double x0[4][3], double x1[4][3]) {
  double displacement[4][3];
  for (int c = 0; c < 4; c++) subtract(x1[c], x0[c], displacement[c]);
  return remove_mean(kind, displacement);
}

double ms_proximity_stop(double distance, double least) {
  return least + 0.1 * (fmin(distance, 10 * least) - least);
}

int ms_proximity_collides(ms_feature_kind kind, double x0[4][3], double x1[4][3], double least,
                          ms_proximity *at) {
  enum { MOST = 1000 };
  double x[4][3], displacement[4][3], origin[3];
  memcpy(origin, x0[0], sizeof origin);
  for (int c = 0; c < 4; c++)
    subtract(x0[c], origin, x[c]), subtract(x1[c], x0[c], displacement[c]);
  *at = ms_proximity_find(kind, x);
  const double stop = ms_proximity_stop(at->distance, least),
               length = remove_mean(kind, displacement);
  double t = 0;
  for (int i = 0; i < MOST; i++) {
    const double step = 0.9 * (at->distance - least) / length;
    if (!(step < 1 - t)) return 0;
    t += step;
    for (int c = 0; c < 4; c++) ms_vec3_axpy(step, displacement[c], x[c]);
    *at = ms_proximity_find(kind, x);
    if (!(at->distance > stop)) return 1;
  }
  return 1;
}
