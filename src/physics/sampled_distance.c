#include "physics/sampled_distance.h"

#include <math.h>
#include <string.h>

#include "base/vec3.h"

/*------------------------------------- triangles ------------------------------------------------*/

/* The point of the triangle nearest to q, by its Voronoi regions (Ericson, Real-time collision
 * detection, 5.1.5) */
static void find_nearest(double t[3][3], const double q[3], double nearest[3]) {
  double ab[3], ac[3], ap[3], bp[3], cp[3], v = 0, w = 0;
  for (int i = 0; i < 3; i++) {
    ab[i] = t[1][i] - t[0][i], ac[i] = t[2][i] - t[0][i];
    ap[i] = q[i] - t[0][i], bp[i] = q[i] - t[1][i], cp[i] = q[i] - t[2][i];
  }
  const double d1 = ms_vec3_dot(ab, ap), d2 = ms_vec3_dot(ac, ap), d3 = ms_vec3_dot(ab, bp),
               d4 = ms_vec3_dot(ac, bp), d5 = ms_vec3_dot(ab, cp), d6 = ms_vec3_dot(ac, cp);
  const double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
  if (d1 <= 0 && d2 <= 0) v = 0, w = 0;
  else if (d3 >= 0 && d4 <= d3) v = 1;
  else if (d6 >= 0 && d5 <= d6) w = 1;
  else if (vc <= 0 && d1 >= 0 && d3 <= 0) v = d1 / (d1 - d3);
  else if (vb <= 0 && d2 >= 0 && d6 <= 0) w = d2 / (d2 - d6);
  else if (va <= 0 && d4 >= d3 && d5 >= d6) w = (d4 - d3) / (d4 - d3 + d5 - d6), v = 1 - w;
  else v = vb / (va + vb + vc), w = vc / (va + vb + vc);
  for (int i = 0; i < 3; i++) nearest[i] = t[0][i] + v * ab[i] + w * ac[i];
}

