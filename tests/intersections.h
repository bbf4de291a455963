/* intersections - counts intersecting pairs of triangles, and segments that pass through triangles,
 * by the signs of volumes and a sweep along one axis: none of the library's code */
#ifndef TEST_INTERSECTIONS_H
#define TEST_INTERSECTIONS_H

#include <math.h>
#include <stdint.h>
#include <stdlib.h>

/* Six times the volume of the tetrahedron a b c d; 0 if that is below what rounding of coordinates
 * in a plane makes of it, which is far more than the rounding here */
static inline double tetrahedron(const double *a, const double *b, const double *c,
                                 const double *d) {
  double u[3], v[3], w[3], size = 0;
  for (int i = 0; i < 3; i++) {
    u[i] = b[i] - a[i], v[i] = c[i] - a[i], w[i] = d[i] - a[i];
    size = fmax(size, fmax(fabs(u[i]), fmax(fabs(v[i]), fabs(w[i]))));
  }
  const double volume = u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) +
                        u[2] * (v[0] * w[1] - v[1] * w[0]);
  return fabs(volume) > 1e-12 * size * size * size ? volume : 0;
}

/* 1: the segment p q passes through the triangle a b c: its ends lie on both sides of the plane,
 * and the line has all edges on one side. Of a surface that passes through another one, some edges
 * do. */
static inline int segment_meets(const double *p, const double *q, const double *a, const double *b,
                                const double *c) {
  const double s = tetrahedron(a, b, c, p), t = tetrahedron(a, b, c, q);
  if (!((s > 0 && t < 0) || (s < 0 && t > 0))) return 0;
  const double u = tetrahedron(p, q, a, b), v = tetrahedron(p, q, b, c),
               w = tetrahedron(p, q, c, a);
  return (u > 0 && v > 0 && w > 0) || (u < 0 && v < 0 && w < 0);
}

/* A triangle; or a segment, whose last two corners are the same */
typedef struct span {
  double low[3], high[3];
  int32_t corner[3];
} span;

static inline int compare_spans(const void *a, const void *b) {
  const span *p = a, *q = b;
  return (p->low[0] > q->low[0]) - (p->low[0] < q->low[0]);
}

static inline span make_span(const double *x, int32_t a, int32_t b, int32_t c) {
  span s = {.corner = {a, b, c}};
  for (int i = 0; i < 3; i++) {
    const double p = x[3 * a + i], q = x[3 * b + i], r = x[3 * c + i];
    s.low[i] = fmin(p, fmin(q, r)), s.high[i] = fmax(p, fmax(q, r));
  }
  return s;
}

static inline int is_corner(const span *s, int32_t p) {
  return s->corner[0] == p || s->corner[1] == p || s->corner[2] == p;
}

/* 1: an edge of a passes through the triangle b; edges with a common corner are left out. */
static inline int edges_meet(const double *x, const span *a, const span *b) {
  if (b->corner[1] == b->corner[2]) return 0;
  for (int e = 0; e < 3; e++) {
    const int32_t p = a->corner[e], q = a->corner[(e + 1) % 3];
    if (p == q || is_corner(b, p) || is_corner(b, q)) continue;
    if (segment_meets(x + 3 * p, x + 3 * q, x + 3 * b->corner[0], x + 3 * b->corner[1],
                      x + 3 * b->corner[2]))
      return 1;
  }
  return 0;
}

static inline int64_t count_meeting(const double *x, span *list, int32_t n) {
  int64_t count = 0;
  qsort(list, (size_t)n, sizeof *list, compare_spans);
  for (int32_t i = 0; i < n; i++)
    for (int32_t j = i + 1; j < n && list[j].low[0] <= list[i].high[0]; j++) {
      const span *a = &list[i], *b = &list[j];
      if (a->low[1] > b->high[1] || b->low[1] > a->high[1] || a->low[2] > b->high[2] ||
          b->low[2] > a->high[2])
        continue;
      count += edges_meet(x, a, b) || edges_meet(x, b, a);
    }
  return count;
}

/* The number of pairs of faces, or of a face and a segment, that intersect at x */
static inline int64_t count_intersections(const double *x, int32_t nfaces, const int32_t *faces,
                                          int32_t nsegments, const int32_t *segments) {
  span *list = malloc(((size_t)nfaces + (size_t)nsegments + 1) * sizeof *list);
  int32_t n = 0;
  for (int32_t f = 0; f < nfaces; f++)
    list[n++] = make_span(x, faces[3 * f], faces[3 * f + 1], faces[3 * f + 2]);
  for (int32_t s = 0; s < nsegments; s++)
    list[n++] = make_span(x, segments[2 * s], segments[2 * s + 1], segments[2 * s + 1]);
  const int64_t count = list ? count_meeting(x, list, n) : -1;
  free(list);
  return count;
}

#endif
