#include "scene/mesh_inside.h"

#include <math.h>
#include <string.h>

#include "base/buckets.h"
#include "base/disjoint_sets.h"
#include "base/vec3.h"

/* Coordinates along x and y as integers, so that signs of areas are exact: a product of two
 * differences is below 2^60. */
#define STEPS_OF_EXTENT 0x1p29

typedef struct search {
  const ms_surface *s;
  ms_inside *in;
  double low[3], high[3];
  int64_t *plane;    /* 2 nvertices: x and y as integers */
  int32_t *winding;  /* of each point of the lattice: its winding number, of all parts */
  int32_t *crossing; /* of one part, in the box of that part */
} search;

/*------------------------------------- winding numbers ------------------------------------------*/

static int64_t to_integer(const search *q, double x, size_t axis) {
  const double extent = q->high[axis] - q->low[axis];
  return extent > 0 ? llround((x - q->low[axis]) / extent * STEPS_OF_EXTENT) : 0;
}

/* Twice the area of the triangle (a, b, p), > 0 if it is counterclockwise */
static int64_t doubled_area(const int64_t a[2], const int64_t b[2], const int64_t p[2]) {
  return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
}

/* Its sign where p is moved by (epsilon, epsilon^2), so that p is on no edge and no vertex
 * (simulation of simplicity, Edelsbrunner and Muecke 1990); 0 only if a = b. */
static int side_of_edge(int64_t area, const int64_t a[2], const int64_t b[2]) {
  if (area) return area > 0 ? 1 : -1;
  if (a[1] != b[1]) return a[1] > b[1] ? 1 : -1;
  return a[0] == b[0] ? 0 : b[0] > a[0] ? 1 : -1;
}

/* The orientation, 1 or -1, of the face in which the vertical line through p meets it, at *z; 0:
 * it does not. A line near an edge of two faces meets exactly one, as both see the same sign. */
static int cross_face(const search *q, const int32_t *corner, const int64_t p[2], double *z) {
  int64_t area[3];
  int side[3];
  for (int c = 0; c < 3; c++) {
    const int64_t *a = q->plane + 2 * (size_t)corner[c],
                  *b = q->plane + 2 * (size_t)corner[(c + 1) % 3];
    area[c] = doubled_area(a, b, p);
    side[c] = side_of_edge(area[c], a, b);
  }
  if (side[0] != side[1] || side[1] != side[2] || side[0] == 0) return 0;
  const double sum = (double)(area[0] + area[1] + area[2]);
  *z = 0;
  for (size_t c = 0; c < 3; c++) /* the weight of a corner is the area opposite to it */
    *z += (double)area[(c + 1) % 3] / sum * q->s->x[3 * (size_t)corner[c] + 2];
  return side[0];
}

/* The indices of lattice points along an axis from `low` to `high`, one more at each end; to: the
 * first and the last one. */
static void find_range(const ms_inside *in, int axis, double low, double high, int32_t range[2]) {
  const double first = floor((low - in->origin[axis]) / in->spacing),
               last = ceil((high - in->origin[axis]) / in->spacing);
  range[0] = (int32_t)fmin(fmax(first, 0), in->n[axis] - 1);
  range[1] = (int32_t)fmin(fmax(last, 0), in->n[axis] - 1);
}

/* The ranges of the box of a face, enlarged by `margin` */
static void find_box(const search *q, const int32_t *corners, double margin, int32_t box[3][2]) {
  for (int c = 0; c < 3; c++) {
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < 3; i++) {
      const double x = q->s->x[3 * (size_t)corners[i] + (size_t)c];
      low = fmin(low, x), high = fmax(high, x);
    }
    find_range(q->in, c, low - margin, high + margin, box[c]);
  }
}

static size_t point_index(const ms_inside *in, int32_t ix, int32_t iy, int32_t iz) {
  return ((size_t)ix * (size_t)in->n[1] + (size_t)iy) * (size_t)in->n[2] + (size_t)iz;
}

