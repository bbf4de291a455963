#include "physics/angle_springs.h"

#include <math.h>

#include "base/vec3.h"
#include "physics/angle_kernels.h"

MS_TABLES(ms_angle_kernels);

typedef struct angle_job {
  const ms_model *model;
  const ms_coefficients *a;
  const double *x, *v; /* of nonlinearity: v = d */
  ms_operands product;
  double by; /* of nonlinearity: s; of the matrix: h */
  int clamp;
} angle_job;

static double sum_chunks(ms_pool_chunk *work, const angle_job *j) {
  const ms_angles *g = &j->model->angles;
  double sum = 0;
  const int32_t n =
      ms_pool_run_chunks(j->model->pool, work, (void *)(uintptr_t)j, g->nslots, MS_ANGLE_CHUNK);
  for (int32_t i = 0; i < n; i++) sum += g->sum[i];
  return sum;
}

static void run_chunks(ms_pool_chunk *work, const angle_job *j) {
  ms_pool_run_chunks(j->model->pool, work, (void *)(uintptr_t)j, j->model->angles.nslots,
                     MS_ANGLE_CHUNK);
}

/* The end of a range of slots that hold angles */
static int32_t end_of_angles(const ms_model *model, int32_t end) {
  return end < model->angles.n ? end : model->angles.n;
}

static void run_rows(ms_pool_chunk *work, const angle_job *j) {
  enum { ROWS = 256 };
  ms_pool_run_chunks(j->model->pool, work, (void *)(uintptr_t)j, j->model->unknowns.nfree, ROWS);
}

static void add_slices(void *data, int32_t begin, int32_t end) {
  const angle_job *j = data;
  ms_angle_kernels_of[j->model->isa]->add_corners(j->model, j->by, j->product, begin, end);
}

/* y of each unknown += by times the sum of its corners */
static void add_corners(const angle_job *j) {
  enum { SLICES = 64 };
  ms_pool_run_chunks(j->model->pool, add_slices, (void *)(uintptr_t)j,
                     j->model->angles.corners.nslices, SLICES);
}

/* A row of a vector in the model's axes, 0 in those it has not */
static inline void load_row(const ms_model *model, const double *vec, int32_t row, double out[3]) {
  const size_t stride = (size_t)model->unknowns.stride;
  vec += row;
  out[0] = vec[0], out[1] = vec[stride];
  out[2] = model->unknowns.dims == 3 ? vec[2 * stride] : 0;
}

/* The rows of i, j and k less that of j */
static inline void load_edges(const ms_model *model, int32_t e, const double *vec, double p[3],
                              double q[3]) {
  const int32_t *row = model->angles.row + 3 * (size_t)e;
  double j[3];
  load_row(model, vec, row[0], p), load_row(model, vec, row[1], j), load_row(model, vec, row[2], q);
  for (int c = 0; c < 3; c++) p[c] -= j[c], q[c] -= j[c];
}

static ms_angle measure(const ms_model *model, int32_t e, const double *x) {
  double p[3], q[3];
  ms_angle at;
  load_edges(model, e, x, p, q);
  ms_angle_measure(p, q, &at);
  return at;
}

static ms_angle_spring get_spring(const ms_model *model, int32_t e) {
  const ms_angles *g = &model->angles;
  return (ms_angle_spring){g->k[e], g->bend[e], g->damping[e]};
}

/*------------------------------------- forces ---------------------------------------------------*/

void ms_angle_springs_reset_forces(const ms_model *model) {
  if (model->angles.n == 0) return;
  if (model->base_force) ms_vector_copy_all(model->shape, model->base_force, model->added_force);
  else ms_vector_clear_all(model->shape, model->added_force);
}

static void compute_force(const ms_model *model, int32_t e, const double *x, const double *v,
                          double fi[3], double fk[3]) {
  const ms_angle at = measure(model, e, x);
  const ms_angle_spring s = get_spring(model, e);
  const int damped = v && s.damping > 0;
  double vp[3], vq[3];
  if (damped) load_edges(model, e, v, vp, vq);
  ms_angle_force(&at, &s, damped ? vp : NULL, damped ? vq : NULL, fi, fk);
}

void ms_angle_springs_force_at(const ms_model *model, int32_t corner, const double *x,
                               const double *v, double f[3]) {
  const ms_unknowns *rows = &model->unknowns;
  double fi[3], fk[3];
  compute_force(model, corner / 3, x, v, fi, fk);
  f[0] = f[1] = f[2] = 0;
  for (int32_t c = 0; c < rows->dims; c++)
    f[rows->axis[c]] = corner % 3 == 0 ? fi[c] : corner % 3 == 1 ? -(fi[c] + fk[c]) : fk[c];
}

static void compute_forces(void *data, int32_t begin, int32_t end) {
  const angle_job *j = data;
  ms_angle_kernels_of[j->model->isa]->forces(j->model, j->x, j->v, begin, end);
}

