/* surface_check - refuses states in which surfaces touch or intersect */
#include <math.h>

#include "base/vec3.h"
#include "contact/surface_pairs.h"

static const double ROUNDING = 1e-12; /* relative to coordinates */

/* Six times the volume of the tetrahedron a b c d: its sign says on which side of a b c d lies. 0:
 * it is in the plane, up to rounding of coordinates. */
static double find_volume(const double a[3], const double b[3], const double c[3],
                          const double d[3]) {
  double u[3], v[3], w[3];
  for (int i = 0; i < 3; i++) u[i] = b[i] - a[i], v[i] = c[i] - a[i], w[i] = d[i] - a[i];
  const double volume = u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) +
                        u[2] * (v[0] * w[1] - v[1] * w[0]);
  const double size = fmax(ms_vec3_norm(u), fmax(ms_vec3_norm(v), ms_vec3_norm(w)));
  const double error = ROUNDING * size * size * (size + ms_vec3_norm(a));
  return fabs(volume) > error ? volume : 0;
}

/* 1: the edge p q passes through the triangle a b c. Where a volume is 0, features touch. */
static int pierces(const double p[3], const double q[3], const double a[3], const double b[3],
                   const double c[3]) {
  if (!(find_volume(a, b, c, p) * find_volume(a, b, c, q) < 0)) return 0;
  const double ab = find_volume(p, q, a, b), bc = find_volume(p, q, b, c),
               ca = find_volume(p, q, c, a);
  return (ab > 0 && bc > 0 && ca > 0) || (ab < 0 && bc < 0 && ca < 0);
}

/* 1: an edge of element i passes through face f. */
static int edge_pierces(const ms_contact_surface *s, const double *x, int32_t i, int32_t f) {
  const int32_t *of = s->corner[f];
  if (f >= s->nfaces) return 0;
  for (int e = 0; e < ms_contact_surface_count_edges(s, i); e++) {
    const int32_t p = s->corner[i][e], q = s->corner[i][(e + 1) % 3];
    int is_common = 0;
    for (int c = 0; c < 3; c++) is_common |= of[c] == p || of[c] == q;
    if (!is_common && pierces(x + 3 * (size_t)p, x + 3 * (size_t)q, x + 3 * (size_t)of[0],
                              x + 3 * (size_t)of[1], x + 3 * (size_t)of[2]))
      return 1;
  }
  return 0;
}

static const char *name_element(const ms_contact_surface *s, int32_t *i) {
  if (*i < s->nfaces) return "face";
  *i = s->spring[*i - s->nfaces];
  return "spring";
}

static msim_status refuse(const ms_contact_surface *s, int32_t a, int32_t b, const char *how,
                          msim_error *err) {
  const int32_t last = a > b ? a : b;
  a = a > b ? b : a, b = last;
  const char *first = name_element(s, &a), *second = name_element(s, &b);
  return ms_error_set(err, MSIM_ERR_ARG,
                      "%s %d and %s %d %s, so that self_contact cannot keep them apart; move "
                      "particles, or remove self_contact",
                      first, a, second, b, how);
}

/* 1: the distance of the features exceeds errors of rounding. */
static int are_apart(const ms_feature_pair *p, const double *x) {
  double corner[4][3], size = 0;
  ms_feature_pair_get(p->node, x, corner);
  for (int c = 0; c < 4; c++) size = fmax(size, ms_vec3_norm(corner[c]));
  return ms_proximity_find(p->kind, corner).distance > ROUNDING * size;
}

static int features_touch(const ms_surface_pairs *pairs, const double *x, int32_t a, int32_t b) {
  ms_feature_pair list[MS_MOST_FEATURE_PAIRS];
  const int n = ms_surface_pairs_list(&pairs->surface, a, b, list);
  for (int i = 0; i < n; i++)
    if (!are_apart(&list[i], x)) return 1;
  return 0;
}

msim_status ms_surface_pairs_check(ms_surface_pairs *pairs, const double *x, msim_error *err) {
  const ms_contact_surface *s = &pairs->surface;
  ms_surface_pairs_set_boxes(pairs, x, x, 0);
  for (int32_t a = 0; a < s->nelements; a++) {
    int32_t node = 0, b;
    while ((b = ms_surface_tree_next(&pairs->tree, a, &node)) >= 0) {
      if (edge_pierces(s, x, a, b) || edge_pierces(s, x, b, a))
        return refuse(s, a, b, "intersect", err);
      if (features_touch(pairs, x, a, b)) return refuse(s, a, b, "touch", err);
    }
  }
  return MSIM_OK;
}