/* The unit normal that points up */
static void find_normal(double t[3][3], double n[3]) {
  double a[3], b[3];
  for (int i = 0; i < 3; i++) a[i] = t[1][i] - t[0][i], b[i] = t[2][i] - t[0][i];
  for (int i = 0; i < 3; i++)
    n[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
  const double length = (n[2] < 0 ? -1 : 1) * ms_vec3_norm(n);
  for (int i = 0; i < 3; i++) n[i] /= length;
}

/*------------------------------------- height fields --------------------------------------------*/

static int32_t limit(int32_t i, int32_t n) { return i < 0 ? 0 : i > n - 1 ? n - 1 : i; }

/* Corner (i, j) of the cells; cells beyond the border reach as far as `far`, from the grid. */
static void get_corner(const ms_solid *s, int32_t i, int32_t j, double far, double x[3]) {
  const ms_samples *m = s->samples;
  const int32_t at[2] = {i, j};
  for (int c = 0; c < 2; c++) {
    const double inside = limit(at[c], m->n[c]) * m->spacing[c];
    x[c] = inside + (at[c] < 0 ? -far : at[c] > m->n[c] - 1 ? far : 0);
  }
  x[2] = m->values[(size_t)limit(i, m->n[0]) * (size_t)m->n[1] + (size_t)limit(j, m->n[1])];
}

/* Triangle k, 0 or 1, of the cell from corner (i, j) on */
static void get_triangle(const ms_solid *s, int32_t i, int32_t j, int k, double far,
                         double t[3][3]) {
  get_corner(s, i, j, far, t[0]);
  get_corner(s, i + 1, j + 1, far, t[1]);
  get_corner(s, k ? i : i + 1, k ? j + 1 : j, far, t[2]);
}

/* The cell of q, -1 and n - 1 beyond the border, and which of its triangles is above or below q */
typedef struct cell {
  int32_t i, j;
  int k;
} cell;

static cell find_cell(const ms_solid *s, const double q[3]) {
  const ms_samples *m = s->samples;
  int32_t at[2];
  double share[2];
  for (int c = 0; c < 2; c++) {
    const double u = q[c] / m->spacing[c];
    at[c] = u < 0 ? -1 : u > m->n[c] - 1 ? m->n[c] - 1 : limit((int32_t)u, m->n[c] - 1);
    share[c] = at[c] < 0 || at[c] == m->n[c] - 1 ? 0 : u - at[c];
  }
  return (cell){at[0], at[1], share[1] > share[0]};
}

/* The height of the surface at q, and its normal there */
static double find_height(const ms_solid *s, const cell *at, double far, const double q[3],
                          double n[3]) {
  double t[3][3];
  get_triangle(s, at->i, at->j, at->k, far, t);
  find_normal(t, n);
  return t[0][2] - (n[0] * (q[0] - t[0][0]) + n[1] * (q[1] - t[0][1])) / n[2];
}

/* Take the two triangles of cell (i, j) into account, unless all its heights differ from q_2 by
 * more than *least. */
static void search_cell(const ms_solid *s, int32_t i, int32_t j, double far, const double q[3],
                        double *least, double nearest[3]) {
  double t[3][3], point[3], d[3], other[3];
  get_triangle(s, i, j, 0, far, t);
  get_corner(s, i, j + 1, far, other);
  const double low = fmin(fmin(t[0][2], t[1][2]), fmin(t[2][2], other[2])),
               high = fmax(fmax(t[0][2], t[1][2]), fmax(t[2][2], other[2]));
  if (fmax(low - q[2], q[2] - high) > *least) return;
  for (int k = 0; k < 2; k++) {
    if (k) memcpy(t[2], other, sizeof other);
    find_nearest(t, q, point);
    for (int c = 0; c < 3; c++) d[c] = q[c] - point[c];
    const double distance = ms_vec3_norm(d);
    if (distance < *least) *least = distance, memcpy(nearest, point, sizeof d);
  }
}

/* The nearest point of the cells whose distance in i or j from the cell of q is `ring`, if it is
 * nearer than *least */
static void search_ring(const ms_solid *s, const cell *at, int32_t ring, double far,
                        const double q[3], double *least, double nearest[3]) {
  const int32_t *n = s->samples->n;
  for (int32_t i = at->i - ring; i <= at->i + ring; i++) {
    const int is_side = i == at->i - ring || i == at->i + ring;
    const int32_t step = is_side || ring == 0 ? 1 : 2 * ring; /* the inner ones are known */
    for (int32_t j = at->j - ring; j <= at->j + ring; j += step)
      if (i >= -1 && j >= -1 && i < n[0] && j < n[1]) search_cell(s, i, j, far, q, least, nearest);
  }
}

/* Rings of cells are searched until all others are farther than the nearest point. */
static double search_nearest(const ms_solid *s, const cell *at, double far, const double q[3],
                             double nearest[3]) {
  const ms_samples *m = s->samples;
  const int32_t most = m->n[0] + m->n[1];
  double least = INFINITY;
  for (int32_t ring = 0; ring <= most; ring++) {
    search_ring(s, at, ring, far, q, &least, nearest);
    if (least <= ring * fmin(m->spacing[0], m->spacing[1])) break;
  }
  return least;
}

double ms_sampled_distance_of_heights(const ms_solid *s, const double q[3], double n[3]) {
  const ms_samples *m = s->samples;
  const double cells = fmax(m->spacing[0], m->spacing[1]);
  const double far = fabs(q[0]) + fabs(q[1]) + 2 * cells * (m->n[0] + m->n[1]);
  const cell at = find_cell(s, q);
  const double above = q[2] - find_height(s, &at, far, q, n), bound = above * m->least_cosine;
  const int is_free = s->inside ? above < 0 : above > 0;
  if (is_free && fabs(bound) > cells) return bound;
  double nearest[3], d[3];
  const double length = search_nearest(s, &at, far, q, nearest), side = above < 0 ? -1 : 1;
  for (int c = 0; c < 3; c++) d[c] = q[c] - nearest[c];
  if (length > 1e-9 * cells)
    for (int c = 0; c < 3; c++) n[c] = side * d[c] / length;
  return side * length;
}

/*------------------------------------- grids ----------------------------------------------------*/

/* f and its gradient at a point of the grid */
static double interpolate(const ms_samples *m, const double q[3], double gradient[3]) {
  size_t at[3];
  double share[3], f = 0;
  for (int c = 0; c < 3; c++) {
    const double u = q[c] / m->spacing[c];
    at[c] = (size_t)limit((int32_t)u, m->n[c] - 1);
    share[c] = u - (double)at[c];
    gradient[c] = 0;
  }
  for (int corner = 0; corner < 8; corner++) {
    size_t index = 0;
    double weight[3], sign[3];
    for (int c = 0; c < 3; c++) {
      const int upper = corner >> c & 1;
      index = index * (size_t)m->n[c] + at[c] + (size_t)upper;
      weight[c] = upper ? share[c] : 1 - share[c], sign[c] = (upper ? 1 : -1) / m->spacing[c];
    }
    const double value = m->values[index];
    f += weight[0] * weight[1] * weight[2] * value;
    for (int c = 0; c < 3; c++)
      gradient[c] += sign[c] * weight[(c + 1) % 3] * weight[(c + 2) % 3] * value;
  }
  return f;
}

double ms_sampled_distance_of_grid(const ms_solid *s, const double q[3], double n[3]) {
  const ms_samples *m = s->samples;
  double inside[3], out[3], gradient[3];
  for (int c = 0; c < 3; c++) {
    inside[c] = fmax(0, fmin(q[c], (m->n[c] - 1) * m->spacing[c]));
    out[c] = q[c] - inside[c];
  }
  const double f = interpolate(m, inside, gradient), beyond = ms_vec3_norm(out);
  const double slope = ms_vec3_norm(gradient);
  for (int c = 0; c < 3; c++) n[c] = slope > 0 ? gradient[c] / slope : c == 2;
  if (beyond == 0) return f / fmax(slope, 0.5);
  for (int c = 0; c < 3; c++) n[c] = out[c] / beyond;
  return hypot(beyond, f);
}