void ms_angle_springs_add_forces(const ms_model *model, const double *x, const double *v) {
  const angle_job j = {
      .model = model, .x = x, .v = v, .product = {.y = model->added_force}, .by = 1};
  if (model->angles.n == 0) return;
  run_chunks(compute_forces, &j);
  add_corners(&j);
}

/*------------------------------------- energies -------------------------------------------------*/

double ms_angle_springs_energy_of(const ms_model *model, int32_t e, const double *x) {
  const ms_angle at = measure(model, e, x);
  const ms_angle_spring s = get_spring(model, e);
  return ms_angle_energy(&at, &s);
}

static void sum_energies(void *data, int32_t begin, int32_t end) {
  const angle_job *j = data;
  double sum = 0;
  for (int32_t e = begin; e < end_of_angles(j->model, end); e++)
    sum += ms_angle_springs_energy_of(j->model, e, j->x);
  j->model->angles.sum[begin / MS_ANGLE_CHUNK] = sum;
}

double ms_angle_springs_energy(const ms_model *model, const double *x) {
  return sum_chunks(sum_energies, &(angle_job){.model = model, .x = x});
}

/* u.Hess E u at p + node u[0], q + node u[1] */
static double find_curvature(const ms_angle_spring *s, const double edge[2][3],
                             const double u[2][3], double node) {
  const ms_angle_spring elastic = {s->k, s->bend, 0};
  double moved[2][3], element[MS_ANGLE_ELEMENT], y[2][3];
  ms_angle at;
  for (int i = 0; i < 2; i++)
    for (int c = 0; c < 3; c++) moved[i][c] = edge[i][c] + node * u[i][c];
  ms_angle_measure(moved[0], moved[1], &at);
  ms_angle_matrix(&at, &elastic, 1, 0, element);
  ms_angle_multiply(element, u[0], u[1], y[0], y[1]);
  return ms_vec3_dot(u[0], y[0]) + ms_vec3_dot(u[1], y[1]);
}

/* E(e + u) - E(e) - grad E.u = integral of (1 - s) u.Hess E(e + s u) u ds: small ones by Gauss's
 * rule of 3 points, where the difference of energies has fewer than half its digits. */
static double find_nonlinearity(const ms_angle_spring *s, const double edge[2][3],
                                const double u[2][3]) {
  static const double node[3] = {0.1127016653792583, 0.5, 0.8872983346207417};
  static const double weight[3] = {5. / 18, 4. / 9, 5. / 18};
  double moved[2][3], fi[3], fk[3], sum = 0;
  ms_angle here, there;
  for (int i = 0; i < 2; i++)
    for (int c = 0; c < 3; c++) moved[i][c] = edge[i][c] + u[i][c];
  ms_angle_measure(edge[0], edge[1], &here);
  ms_angle_measure(moved[0], moved[1], &there);
  ms_angle_force(&here, s, NULL, NULL, fi, fk);
  const double before = ms_angle_energy(&here, s), after = ms_angle_energy(&there, s);
  const double linear = -ms_vec3_dot(fi, u[0]) - ms_vec3_dot(fk, u[1]);
  const double difference = after - before - linear;
  if (fabs(difference) > 1e-8 * (after + before + fabs(linear))) return difference;
  for (int i = 0; i < 3; i++)
    sum += weight[i] * (1 - node[i]) * find_curvature(s, edge, u, node[i]);
  return sum;
}

static void sum_nonlinearities(void *data, int32_t begin, int32_t end) {
  const angle_job *j = data;
  double sum = 0;
  for (int32_t e = begin; e < end_of_angles(j->model, end); e++) {
    const ms_angle_spring s = get_spring(j->model, e);
    double edge[2][3], u[2][3];
    load_edges(j->model, e, j->x, edge[0], edge[1]);
    load_edges(j->model, e, j->v, u[0], u[1]);
    for (int i = 0; i < 2; i++)
      for (int c = 0; c < 3; c++) u[i][c] *= j->by;
    sum += ms_unknowns_own_share(&j->model->unknowns, 3, j->model->angles.row + 3 * (size_t)e) *
           find_nonlinearity(&s, (const double(*)[3])edge, (const double(*)[3])u);
  }
  j->model->angles.sum[begin / MS_ANGLE_CHUNK] = sum;
}

double ms_angle_springs_nonlinearity(const ms_model *model, const double *x, const double *d,
                                     double s) {
  return sum_chunks(sum_nonlinearities, &(angle_job){.model = model, .x = x, .v = d, .by = s});
}

/*------------------------------------- matrix ---------------------------------------------------*/

static void compute_elements(void *data, int32_t begin, int32_t end) {
  const angle_job *j = data;
  for (int32_t e = begin; e < end_of_angles(j->model, end); e++) {
    const ms_angle at = measure(j->model, e, j->a->x);
    const ms_angle_spring s = get_spring(j->model, e);
    double element[MS_ANGLE_ELEMENT];
    ms_angle_matrix(&at, &s, j->by, j->clamp, element);
    double *to = j->a->angles + MS_SLICE * MS_ANGLE_ELEMENT * (size_t)(e / MS_SLICE) + e % MS_SLICE;
    for (size_t m = 0; m < MS_ANGLE_ELEMENT; m++) to[MS_SLICE * m] = element[m];
  }
}

