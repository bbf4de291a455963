/* Tests of proximity: distances of points and triangles and of edges against a search over their
 * points, also where they are flat, parallel or without length; and collisions on straight paths
 * against distances at many times. */
#include <math.h>
#include <string.h>

#include "contact/proximity.h"
#include "testing.h"

enum { PAIRS = 4000 };

static const ms_feature_kind kinds[] = {MS_POINT_TRIANGLE, MS_EDGE_EDGE};

/* The distance of the points with these parameters: u of the point of A, (s, t) of that of B */
static double distance_at(ms_feature_kind kind, double x[4][3], double u, double s, double t) {
  double square = 0;
  for (int i = 0; i < 3; i++) {
    const double d = kind == MS_EDGE_EDGE
                         ? (1 - u) * x[0][i] + u * x[1][i] - (1 - s) * x[2][i] - s * x[3][i]
                         : x[0][i] - (1 - s - t) * x[1][i] - s * x[2][i] - t * x[3][i];
    square += d * d;
  }
  return sqrt(square);
}

typedef struct search {
  ms_feature_kind kind;
  double (*x)[3];
  double outer;
} search;

static double at_inner(search *s, double inner) {
  return s->kind == MS_EDGE_EDGE ? distance_at(s->kind, s->x, s->outer, inner, 0)
                                 : distance_at(s->kind, s->x, 0, s->outer, inner);
}

/* The minimum of a convex function by ternary search */
static double minimize(search *s, double high, double (*f)(search *s, double at)) {
  double low = 0;
  for (int i = 0; i < 60; i++) {
    const double p = low + (high - low) / 3, q = high - (high - low) / 3;
    if (f(s, p) < f(s, q)) high = q;
    else low = p;
  }
  return f(s, (low + high) / 2);
}

static double at_outer(search *s, double outer) {
  s->outer = outer;
  return minimize(s, s->kind == MS_EDGE_EDGE ? 1 : 1 - outer, at_inner);
}

/* The distance is a convex function of both parameters, and so is its minimum over one of them. */
static double search_distance(ms_feature_kind kind, double x[4][3]) {
  return minimize(&(search){kind, x, 0}, 1, at_outer);
}

/* Corners in a unit cube. In turn: any; flat or parallel; with two equal corners; nearly flat */
static void make_corners(unsigned *seed, int i, double x[4][3]) {
  for (int c = 0; c < 4; c++)
    for (int k = 0; k < 3; k++) x[c][k] = uniform(seed);
  if (i % 4 == 2) memcpy(x[3], x[2], sizeof x[3]);
  if (i % 4 != 1 && i % 4 != 3) return;
  const double by = 0.1 + uniform(seed), off = i % 4 == 3 ? 1e-7 * uniform(seed) : 0;
  for (int k = 0; k < 3; k++)
    x[3][k] = x[2][k] + by * (i & 4 ? x[1][k] - x[0][k] : x[2][k] - x[1][k]) + off;
}

static void check_weights(ms_feature_kind kind, double x[4][3], const ms_proximity *at) {
  double a = 0, b = 0;
  for (int c = 0; c < 4; c++) {
    if (c < (int)kind) a += at->weight[c];
    else b -= at->weight[c];
    assert_true(c < (int)kind ? at->weight[c] >= 0 : at->weight[c] <= 0);
  }
  assert_close(a, 1, 1e-15);
  assert_close(b, 1, 1e-15);
  for (int i = 0; i < 3; i++) {
    double r = 0;
    for (int c = 0; c < 4; c++) r += at->weight[c] * x[c][i];
    assert_close(r, at->distance * at->normal[i], 1e-14);
  }
}

static void distances_are_the_least(void **state) {
  (void)state;
  unsigned seed = 1;
  for (int i = 0; i < 2 * PAIRS; i++) {
    double x[4][3];
    make_corners(&seed, i / 2, x);
    const ms_proximity at = ms_proximity_find(kinds[i % 2], x);
    assert_close(at.distance, search_distance(kinds[i % 2], x), 1e-7);
    check_weights(kinds[i % 2], x, &at);
  }
}

