/* The matrix A = M - h D - h^2 J of force.h: coefficients, constraints, products with vectors */
#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "physics/kernels.h"

MS_TABLES(ms_kernels);

msim_status ms_coefficients_create(const ms_model *model, ms_coefficients *a, msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const size_t n = MS_GROUP * (size_t)model->halves.nslots;
  const int alike = !(model->passes & MSIM_SKIP_ZERO_REST_LENGTH);
  const size_t block = alike ? 1 : (size_t)model->rows.dims;
  const size_t diagonal = ms_diagonal_size(block) * (size_t)model->rows.first_pinned;
  *a = (ms_coefficients){.block = (int32_t)block,
                         .t = ms_new(alloc, n, sizeof(double)),
                         .diagonal = ms_new(alloc, diagonal, sizeof(double))};
  if (!alike) a->g = ms_new(alloc, n, sizeof(double));
  if (!alike) a->x = ms_rows_vector(model->scene, &model->rows);
  const int whole = a->t && a->diagonal && (alike || (a->g && a->x));
  return whole ? MSIM_OK : ms_fail_memory(err, "the matrix coefficients");
}

void ms_coefficients_destroy(const ms_model *model, ms_coefficients *a) {
  double *arrays[] = {a->t, a->g, a->x, a->diagonal};
  for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
    ms_delete(&model->scene->alloc, arrays[i]);
  *a = (ms_coefficients){0};
}

/* t = h^2 k; diagonal: m + h b + sum of t */
static void compute_alike(const ms_model *model, double h, ms_coefficients *a) {
  const ms_halves *halves = &model->halves;
  for (int32_t at = 0; at < MS_GROUP * halves->nslots; at++) a->t[at] = h * h * halves->k[at];
  for (int32_t r = 0; r < model->rows.first_pinned; r++) {
    const ms_span span = ms_halves_of(halves, r);
    a->diagonal[r] = model->mass[r] + a->drag;
    for (int32_t at = span.begin; at < span.end; at += span.step) a->diagonal[r] += a->t[at];
  }
}

/* One call of a kernel for all slice ranges, by all threads. */
typedef struct job {
  const ms_model *model;
  ms_coefficients *a;
  const double *x;
  double *y;
  double h, share; /* share: factor of the masses, 1 or 0 */
  int clamp;
  int32_t components;
} job;

/* Slice ranges in an item of work: some 10 us. */
enum { CHUNK = 64 };

static void compute_chunk(void *data, int32_t item) {
  const job *j = data;
  ms_kernels_of[j->model->isa]->coefficients(j->model, j->x, j->h, j->clamp, j->a, CHUNK * item,
                                             ms_chunk_end(&j->model->halves, CHUNK, item));
}

static void apply_chunk(void *data, int32_t item) {
  const job *j = data;
  const ms_kernels *kernels = ms_kernels_of[j->model->isa];
  const int32_t begin = CHUNK * item, end = ms_chunk_end(&j->model->halves, CHUNK, item);
  if (j->a->block == 1)
    kernels->apply_alike(j->model, j->a, j->share, j->components, j->x, j->y, begin, end);
  else kernels->apply(j->model, j->a, j->share, j->x, j->y, begin, end);
}

void ms_coefficients_compute(const ms_model *model, const double *x, double h, int clamp,
                             ms_coefficients *a) {
  const ms_halves *halves = &model->halves;
  a->drag = model->passes & MSIM_SKIP_DRAG ? h * model->scene->drag : 0;
  if (a->block == 1) {
    compute_alike(model, h, a);
    return;
  }
  memcpy(a->x, x, (size_t)model->rows.dims * (size_t)model->rows.stride * sizeof *x);
  job j = {.model = model, .a = a, .x = x, .h = h, .clamp = clamp};
  ms_pool_run(model->pool, compute_chunk, &j, ms_chunks(halves, CHUNK));
  ms_halves_add_parts(halves, (int32_t)ms_diagonal_size((size_t)a->block),
                      (size_t)model->rows.first_pinned, a->diagonal);
}

/* Weight of a constraint over the largest diagonal element: large enough for Newton's method to
 * take the row as fixed, small enough for single precision. */
#define HEAVY 1e4

void ms_coefficients_hold(const ms_model *model, ms_hold *hold, int32_t n, ms_coefficients *a) {
  const size_t sd = (size_t)model->rows.first_pinned, dims = (size_t)a->block;
  a->hold = hold, a->nholds = n;
  for (int32_t i = 0; i < n; i++) {
    ms_hold *g = &hold[i];
    double *own = a->diagonal + g->row, largest = model->mass[g->row];
    for (size_t c = 0; c < dims; c++) largest = fmax(largest, own[c * sd]);
    g->weight = HEAVY * largest;
    for (size_t b = 0; b < dims; b++) own[b * sd] += g->drag;
    for (int32_t k = 0; k < g->n; k++)
      for (size_t b = 0; b < dims; b++)
        for (size_t c = b; c < dims; c++)
          own[ms_diagonal_entry(dims, b, c) * sd] += (g->weight - g->drag) *
                                                     g->along[k][model->rows.axis[b]] *
                                                     g->along[k][model->rows.axis[c]];
  }
}