static void add_diagonal_blocks(void *data, int32_t begin, int32_t end) {
  const angle_job *j = data;
  const ms_angles *g = &j->model->angles;
  const size_t dims = (size_t)j->model->unknowns.dims;
  const size_t sd = (size_t)j->model->unknowns.first_pinned;
  for (int32_t r = begin; r < end; r++)
    for (int32_t at = g->of.first[r]; at < g->of.first[r + 1]; at++) {
      const int32_t corner = g->of.item[at] % 3;
      double element[MS_ANGLE_ELEMENT], block[3][3];
      ms_angle_springs_get_element(j->a, g->of.item[at] / 3, element);
      ms_angle_block(element, corner, corner, block);
      for (size_t b = 0; b < dims; b++)
        for (size_t c = b; c < dims; c++)
          j->a->diagonal[ms_coefficients_diagonal_element(dims, b, c) * sd + (size_t)r] +=
              block[b][c];
    }
}

void ms_angle_springs_add_matrix(const ms_model *model, double h, int clamp, ms_coefficients *a) {
  const angle_job j = {.model = model, .a = a, .by = h, .clamp = clamp};
  if (model->angles.n == 0) return;
  run_chunks(compute_elements, &j);
  run_rows(add_diagonal_blocks, &j);
}

static void multiply_elements(void *data, int32_t begin, int32_t end) {
  const angle_job *j = data;
  j->model->angles.sum[begin / MS_ANGLE_CHUNK] =
      ms_angle_kernels_of[j->model->isa]->multiply(j->model, j->a, j->product, begin, end);
}

double ms_angle_springs_product_of(const ms_model *model, const ms_coefficients *a, int32_t e,
                                   ms_operands o) {
  const size_t stride = (size_t)model->unknowns.stride;
  const int32_t *row = model->angles.row + 3 * (size_t)e;
  double element[MS_ANGLE_ELEMENT], p[3] = {0}, q[3] = {0}, yp[3], yq[3];
  ms_angle_springs_get_element(a, e, element);
  for (size_t c = 0; c < (size_t)model->unknowns.dims; c++) {
    const double j = ms_operands_get(&o, c * stride + (size_t)row[1]);
    p[c] = ms_operands_get(&o, c * stride + (size_t)row[0]) - j;
    q[c] = ms_operands_get(&o, c * stride + (size_t)row[2]) - j;
  }
  ms_angle_multiply(element, p, q, yp, yq);
  return ms_vec3_dot(p, yp) + ms_vec3_dot(q, yq);
}

double ms_angle_springs_apply(const ms_model *model, const ms_coefficients *a, double by,
                              ms_operands o) {
  const angle_job j = {.model = model, .a = a, .product = o, .by = by};
  if (model->angles.n == 0) return 0;
  const double sum = sum_chunks(multiply_elements, &j);
  add_corners(&j);
  return by * sum;
}

/* Row r of y += |block| |x| for the other corners of angle e */
static void apply_abs_corner(const ms_model *model, const ms_coefficients *a, int32_t corner,
                             const double *x, int32_t row, double *y) {
  const size_t stride = (size_t)model->unknowns.stride;
  double element[MS_ANGLE_ELEMENT], block[3][3], other[3];
  ms_angle_springs_get_element(a, corner / 3, element);
  for (int32_t c = 0; c < 3; c++) {
    if (c == corner % 3) continue;
    ms_angle_block(element, corner % 3, c, block);
    load_row(model, x, model->angles.row[corner - corner % 3 + c], other);
    for (size_t i = 0; i < (size_t)model->unknowns.dims; i++)
      for (int k = 0; k < 3; k++) y[i * stride + (size_t)row] += fabs(block[i][k] * other[k]);
  }
}

void ms_angle_springs_apply_abs(const ms_model *model, const ms_coefficients *a, const double *x,
                                double *y) {
  const ms_angles *g = &model->angles;
  for (int32_t r = 0; r < model->unknowns.nfree && g->n; r++)
    for (int32_t at = g->of.first[r]; at < g->of.first[r + 1]; at++)
      apply_abs_corner(model, a, g->of.item[at], x, r, y);
}

double ms_angle_springs_shift(const ms_model *model, const ms_coefficients *a, int32_t row) {
  const ms_angles *g = &model->angles;
  double shift = 0;
  if (g->n == 0) return 0;
  for (int32_t at = g->of.first[row]; at < g->of.first[row + 1]; at++) {
    const int32_t corner = g->of.item[at] % 3;
    double element[MS_ANGLE_ELEMENT], block[3][3], least = 0;
    ms_angle_springs_get_element(a, g->of.item[at] / 3, element);
    ms_angle_block(element, corner, corner, block);
    for (int r = 0; r < 3; r++)
      least = fmin(least, block[r][r] - fabs(block[r][(r + 1) % 3]) - fabs(block[r][(r + 2) % 3]));
    shift -= least;
  }
  return shift;
}
