#include "scene/mesh_fill.h"

#include <math.h>
#include <string.h>

#include "base/disjoint_sets.h"
#include "base/vec3.h"
#include "scene/mesh_ties.h"

/*------------------------------------- checks ---------------------------------------------------*/

/* In a closed surface as many faces run through each edge in one direction as in the other; then
 * winding numbers are defined, also where parts touch in an edge. */
static int is_closed(const ms_surface *s) {
  for (int32_t e = 0; e < s->nedges; e++) {
    int32_t sum = 0;
    for (int32_t i = s->first[e]; i < s->first[e + 1]; i++)
      sum += ms_surface_ascends(s, s->half[i]) ? 1 : -1;
    if (sum) return 0;
  }
  return 1;
}

static msim_status check_closed(const ms_surface *s, const char *subject, msim_error *err) {
  if (is_closed(s)) return MSIM_OK;
  if (s->repairs.open_edges || s->repairs.nonmanifold_edges)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "%s.fill needs a closed surface, but of the %d edges %d are open (of one "
                        "face) and %d are of more than two faces; close it, or leave `fill` out",
                        subject, s->nedges, s->repairs.open_edges, s->repairs.nonmanifold_edges);
  return ms_error_set(err, MSIM_ERR_ARG,
                      "%s.fill needs a surface with an inside, but this one is one-sided, as a "
                      "Klein bottle is; leave `fill` out",
                      subject);
}

/*------------------------------------- lattice --------------------------------------------------*/

/* A lattice in the middle of the bounding box, at least half a spacing from its sides */
static msim_status place_lattice(const ms_surface *s, double spacing, const char *subject,
                                 ms_inside *in, msim_error *err) {
  double low[3], extent[3], least = INFINITY, count = 1;
  for (size_t c = 0; c < 3; c++) {
    double high = -INFINITY;
    low[c] = INFINITY;
    for (size_t v = 0; v < (size_t)s->nvertices; v++)
      low[c] = fmin(low[c], s->x[3 * v + c]), high = fmax(high, s->x[3 * v + c]);
    extent[c] = high - low[c];
    least = fmin(least, extent[c]);
  }
  in->spacing = spacing == MSIM_FILL_AUTO ? least / 6 : spacing;
  for (int c = 0; c < 3; c++) {
    const double n = floor(extent[c] / in->spacing * (1 + 1e-9));
    count *= n;
    if (!(count <= INT32_MAX / 3))
      return ms_error_set(err, MSIM_ERR_ARG,
                          "%s.fill is %g m: more than %d points of this lattice would be in the "
                          "bounding box; use a larger spacing",
                          subject, in->spacing, INT32_MAX / 3);
    in->n[c] = n >= 1 ? (int32_t)n : 1;
    in->origin[c] = low[c] + (extent[c] - (in->n[c] - 1) * in->spacing) / 2;
  }
  return MSIM_OK;
}

/* Number the points inside: number[p] is the index of point p among them, or -1. */
static msim_status list_points(const msim_allocator *alloc, const ms_inside *in,
                               const char *subject, int32_t *number, ms_fill *fill,
                               msim_error *err) {
  for (int32_t p = 0; p < ms_inside_count(in); p++) number[p] = in->part[p] < 0 ? -1 : fill->n++;
  if (fill->n == 0)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "%s.fill is %g m, and no point of this lattice is inside the surface, at "
                        "least half a spacing from it; use a smaller spacing",
                        subject, in->spacing);
  if (!MS_NEW(alloc, fill->x, 3 * (size_t)fill->n)) return ms_error_set_memory(err, "a mesh");
  for (int32_t p = 0; p < ms_inside_count(in); p++) {
    const int32_t at[3] = {p / in->n[2] / in->n[1], p / in->n[2] % in->n[1], p % in->n[2]};
    for (int c = 0; c < 3 && number[p] >= 0; c++)
      fill->x[3 * (size_t)number[p] + (size_t)c] = in->origin[c] + at[c] * in->spacing;
  }
  return MSIM_OK;
}

/*------------------------------------- springs --------------------------------------------------*/

static msim_status append_spring(const msim_allocator *alloc, ms_fill *fill, int32_t i, int32_t j,
                                 msim_error *err) {
  const ms_array ij = {&fill->ij, 2 * sizeof *fill->ij};
  const msim_status status = ms_memory_reserve(alloc, ij, fill->nsprings, &fill->capacity,
                                               (int64_t)fill->nsprings + 1, err);
  if (status) return status;
  fill->ij[2 * (size_t)fill->nsprings] = i;
  fill->ij[2 * (size_t)fill->nsprings++ + 1] = j;
  return MSIM_OK;
}

/* Springs to the neighbours in the same part: those of msim_lattice, in its order */
static msim_status add_lattice_springs(const msim_allocator *alloc, const ms_inside *in,
                                       const int32_t *number, int32_t first, ms_fill *fill,
                                       msim_error *err) {
  static const int8_t offsets[13][3] = {{1, 0, 0},  {0, 1, 0},  {0, 0, 1},  {1, 1, 0},  {1, -1, 0},
                                        {1, 0, 1},  {1, 0, -1}, {0, 1, 1},  {0, 1, -1}, {1, 1, 1},
                                        {1, 1, -1}, {1, -1, 1}, {1, -1, -1}};
  msim_status status = MSIM_OK;
  for (int32_t p = 0; p < ms_inside_count(in); p++) {
    const int32_t at[3] = {p / in->n[2] / in->n[1], p / in->n[2] % in->n[1], p % in->n[2]};
    for (int o = 0; o < 13 && number[p] >= 0 && !status; o++) {
      int32_t q = 0, is_there = 1;
      for (int c = 0; c < 3; c++) {
        const int32_t i = at[c] + offsets[o][c];
        is_there &= i >= 0 && i < in->n[c];
        q = q * in->n[c] + i;
      }
      if (is_there && in->part[q] == in->part[p])
        status = append_spring(alloc, fill, first + number[p], first + number[q], err);
    }
  }
  return status;
}

