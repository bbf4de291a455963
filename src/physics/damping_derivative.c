#include "physics/damping_derivative.h"

#include "physics/damping_kernels.h"

MS_TABLES(ms_damping_kernels);

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
 *   h^2 K z = h^2 c/l^2 ((d.w) z + (w.z - 2 (d.w)(d.z)/l^2) d). */
static void apply_damping_row(const ms_damping_job *job, int32_t i) {
  const ms_damping_derivative *t = job->t;
  const ms_half_edges *half_edges = &job->model->half_edges;
  const int32_t dims = job->model->unknowns.dims;
  const ms_half_edge_span span = ms_half_edges_of_row(half_edges, i);
  double sum[3] = {0};
  for (int32_t at = span.begin; at < span.end; at += span.step) {
    const int32_t j = ms_half_edges_neighbour(half_edges, at);
    const double damping = half_edges->damping[ms_half_edges_value(half_edges, at)];
    double d[3], w[3], along[3];
    if (damping == 0) continue;
    subtract_rows(job->model, t->x, i, j, d);
    subtract_rows(job->model, t->v, i, j, w);
    subtract_rows(job->model, job->z, i, j, along);
    const double l2 = dot_dims(dims, d, d), rate = dot_dims(dims, d, w);
    if (l2 <= MS_MIN_LENGTH2) continue;
    const double inverse = 1 / l2, by = t->h * t->h * damping * inverse,
                 turn = dot_dims(dims, w, along) - 2 * rate * inverse * dot_dims(dims, d, along);
    for (int32_t c = 0; c < dims; c++) sum[c] += by * (rate * along[c] + turn * d[c]);
  }
  for (int32_t c = 0; c < dims; c++)
    job->y[(size_t)c * (size_t)job->model->unknowns.stride + (size_t)i] -= sum[c];
}

/* Slices in a chunk of work: some 10 us. */
enum { CHUNK = 8 };

static void apply_damping_slices(void *data, int32_t begin, int32_t end) {
  const ms_damping_job *j = data;
  ms_damping_kernels_of[j->model->isa]->apply(j, begin, end);
}

/* The split row of a part, if it is the first one of the row */
static void apply_damping_part(void *data, int32_t part) {
  const ms_damping_job *j = data;
  const int32_t row = j->model->half_edges.part_row[part];
  if (j->model->half_edges.first_part[row] == part) apply_damping_row(j, row);
}

void ms_damping_derivative_apply(const ms_model *model, const ms_damping_derivative *t,
                                 const double *z, double *y) {
  ms_damping_job j = {.model = model, .t = t, .z = z, .y = y};
  ms_pool_run_chunks(model->pool, apply_damping_slices, &j, model->half_edges.nslices, CHUNK);
  ms_pool_run(model->pool, apply_damping_part, &j, model->half_edges.nparts);
}
