#include "scene/mesh_ties.h"

#include <math.h>
#include <stdlib.h>

#include "base/vec3.h"

enum { LEAST_TIES = 4 };
#define TIE_LENGTH    1.5  /* spacings */
#define LEAST_SUPPORT 1e-3 /* of det(M) in is_held(); 1/27 if the directions are isotropic */

typedef struct tie {
  int32_t point;
  double squared, away[3]; /* distance from the vertex, in spacings */
} tie;

/* The nearest points found so far, by distance, then by index */
typedef struct nearest {
  int32_t n;
  tie at[MS_MAX_TIES];
} nearest;

static int is_before(const tie *a, const tie *b) {
  return a->squared < b->squared || (a->squared == b->squared && a->point < b->point);
}

static void insert_tie(nearest *list, tie t) {
  int32_t i = list->n;
  if (i < MS_MAX_TIES) list->n++;
  else if (is_before(&t, &list->at[--i])) list->at[i] = t;
  else return;
  for (; i > 0 && is_before(&t, &list->at[i - 1]); i--) list->at[i] = list->at[i - 1];
  list->at[i] = t;
}

/* 1: the first n ties resist a force in each direction: with their unit vectors u the matrix M =
 * sum(u u^T) / n is not singular. */
static int is_held(const nearest *list, int32_t n) {
  double m[3][3] = {{0}};
  for (int32_t i = 0; i < n; i++)
    for (int a = 0; a < 3; a++)
      for (int b = 0; b < 3; b++)
        m[a][b] += list->at[i].away[a] * list->at[i].away[b] / (list->at[i].squared * n);
  return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
             m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
             m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]) >=
         LEAST_SUPPORT;
}

/* The number of points within a distance, in spacings */
static int32_t count_within(const nearest *list, double distance) {
  int32_t n = 0;
  while (n < list->n && list->at[n].squared <= distance * distance) n++;
  return n;
}

/* Those within the length of a tie, but at least LEAST_TIES */
static int32_t least_ties(const nearest *list) {
  const int32_t n = count_within(list, TIE_LENGTH);
  return n > LEAST_TIES ? n : LEAST_TIES;
}

/* The number of ties that hold the vertex, beyond `without`, which do not; 0: more than the first
 * `known` points are needed. */
static int32_t count_ties(const nearest *list, int32_t without, int32_t known) {
  const int32_t least = least_ties(list);
  for (int32_t n = without < least ? least : without + 1; n <= known; n++)
    if (is_held(list, n)) return n;
  return 0;
}

/* Where the ties of one vertex are searched */
typedef struct tie_search {
  const ms_inside *in;
  const double *x;
  int32_t part;      /* of the points; -1: any */
  int32_t center[3]; /* the point of the lattice that is nearest to the vertex */
} tie_search;

static void add_point(const tie_search *q, const int32_t offset[3], nearest *list) {
  const ms_inside *in = q->in;
  tie t = {0};
  for (int c = 0; c < 3; c++) {
    const int32_t i = q->center[c] + offset[c];
    if (i < 0 || i >= in->n[c]) return;
    t.point = t.point * in->n[c] + i;
    t.away[c] = (in->origin[c] - q->x[c]) / in->spacing + i;
  }
  if (in->part[t.point] < 0 || (q->part >= 0 && in->part[t.point] != q->part)) return;
  t.squared = ms_vec3_dot(t.away, t.away);
  insert_tie(list, t);
}

/* Offsets from the center along one axis, first, first + step, ... to last */
typedef struct offsets {
  int32_t first, last, step;
} offsets;

/* Those up to r inside the lattice */
static offsets clip_offsets(const tie_search *q, int c, int32_t r) {
  const int32_t below = q->center[c], above = q->in->n[c] - 1 - below;
  return (offsets){-(r < below ? r : below), r < above ? r : above, 1};
}

/* 1: -r or r is among them. */
static int reaches(offsets a, int32_t r) { return a.first == -r || a.last == r; }

/* The points whose largest offset from the center is r. An axis has only the offsets -r and r where
 * no later one reaches r, as the lattice may be much longer than wide. All axes reach r = 0. */
static void add_shell(const tie_search *q, int32_t r, nearest *list) {
  const offsets ends = {-r, r, 2 * r}, xs = clip_offsets(q, 0, r), ys = clip_offsets(q, 1, r),
                zs = clip_offsets(q, 2, r);
  const offsets along_x = reaches(ys, r) || reaches(zs, r) ? xs : ends;
  for (int32_t x = along_x.first; x <= along_x.last; x += along_x.step) {
    const offsets along_y = abs(x) == r || reaches(zs, r) ? ys : ends;
    for (int32_t y = along_y.first; y <= along_y.last; y += along_y.step) {
      const offsets along_z = abs(x) == r || abs(y) == r ? zs : ends;
      for (int32_t z = along_z.first; z <= along_z.last; z += along_z.step)
        add_point(q, (const int32_t[]){x, y, z}, list);
    }
  }
}

int32_t ms_mesh_find_ties(const ms_surface *s, const ms_inside *in, const int32_t *points_of_part,
                          int32_t npoints, int32_t v, int32_t points[MS_MAX_TIES]) {
  nearest list = {0};
  tie_search q = {.in = in, .x = s->x + 3 * (size_t)v, .part = in->vertex[v]};
  int32_t count = 0, tried = 0, most = 0;
  if (points_of_part[q.part]) npoints = points_of_part[q.part];
  else q.part = -1;
  for (int c = 0; c < 3; c++) {
    const double at = round((q.x[c] - in->origin[c]) / in->spacing);
    q.center[c] = (int32_t)fmin(fmax(at, 0), in->n[c] - 1);
    if (in->n[c] > most) most = in->n[c];
  }
  /* points beyond shell r are farther than r + 1/2 spacings */
  for (int32_t r = 0; r < most && !count; r++) {
    add_shell(&q, r, &list);
    const double reach = list.n == npoints ? INFINITY : r + 0.5;
    const int32_t known = count_within(&list, reach);
    if (reach >= TIE_LENGTH && known > tried)
      count = count_ties(&list, tried, known), tried = known;
    if (known == MS_MAX_TIES || known == npoints) break;
  }
  if (!count) count = least_ties(&list) < list.n ? least_ties(&list) : list.n;
  for (int32_t i = 0; i < count; i++) points[i] = list.at[i].point;
  return count;
}