static msim_status add_ties(const msim_allocator *alloc, const ms_surface *s, const ms_inside *in,
                            const int32_t *number, ms_fill *fill, msim_error *err) {
  int32_t *points_of_part;
  if (!MS_NEW(alloc, points_of_part, s->nvertices)) return ms_error_set_memory(err, "a mesh");
  msim_status status = MSIM_OK;
  for (int32_t p = 0; p < ms_inside_count(in); p++)
    if (in->part[p] >= 0) points_of_part[in->part[p]]++;
  for (int32_t v = 0; v < s->nvertices; v++) {
    int32_t points[MS_MAX_TIES];
    const int32_t n = ms_mesh_find_ties(s, in, points_of_part, fill->n, v, points);
    for (int32_t i = 0; i < n && !status; i++)
      status = append_spring(alloc, fill, v, s->nvertices + number[points[i]], err);
  }
  ms_memory_free(alloc, points_of_part);
  return status;
}

/*------------------------------------- loose points ---------------------------------------------*/

static double squared_distance(const double a[3], const double b[3], double unit) {
  const double d[3] = {(a[0] - b[0]) / unit, (a[1] - b[1]) / unit, (a[2] - b[2]) / unit};
  return ms_vec3_dot(d, d);
}

/* Tie a point to the 4 nearest vertices. */
static msim_status tie_loose(const msim_allocator *alloc, const ms_surface *s, double spacing,
                             int32_t point, ms_fill *fill, msim_error *err) {
  enum { TIES = 4 };
  int32_t vertex[TIES], n = 0;
  double squared[TIES];
  for (int32_t v = 0; v < s->nvertices; v++) {
    const double d = squared_distance(s->x + 3 * (size_t)v, fill->x + 3 * (size_t)point, spacing);
    int32_t i = n < TIES ? n++ : TIES;
    for (; i > 0 && d < squared[i - 1]; i--)
      if (i < TIES) vertex[i] = vertex[i - 1], squared[i] = squared[i - 1];
    if (i < TIES) vertex[i] = v, squared[i] = d;
  }
  msim_status status = MSIM_OK;
  for (int32_t i = 0; i < n && !status; i++)
    status = append_spring(alloc, fill, vertex[i], s->nvertices + point, err);
  return status;
}

/* Tie the points that no path of springs connects with a vertex, as in a narrow part of a surface
 * of few vertices. */
static msim_status tie_loose_points(const msim_allocator *alloc, const ms_surface *s,
                                    double spacing, ms_fill *fill, msim_error *err) {
  const int32_t n = s->nvertices + fill->n;
  int32_t *of;
  uint8_t *is_held = NULL;
  msim_status status = MSIM_OK;
  const int ok = MS_NEW(alloc, of, n) && MS_NEW(alloc, is_held, n);
  if (!ok) status = ms_error_set_memory(err, "a mesh");
  for (int32_t p = 0; p < n && ok; p++) of[p] = p;
  for (size_t e = 0; e < (size_t)fill->nsprings && ok; e++)
    ms_disjoint_sets_join(of, fill->ij[2 * e], fill->ij[2 * e + 1]);
  for (int32_t v = 0; v < s->nvertices && ok; v++) is_held[ms_disjoint_sets_find_root(of, v)] = 1;
  for (int32_t p = 0; p < fill->n && ok && !status; p++)
    if (!is_held[ms_disjoint_sets_find_root(of, s->nvertices + p)])
      status = tie_loose(alloc, s, spacing, p, fill, err);
  MS_FREE(alloc, of, is_held);
  return status;
}

/*------------------------------------- the whole ------------------------------------------------*/

static msim_status fill_inside(const msim_allocator *alloc, const ms_surface *s,
                               const char *subject, ms_inside *in, ms_fill *fill, msim_error *err) {
  int32_t *number = NULL;
  if (!ms_inside_find(alloc, s, in) || !MS_NEW(alloc, number, ms_inside_count(in)))
    return ms_error_set_memory(err, "a mesh");
  msim_status status = list_points(alloc, in, subject, number, fill, err);
  if (!status && (int64_t)s->nvertices + fill->n > INT32_MAX / 3)
    status = ms_error_set(err, MSIM_ERR_ARG, "%s gives %lld particles; the limit is %d", subject,
                          (long long)s->nvertices + fill->n, INT32_MAX / 3);
  if (!status) status = add_lattice_springs(alloc, in, number, s->nvertices, fill, err);
  if (!status) status = add_ties(alloc, s, in, number, fill, err);
  if (!status) status = tie_loose_points(alloc, s, in->spacing, fill, err);
  ms_memory_free(alloc, number);
  return status;
}

msim_status ms_fill_create(const msim_allocator *alloc, const ms_surface *s, double spacing,
                           const char *subject, ms_fill *fill, msim_error *err) {
  ms_inside in = {.spacing = spacing};
  *fill = (ms_fill){0};
  msim_status status = check_closed(s, subject, err);
  if (!status) status = place_lattice(s, spacing, subject, &in, err);
  if (!status) status = fill_inside(alloc, s, subject, &in, fill, err);
  ms_inside_destroy(alloc, &in);
  return status;
}

void ms_fill_destroy(const msim_allocator *alloc, ms_fill *fill) {
  MS_FREE(alloc, fill->x, fill->ij);
}
