#include "contact/surface_pairs.h"

#include <math.h>
#include <string.h>

#include "base/vec3.h"

/* The mean length of all edges in the scene; INFINITY: there are none */
static double find_mean_length(const ms_contact_surface *s) {
  double sum = 0;
  int64_t n = 0;
  for (int32_t i = 0; i < s->nelements; i++)
    for (int e = 0; e < ms_contact_surface_count_edges(s, i); e++, n++) {
      const double *a = s->x_rest + 3 * (size_t)s->corner[i][e],
                   *b = s->x_rest + 3 * (size_t)s->corner[i][(e + 1) % 3];
      sum += ms_vec3_norm((const double[3]){b[0] - a[0], b[1] - a[1], b[2] - a[2]});
    }
  return n > 0 ? sum / (double)n : INFINITY;
}

msim_status ms_surface_pairs_create(const ms_model *model, double thickness,
                                    ms_surface_pairs *pairs, msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  *pairs = (ms_surface_pairs){.thickness = thickness, .margin = -1};
  msim_status status = ms_contact_surface_create(model, &pairs->surface, err);
  if (!status) status = ms_surface_tree_create(model->scene, &pairs->surface, &pairs->tree, err);
  if (status) return status;
  pairs->slack = fmin(thickness, 0.125 * find_mean_length(&pairs->surface));
  const size_t n = 3 * (size_t)pairs->surface.nnodes;
  if (MS_NEW(alloc, pairs->base[0], n) && MS_NEW(alloc, pairs->base[1], n) &&
      MS_NEW(alloc, pairs->swept, pairs->surface.nnodes))
    return MSIM_OK;
  return ms_error_set_memory(err, "the surface");
}

void ms_surface_pairs_destroy(const ms_scene *scene, ms_surface_pairs *pairs) {
  ms_contact_surface_destroy(scene, &pairs->surface);
  ms_surface_tree_destroy(scene, &pairs->tree);
  MS_FREE(&scene->alloc, pairs->pair, pairs->base[0], pairs->base[1], pairs->swept);
}

/*------------------------------------- motion of nodes ------------------------------------------*/

/* The largest |y - x - m| of all nodes, m the mean of y - x */
static double find_largest_change(int32_t n, const double *x, const double *y) {
  double mean[3] = {0}, largest = 0;
  for (size_t i = 0; i < 3 * (size_t)n; i++) mean[i % 3] += (y[i] - x[i]) / n;
  for (size_t k = 0; k < 3 * (size_t)n; k += 3) {
    double square = 0;
    for (size_t c = 0; c < 3; c++) {
      const double d = y[k + c] - x[k + c] - mean[c];
      square += d * d;
    }
    largest = fmax(largest, square);
  }
  return sqrt(largest);
}

/* Surfaces that move little get a list for several steps, those that do not one for their paths. */
static void choose_base(ms_surface_pairs *p, const double *x0, const double *x1) {
  const int32_t n = p->surface.nnodes;
  const size_t bytes = 3 * (size_t)n * sizeof *x0;
  const int is_slow = find_largest_change(n, x0, x1) <= p->slack / 2;
  p->margin = is_slow ? p->slack : p->slack / 4;
  memcpy(p->base[0], x0, bytes);
  memcpy(p->base[1], is_slow ? x0 : x1, bytes);
}

static int is_list_valid(const ms_surface_pairs *p, const double *x0, const double *x1) {
  const int32_t n = p->surface.nnodes;
  return find_largest_change(n, p->base[0], x0) <= p->margin &&
         find_largest_change(n, p->base[1], x1) <= p->margin;
}

/*------------------------------------- pairs ----------------------------------------------------*/

static int have_common_node(const ms_feature_pair *p) {
  for (int a = 0; a < (int)p->kind; a++)
    for (int b = p->kind; b < 4; b++)
      if (p->node[a] == p->node[b]) return 1;
  return 0;
}

static void extend(const ms_box *by, ms_box *box) {
  for (int c = 0; c < 3; c++) {
    box->low[c] = by->low[c] < box->low[c] ? by->low[c] : box->low[c];
    box->high[c] = by->high[c] > box->high[c] ? by->high[c] : box->high[c];
  }
}

/* 1: the boxes of the paths of A and B are farther apart than `reach` along an axis. */
static int are_boxes_apart(const ms_surface_pairs *pairs, const ms_feature_pair *p, double reach) {
  ms_box box[2] = {pairs->swept[p->node[0]], pairs->swept[p->node[3]]};
  for (int c = 1; c < 3; c++) extend(&pairs->swept[p->node[c]], &box[c >= (int)p->kind]);
  for (int c = 0; c < 3; c++)
    if (box[0].low[c] - box[1].high[c] > reach || box[1].low[c] - box[0].high[c] > reach) return 1;
  return 0;
}

/* 1: a plane normal to the line between the middles of A and B is farther than `reach` from one of
 * them: their distance is larger, which this finds sooner. */
static int are_planes_apart(ms_feature_kind kind, double x[4][3], double reach) {
  double n[3];
  for (int c = 0; c < 3; c++)
    n[c] = kind == MS_EDGE_EDGE ? (x[0][c] + x[1][c] - x[2][c] - x[3][c]) / 2
                                : x[0][c] - (x[1][c] + x[2][c] + x[3][c]) / 3;
  return ms_proximity_find_gap(kind, x, n) > reach * ms_vec3_norm(n) * (1 + 1e-9);
}

