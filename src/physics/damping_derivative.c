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

/* Slice ranges in a chunk of work: some 10 us. */
enum { CHUNK = 8 };

static void apply_damping_chunk(void *data, int32_t begin, int32_t end) {
  const ms_damping_job *j = data;
  ms_damping_kernels_of[j->model->isa]->apply(j, begin, end);
}

void ms_damping_derivative_apply(const ms_model *model, const ms_damping_derivative *t,
                                 const double *z, double *y) {
  const ms_half_edges *half_edges = &model->half_edges;
  ms_damping_job j = {.model = model, .t = t, .z = z, .y = y};
  ms_pool_run_chunks(model->pool, apply_damping_chunk, &j, ms_half_edges_count_ranges(half_edges),
                     CHUNK);
  ms_half_edges_add_part_sums(half_edges, model->unknowns.dims, (size_t)model->unknowns.stride, y);
}