/* Note at the highest lattice point below each crossing of a face. */
static void add_crossings(const search *q, const int32_t *corner) {
  const ms_inside *in = q->in;
  int32_t box[3][2];
  find_box(q, corner, 0, box);
  for (int32_t ix = box[0][0]; ix <= box[0][1]; ix++)
    for (int32_t iy = box[1][0]; iy <= box[1][1]; iy++) {
      const int64_t p[2] = {to_integer(q, in->origin[0] + ix * in->spacing, 0),
                            to_integer(q, in->origin[1] + iy * in->spacing, 1)};
      double z;
      const int sign = cross_face(q, corner, p, &z);
      const double below = sign ? ceil((z - in->origin[2]) / in->spacing) - 1 : -1;
      if (below >= 0)
        q->crossing[point_index(in, ix, iy, (int32_t)fmin(below, in->n[2] - 1))] += sign;
    }
}

/* The winding number of a point in one part is the sum of the orientations of the crossings above
 * it. A point in two parts joins them. `crossing` is cleared for the next part. */
static void add_windings(const search *q, int32_t box[3][2], int32_t part, int32_t *of) {
  for (int32_t ix = box[0][0]; ix <= box[0][1]; ix++)
    for (int32_t iy = box[1][0]; iy <= box[1][1]; iy++) {
      int32_t winding = 0;
      for (int32_t iz = box[2][1]; iz >= 0; iz--) {
        const size_t p = point_index(q->in, ix, iy, iz);
        winding += q->crossing[p];
        q->crossing[p] = 0;
        if (winding == 0) continue;
        q->winding[p] += winding;
        if (q->in->part[p] >= 0) ms_disjoint_sets_join(of, q->in->part[p], part);
        else q->in->part[p] = part;
      }
    }
}

/*------------------------------------- distances ------------------------------------------------*/

/* The squared distance of p from a segment; both are relative to one of its ends. */
static double squared_from_segment(const double p[3], const double along[3]) {
  const double length = ms_vec3_dot(along, along);
  const double t = length > 0 ? fmin(fmax(ms_vec3_dot(p, along) / length, 0), 1) : 0;
  double rest[3] = {p[0], p[1], p[2]};
  ms_vec3_axpy(-t, along, rest);
  return ms_vec3_dot(rest, rest);
}

/* The squared distance of p from a triangle, in squared units: from its plane where the foot of the
 * perpendicular is inside the three edges, else from the nearest edge. */
static double squared_from_face(const double p[3], const double *const corner[3], double unit) {
  double edge[3][3], from[3][3], normal[3], least = INFINITY;
  int inside = 1;
  for (int c = 0; c < 3; c++)
    for (int d = 0; d < 3; d++)
      edge[c][d] = (corner[(c + 1) % 3][d] - corner[c][d]) / unit,
      from[c][d] = (p[d] - corner[c][d]) / unit;
  ms_vec3_cross(edge[0], edge[1], normal);
  for (int c = 0; c < 3; c++) {
    double inward[3];
    ms_vec3_cross(normal, edge[c], inward);
    inside &= ms_vec3_dot(inward, from[c]) > 0;
    least = fmin(least, squared_from_segment(from[c], edge[c]));
  }
  if (!inside) return least;
  const double height = ms_vec3_dot(normal, from[0]);
  return height * height / ms_vec3_dot(normal, normal);
}

/* Points closer to a face than half a spacing are not inside, but those at that distance up to
 * rounding are. */
static void leave_out_near(const search *q, const int32_t *corners) {
  const double reach = 0.5 * (1 - 1e-9); /* spacings */
  const ms_inside *in = q->in;
  const double *at[3];
  int32_t box[3][2];
  for (int c = 0; c < 3; c++) at[c] = q->s->x + 3 * (size_t)corners[c];
  find_box(q, corners, in->spacing / 2, box);
  for (int32_t ix = box[0][0]; ix <= box[0][1]; ix++)
    for (int32_t iy = box[1][0]; iy <= box[1][1]; iy++)
      for (int32_t iz = box[2][0]; iz <= box[2][1]; iz++) {
        const size_t i = point_index(in, ix, iy, iz);
        const double p[3] = {in->origin[0] + ix * in->spacing, in->origin[1] + iy * in->spacing,
                             in->origin[2] + iz * in->spacing};
        if (q->winding[i] && squared_from_face(p, at, in->spacing) < reach * reach)
          q->winding[i] = 0;
      }
}