/* Corners at rest, or moving together, do not collide; through each other they do. */
static void closed_forms(void **state) {
  (void)state;
  double x0[4][3] = {{0.2, 0.2, 1}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, x1[4][3];
  ms_proximity at;
  assert_close(ms_proximity_find(MS_POINT_TRIANGLE, x0).distance, 1, 1e-15);
  memcpy(x1, x0, sizeof x1);
  assert_false(ms_proximity_collides(MS_POINT_TRIANGLE, x0, x1, 0.01, &at));
  for (int c = 0; c < 4; c++) x1[c][2] -= 1e6;
  assert_false(ms_proximity_collides(MS_POINT_TRIANGLE, x0, x1, 0.01, &at));
  memcpy(x1, x0, sizeof x1);
  x1[0][2] = -1;
  assert_true(ms_proximity_collides(MS_POINT_TRIANGLE, x0, x1, 0.01, &at));
  assert_close(at.normal[2], 1, 1e-12);
  assert_true(at.distance > 0.01 && at.distance <= 0.02);
  x1[0][2] = 0.03; /* it stops in front of it */
  assert_false(ms_proximity_collides(MS_POINT_TRIANGLE, x0, x1, 0.01, &at));
}

/* The least distance of 2000 times on the path */
static double least_on_way(ms_feature_kind kind, double x0[4][3], double x1[4][3]) {
  double least = INFINITY;
  for (int n = 0; n <= 2000; n++) {
    double x[4][3];
    const double t = n / 2000.;
    for (int k = 0; k < 12; k++)
      x[k / 3][k % 3] = x0[k / 3][k % 3] + t * (x1[k / 3][k % 3] - x0[k / 3][k % 3]);
    least = fmin(least, ms_proximity_find(kind, x).distance);
  }
  return least;
}

/* No path that is found free comes closer than `least`, and none is refused that stays farther away
 * than the distance at which the method stops. */
static void collisions_are_found(void **state) {
  (void)state;
  unsigned seed = 7;
  int counts[2] = {0};
  for (int i = 0; i < PAIRS; i++) {
    const ms_feature_kind kind = kinds[i % 2];
    const double speed = pow(10, 2 * uniform(&seed) - 1), step = 1e-3 * 4 * speed;
    double x0[4][3], x1[4][3];
    ms_proximity at;
    make_corners(&seed, i / 2, x0);
    for (int k = 0; k < 12; k++)
      x1[k / 3][k % 3] = x0[k / 3][k % 3] + speed * (uniform(&seed) - 0.5);
    const double d0 = ms_proximity_find(kind, x0).distance, least = fmin(0.01, d0 / 2);
    if (d0 < 1e-9) continue;
    const double there = least_on_way(kind, x0, x1), stop = ms_proximity_stop(d0, least);
    const int found = ms_proximity_collides(kind, x0, x1, least, &at);
    counts[found]++;
    if (found) assert_true(there <= stop + step);
    else assert_true(there > least);
    if (found) assert_true(at.distance > least && at.distance <= stop);
  }
  assert_true(counts[0] > PAIRS / 50 && counts[1] > PAIRS / 50);
}

/* A plane that separates both at the start and at the end */
static void gaps_are_bounds(void **state) {
  (void)state;
  unsigned seed = 3;
  for (int i = 0; i < PAIRS; i++) {
    double x[4][3];
    make_corners(&seed, i / 2, x);
    const ms_feature_kind kind = kinds[i % 2];
    const ms_proximity at = ms_proximity_find(kind, x);
    const double n[3] = {at.normal[0], at.normal[1], at.normal[2]};
    if (at.distance > 1e-6) assert_close(ms_proximity_find_gap(kind, x, n), at.distance, 1e-9);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(distances_are_the_least), cmocka_unit_test(closed_forms),
      cmocka_unit_test(collisions_are_found), cmocka_unit_test(gaps_are_bounds)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
