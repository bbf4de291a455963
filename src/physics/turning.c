#include "physics/turning.h"

/* z_j - z_i */
static void difference(const ms_model *model, const double *z, int32_t i, int32_t j, double d[3]) {
  const size_t stride = (size_t)model->rows.stride;
  for (int32_t c = 0; c < model->rows.dims; c++)
    d[c] = z[(size_t)c * stride + (size_t)j] - z[(size_t)c * stride + (size_t)i];
}

static double dot(int32_t dims, const double a[3], const double b[3]) {
  double sum = 0;
  for (int32_t c = 0; c < dims; c++) sum += a[c] * b[c];
  return sum;
}

int ms_turning_block(const ms_model *model, const ms_turning *t, int32_t i, int32_t half,
                     double block[3][3]) {
  const int32_t dims = model->rows.dims, j = model->halves.neighbour[half];
  double d[3], w[3];
  if (model->halves.damping[half] == 0) return 0;
  difference(model, t->x, i, j, d);
  difference(model, t->v, i, j, w);
  const double l2 = dot(dims, d, d);
  if (l2 <= MS_ZERO_LENGTH2) return 0;
  const double by = t->h * t->h * model->halves.damping[half] / l2, rate = dot(dims, d, w);
  for (int32_t r = 0; r < dims; r++) {
    for (int32_t c = 0; c < dims; c++) block[r][c] = by * d[r] * (w[c] - 2 * rate / l2 * d[c]);
    block[r][r] += by * rate;
  }
  return 1;
}

/* y_i -= sum over half-edges of h^2 K (z_j - z_i) */
static void apply_row(const ms_model *model, const ms_turning *t, int32_t i, const double *z,
                      double *y) {
  const int32_t dims = model->rows.dims;
  const ms_span span = ms_halves_of(&model->halves, i);
  for (int32_t at = span.begin; at < span.end; at += span.step) {
    double block[3][3], along[3];
    if (!ms_turning_block(model, t, i, at, block)) continue;
    difference(model, z, i, model->halves.neighbour[at], along);
    for (int32_t r = 0; r < dims; r++)
      y[(size_t)r * (size_t)model->rows.stride + (size_t)i] -= dot(dims, block[r], along);
  }
}

typedef struct job {
  const ms_model *model;
  const ms_turning *t;
  const double *z;
  double *y;
} job;

/* Rows in an item of work: some 20 us. */
enum { CHUNK = 64 };

static void apply_chunk(void *data, int32_t item) {
  const job *j = data;
  const int32_t n = j->model->rows.nfree, begin = CHUNK * item;
  const int32_t end = n - begin < CHUNK ? n : begin + CHUNK;
  for (int32_t i = begin; i < end; i++) apply_row(j->model, j->t, i, j->z, j->y);
}

void ms_turning_apply(const ms_model *model, const ms_turning *t, const double *z, double *y) {
  job j = {.model = model, .t = t, .z = z, .y = y};
  ms_pool_run(model->pool, apply_chunk, &j, (model->rows.nfree + CHUNK - 1) / CHUNK);
}
