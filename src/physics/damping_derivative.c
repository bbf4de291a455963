#include "physics/damping_derivative.h"

/* z_j - z_i */
static void subtract_rows(const ms_model *model, const double *z, int32_t i, int32_t j,
                          double d[3]) {
  const size_t stride = (size_t)model->unknowns.stride;
  for (int32_t c = 0; c < model->unknowns.dims; c++)
    d[c] = z[(size_t)c * stride + (size_t)j] - z[(size_t)c * stride + (size_t)i];
}

static double dot_dims(int32_t dims, const double a[3], const double b[3]) {
  double sum = 0;
  for (int32_t c = 0; c < dims; c++) sum += a[c] * b[c];
  return sum;
}

int ms_damping_derivative_block(const ms_model *model, const ms_damping_derivative *t, int32_t i,
                                int32_t half, double block[3][3]) {
  const int32_t dims = model->unknowns.dims, j = ms_half_edges_neighbour(&model->half_edges, half);
  const double damping = model->half_edges.damping[ms_half_edges_value(&model->half_edges, half)];
  double d[3], w[3];
  if (damping == 0) return 0;
  subtract_rows(model, t->x, i, j, d);
  subtract_rows(model, t->v, i, j, w);
  const double l2 = dot_dims(dims, d, d);
  if (l2 <= MS_MIN_LENGTH2) return 0;
  const double by = t->h * t->h * damping / l2, rate = dot_dims(dims, d, w);
  for (int32_t r = 0; r < dims; r++) {
    for (int32_t c = 0; c < dims; c++) block[r][c] = by * d[r] * (w[c] - 2 * rate / l2 * d[c]);
    block[r][r] += by * rate;
  }
  return 1;
}

/* y_i -= sum over half-edges of h^2 K (z_j - z_i), with z for z_j - z_i
 *   h^2 K z = h^2 c/l^2 ((d.w) z + (w.z - 2 (d.w)(d.z)/l^2) d).
 * dims: a constant for the compiler */
static inline void apply_damping_row(const ms_model *model, const ms_damping_derivative *t,
                                     int32_t dims, int32_t i, const double *z, double *y) {
  const ms_half_edges *half_edges = &model->half_edges;
  const size_t stride = (size_t)model->unknowns.stride;
  const ms_half_edge_span span = ms_half_edges_of_row(half_edges, i);
  double sum[3] = {0};
  for (int32_t at = span.begin; at < span.end; at += span.step) {
    const double damping = half_edges->damping[ms_half_edges_value(half_edges, at)];
    double l2 = 0, rate = 0, d_z = 0, w_z = 0, d[3], along[3];
    if (damping == 0) continue;
    for (int32_t c = 0; c < dims; c++) {
      const size_t own = (size_t)c * stride + (size_t)i,
                   other = (size_t)c * stride + (size_t)ms_half_edges_neighbour(half_edges, at);
      const double w = t->v[other] - t->v[own];
      d[c] = t->x[other] - t->x[own], along[c] = z[other] - z[own];
      l2 += d[c] * d[c], rate += d[c] * w, d_z += d[c] * along[c], w_z += w * along[c];
    }
    if (l2 <= MS_MIN_LENGTH2) continue;
    const double inverse = 1 / l2, by = t->h * t->h * damping * inverse,
                 turn = w_z - 2 * rate * inverse * d_z;
    for (int32_t c = 0; c < dims; c++) sum[c] += by * (rate * along[c] + turn * d[c]);
  }
  for (int32_t c = 0; c < dims; c++) y[(size_t)c * stride + (size_t)i] -= sum[c];
}

typedef struct damping_job {
  const ms_model *model;
  const ms_damping_derivative *t;
  const double *z;
  double *y;
} damping_job;

/* Rows in a chunk of work: some 20 us. */
enum { CHUNK = 64 };

static void apply_damping_chunk(void *data, int32_t begin, int32_t end) {
  const damping_job *j = data;
  const int32_t dims = j->model->unknowns.dims;
  for (int32_t i = begin; i < end; i++)
    if (dims == 3) apply_damping_row(j->model, j->t, 3, i, j->z, j->y);
    else apply_damping_row(j->model, j->t, dims, i, j->z, j->y);
}

void ms_damping_derivative_apply(const ms_model *model, const ms_damping_derivative *t,
                                 const double *z, double *y) {
  damping_job j = {.model = model, .t = t, .z = z, .y = y};
  ms_pool_run_chunks(model->pool, apply_damping_chunk, &j, model->unknowns.nfree, CHUNK);
}