/* q += by (share weight n n^T + drag (I - n n^T)) p for each constraint, n n^T summed over its
 * directions. Returns p.(q - q before). */
static double apply_holds(const ms_model *model, const ms_coefficients *a, double share, double by,
                          const double *p, double *q) {
  double sum = 0;
  for (int32_t i = 0; i < a->nholds; i++) {
    const ms_hold *g = &a->hold[i];
    double own[3], add[3];
    ms_row_get(&model->rows, p, g->row, own);
    for (int c = 0; c < 3; c++) add[c] = by * g->drag * own[c];
    for (int32_t k = 0; k < g->n; k++)
      ms_axpy3(by * (share * g->weight - g->drag) * ms_dot3(g->along[k], own), g->along[k], add);
    sum += ms_dot3(add, own);
    double to[3];
    ms_row_get(&model->rows, q, g->row, to);
    ms_axpy3(1, add, to);
    ms_row_put(&model->rows, to, g->row, q);
  }
  return sum;
}

double ms_coefficients_apply_holds(const ms_model *model, const ms_coefficients *a, double by,
                                   const double *p, double *q) {
  return apply_holds(model, a, 1, by, p, q);
}

static void apply(const ms_model *model, const ms_coefficients *a, double share, int32_t components,
                  const double *x, double *y) {
  const size_t stride = (size_t)model->rows.stride, end = (size_t)model->rows.first_pinned;
  job j = {.model = model,
           .a = (ms_coefficients *)a,
           .x = x,
           .y = y,
           .share = share,
           .components = components};
  ms_pool_run(model->pool, apply_chunk, &j, ms_chunks(&model->halves, CHUNK));
  ms_halves_add_parts(&model->halves, components, stride, y);
  apply_holds(model, a, share, 1, x, y);
  for (size_t c = 0; c < (size_t)components; c++)
    memset(y + c * stride + end, 0, (stride - end) * sizeof *y);
}

void ms_coefficients_apply(const ms_model *model, const ms_coefficients *a, const double *x,
                           double *y) {
  apply(model, a, 1, model->rows.dims, x, y);
}

void ms_coefficients_apply_massless(const ms_model *model, const ms_coefficients *a,
                                    const double *x, double *y) {
  apply(model, a, 0, model->rows.dims, x, y);
}

void ms_coefficients_apply_one(const ms_model *model, const ms_coefficients *a, const double *x,
                               double *y) {
  apply(model, a, 1, 1, x, y);
}

/* y_i = |A_ii| |x_i| + sum over half-edges of (|t| I + g |d| |d|^T) |x_j| */
static void apply_abs_row(const ms_model *model, const ms_coefficients *a, const double *x,
                          size_t row, double *y) {
  const size_t stride = (size_t)model->rows.stride, sd = (size_t)model->rows.first_pinned;
  const size_t dims = (size_t)model->rows.dims;
  const int alike = a->block == 1;
  for (size_t c = 0; c < dims; c++) {
    y[c * stride + row] = alike ? fabs(a->diagonal[row] * x[c * stride + row]) : 0;
    for (size_t b = 0; b < dims && !alike; b++)
      y[c * stride + row] +=
          fabs(a->diagonal[ms_diagonal_entry(dims, c, b) * sd + row] * x[b * stride + row]);
  }
  const ms_span span = ms_halves_of(&model->halves, (int32_t)row);
  for (int32_t at = span.begin; at < span.end; at += span.step) {
    const size_t j = (size_t)model->halves.neighbour[at];
    double d[3] = {0}, along = 0;
    for (size_t c = 0; c < dims && !alike; c++) {
      d[c] = fabs(a->x[c * stride + j] - a->x[c * stride + row]);
      along += d[c] * fabs(x[c * stride + j]);
    }
    for (size_t c = 0; c < dims; c++)
      y[c * stride + row] +=
          fabs(a->t[at] * x[c * stride + j]) + (alike ? 0 : a->g[at] * along * d[c]);
  }
}

void ms_coefficients_apply_abs(const ms_model *model, const ms_coefficients *a, const double *x,
                               double *y) {
  for (size_t row = 0; row < (size_t)model->rows.nfree; row++) apply_abs_row(model, a, x, row, y);
}