/* Find the thickness of a pair. 1: it may come closer than that on paths within the margin of the
 * base. */
static int may_come_close(const ms_surface_pairs *pairs, const ms_feature_pair *p,
                          double *thickness) {
  double x0[4][3], x1[4][3], rest[4][3];
  if (are_boxes_apart(pairs, p, pairs->thickness + 2 * pairs->margin)) return 0;
  ms_feature_pair_get(p->node, pairs->base[0], x0),
      ms_feature_pair_get(p->node, pairs->base[1], x1);
  const double change = 2 * pairs->margin + ms_proximity_bound_change(p->kind, x0, x1);
  if (are_planes_apart(p->kind, x0, pairs->thickness + change)) return 0;
  const double distance = ms_proximity_find(p->kind, x0).distance;
  if (distance > pairs->thickness + change) return 0;
  ms_feature_pair_get(p->node, pairs->surface.x_rest, rest);
  *thickness = fmin(pairs->thickness, 0.5 * ms_proximity_find(p->kind, rest).distance);
  return distance <= *thickness + change;
}

static void append(const ms_feature_pair *p, ms_feature_pair *list, int *n) {
  if (!have_common_node(p)) list[(*n)++] = *p;
}

/* The corners that element a owns, and the face b */
static void list_points(const ms_contact_surface *s, int32_t a, int32_t b, ms_feature_pair *list,
                        int *n) {
  const int32_t *of = s->corner[b];
  for (int c = 0; c < 3 && b < s->nfaces; c++)
    if (s->owns[a] & 1 << c)
      append(&(ms_feature_pair){{s->corner[a][c], of[0], of[1], of[2]}, MS_POINT_TRIANGLE}, list,
             n);
}

int ms_surface_pairs_list(const ms_contact_surface *s, int32_t a, int32_t b,
                          ms_feature_pair list[MS_MOST_FEATURE_PAIRS]) {
  const int32_t *ca = s->corner[a], *cb = s->corner[b];
  int n = 0;
  list_points(s, a, b, list, &n);
  list_points(s, b, a, list, &n);
  for (int i = 0; i < 9; i++) {
    const int e = i / 3, f = i % 3;
    if (s->owns[a] & 8 << e && s->owns[b] & 8 << f)
      append(&(ms_feature_pair){{ca[e], ca[(e + 1) % 3], cb[f], cb[(f + 1) % 3]}, MS_EDGE_EDGE},
             list, &n);
  }
  return n;
}

static msim_status add_pairs(const msim_allocator *alloc, ms_surface_pairs *pairs, int32_t a,
                             int32_t b, msim_error *err) {
  ms_feature_pair list[MS_MOST_FEATURE_PAIRS];
  const int n = ms_surface_pairs_list(&pairs->surface, a, b, list);
  for (const ms_feature_pair *p = list; p < list + n; p++) {
    double thickness;
    if (!may_come_close(pairs, p, &thickness)) continue;
    const msim_status status = ms_memory_reserve(alloc, MS_ARRAY(pairs->pair), pairs->n,
                                                 &pairs->capacity, (int64_t)pairs->n + 1, err);
    if (status) return status;
    ms_surface_pair *to = &pairs->pair[pairs->n++];
    *to = (ms_surface_pair){.kind = p->kind, .thickness = thickness};
    memcpy(to->node, p->node, sizeof to->node);
  }
  return MSIM_OK;
}

void ms_surface_pairs_set_boxes(ms_surface_pairs *p, const double *x0, const double *x1,
                                double reach) {
  for (int32_t k = 0; k < p->surface.nnodes; k++)
    for (int c = 0; c < 3; c++) {
      const double a = x0[3 * (size_t)k + (size_t)c], b = x1[3 * (size_t)k + (size_t)c];
      p->swept[k].low[c] = a < b ? a : b, p->swept[k].high[c] = a < b ? b : a;
    }
  for (int32_t i = 0; i < p->surface.nelements; i++) {
    ms_box *box = &p->tree.box[p->tree.leaf[i]];
    *box = p->swept[p->surface.corner[i][0]];
    for (int c = 1; c < 3; c++) extend(&p->swept[p->surface.corner[i][c]], box);
    for (int c = 0; c < 3; c++) box->low[c] -= reach, box->high[c] += reach;
  }
  ms_surface_tree_update(&p->tree);
}

/* The mean motion of all nodes, which is_list_valid() ignores, moves all boxes alike. */
msim_status ms_surface_pairs_update(const msim_allocator *alloc, ms_surface_pairs *pairs,
                                    const double *x0, const double *x1, int *is_new,
                                    msim_error *err) {
  msim_status status = MSIM_OK;
  *is_new = !(pairs->margin >= 0 && is_list_valid(pairs, x0, x1));
  if (!*is_new) return MSIM_OK;
  choose_base(pairs, x0, x1);
  ms_surface_pairs_set_boxes(pairs, pairs->base[0], pairs->base[1],
                             0.5 * pairs->thickness + pairs->margin);
  pairs->n = 0;
  for (int32_t a = 0; a < pairs->surface.nelements; a++) {
    int32_t node = 0, b;
    while (!status && (b = ms_surface_tree_next(&pairs->tree, a, &node)) >= 0)
      status = add_pairs(alloc, pairs, a, b, err);
  }
  if (status) pairs->margin = -1;
  return status;
}