/*------------------------------------- the whole ------------------------------------------------*/

/* The parts that faces connect */
static void join_faces(const ms_surface *s, int32_t *of) {
  for (int32_t v = 0; v < s->nvertices; v++) of[v] = v;
  for (int32_t e = 0; e < s->nedges; e++)
    ms_disjoint_sets_join(of, s->ij[2 * (size_t)e], s->ij[2 * (size_t)e + 1]);
  for (int32_t v = 0; v < s->nvertices; v++) of[v] = ms_disjoint_sets_find_root(of, v);
}

static int allocate(const msim_allocator *alloc, search *q) {
  const size_t n = (size_t)ms_inside_count(q->in), nvertices = (size_t)q->s->nvertices;
  return MS_NEW(alloc, q->in->part, n) && MS_NEW(alloc, q->in->vertex, nvertices) &&
         MS_NEW(alloc, q->winding, n) && MS_NEW(alloc, q->crossing, n) &&
         MS_NEW(alloc, q->plane, 2 * nvertices);
}

static void find_plane(search *q) {
  for (size_t c = 0; c < 3; c++) {
    q->low[c] = INFINITY, q->high[c] = -INFINITY;
    for (size_t v = 0; v < (size_t)q->s->nvertices; v++)
      q->low[c] = fmin(q->low[c], q->s->x[3 * v + c]),
      q->high[c] = fmax(q->high[c], q->s->x[3 * v + c]);
  }
  for (size_t v = 0; v < (size_t)q->s->nvertices; v++)
    for (size_t c = 0; c < 2; c++) q->plane[2 * v + c] = to_integer(q, q->s->x[3 * v + c], c);
}

/* Parts one after the other: first[part] ... of `by_part` are its faces. */
static void find_windings(const search *q, const ms_buckets *by_part) {
  const ms_surface *s = q->s;
  for (int32_t part = 0; part < s->nvertices; part++) {
    const int32_t first = by_part->first[part], end = by_part->first[part + 1];
    int32_t box[3][2] = {{INT32_MAX, -1}, {INT32_MAX, -1}, {INT32_MAX, -1}};
    for (int32_t i = first; i < end; i++) {
      const int32_t *corner = s->corners + 3 * (size_t)by_part->item[i];
      int32_t own[3][2];
      find_box(q, corner, 0, own);
      for (int c = 0; c < 3; c++) {
        if (own[c][0] < box[c][0]) box[c][0] = own[c][0];
        if (own[c][1] > box[c][1]) box[c][1] = own[c][1];
      }
      add_crossings(q, corner);
    }
    if (first < end) add_windings(q, box, part, q->in->vertex);
  }
}

int ms_inside_find(const msim_allocator *alloc, const ms_surface *s, ms_inside *in) {
  search q = {.s = s, .in = in};
  ms_buckets by_part = {0};
  int32_t *part = NULL;
  int ok = allocate(alloc, &q) && MS_NEW(alloc, part, s->nfaces);
  if (ok) find_plane(&q), join_faces(s, in->vertex);
  for (int32_t f = 0; f < s->nfaces && ok; f++) part[f] = in->vertex[s->corners[3 * (size_t)f]];
  ok = ok && ms_buckets_create(alloc, s->nfaces, part, s->nvertices, &by_part);
  if (ok) {
    memset(in->part, -1, (size_t)ms_inside_count(in) * sizeof *in->part);
    find_windings(&q, &by_part);
    for (size_t f = 0; f < (size_t)s->nfaces; f++) leave_out_near(&q, s->corners + 3 * f);
    for (int32_t v = 0; v < s->nvertices; v++)
      in->vertex[v] = ms_disjoint_sets_find_root(in->vertex, v);
    for (int32_t p = 0; p < ms_inside_count(in); p++)
      in->part[p] = q.winding[p] ? in->vertex[in->part[p]] : -1;
  }
  ms_buckets_destroy(alloc, &by_part);
  MS_FREE(alloc, part, q.winding, q.crossing, q.plane);
  return ok;
}

void ms_inside_destroy(const msim_allocator *alloc, ms_inside *in) {
  MS_FREE(alloc, in->part, in->vertex);
}
