/* The matrix A = M - h D - h^2 J of force.h: coefficients, constraints, products with vectors */
#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "physics/angle.h"
#include "physics/angle_springs.h"
#include "physics/constraint_weight.h"
#include "physics/external_force.h"
#include "physics/law_springs.h"
#include "physics/matrix_kernels.h"
#include "physics/particle_blocks.h"
#include "physics/rank_model.h"

MS_TABLES(ms_matrix_kernels);

msim_status ms_coefficients_create(const ms_model *model, ms_coefficients *a, msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const size_t n = MS_SLICE * (size_t)model->half_edges.nentries;
  const int is_scalar = !(model->features & MS_HAS_DIRECTIONS);
  const size_t block = is_scalar ? 1 : (size_t)model->unknowns.dims;
  const size_t diagonal =
      ms_coefficients_diagonal_size(block) * (size_t)model->unknowns.first_pinned;
  const size_t angles = MS_ANGLE_ELEMENT * (size_t)model->angles.nslots;
  *a = (ms_coefficients){.block = (int32_t)block};
  const int fits =
      MS_NEW(alloc, a->t, n) && MS_NEW(alloc, a->diagonal, diagonal) &&
      (!(model->function && model->function->dfdx) || MS_NEW(alloc, a->own, diagonal)) &&
      (is_scalar || (MS_NEW(alloc, a->g, n) && MS_NEW(alloc, a->angles, angles) &&
                     MS_NEW_VECTORS(model->scene, &model->unknowns, &a->x)));
  return fits ? MSIM_OK : ms_error_set_memory(err, "the matrix coefficients");
}

void ms_coefficients_destroy(const ms_model *model, ms_coefficients *a) {
  MS_FREE(&model->scene->alloc, a->t, a->g, a->x, a->angles, a->diagonal, a->own);
  *a = (ms_coefficients){0};
}

/* t = h^2 k; diagonal: m + h b + sum of t */
static void compute_scalar(const ms_model *model, double h, ms_coefficients *a) {
  const ms_half_edges *half_edges = &model->half_edges;
  for (int32_t at = 0; at < MS_SLICE * half_edges->nentries; at++)
    a->t[at] = h * h * half_edges->k[ms_half_edges_value(half_edges, at)];
  for (int32_t r = 0; r < model->unknowns.first_pinned; r++) {
    const ms_half_edge_span span = ms_half_edges_of_row(half_edges, r);
    a->diagonal[r] = model->mass[r] + a->drag;
    for (int32_t at = span.begin; at < span.end; at += span.step) a->diagonal[r] += a->t[at];
  }
}

static void add_own_blocks(const ms_model *model, double h, int clamp, ms_coefficients *a) {
  const size_t n = ms_coefficients_diagonal_size(3) * (size_t)model->unknowns.first_pinned;
  ms_particle_blocks_compute(model, h, clamp, a->own);
  for (size_t i = 0; i < n; i++) a->diagonal[i] += a->own[i];
}

/* Slice ranges in a chunk of work: some 10 us. */
enum { CHUNK = 64 };

static void compute_coefficients_chunk(void *data, int32_t begin, int32_t end) {
  const ms_coefficients_job *j = data;
  ms_matrix_kernels_of[j->model->isa]->coefficients(j, begin, end);
}

static void apply_coefficients_chunk(void *data, int32_t begin, int32_t end) {
  const ms_product_job *j = data;
  const ms_matrix_kernels *kernels = ms_matrix_kernels_of[j->model->isa];
  if (j->a->block == 1) kernels->apply_scalar(j, begin, end);
  else kernels->apply(j, begin, end);
}

void ms_coefficients_compute(const ms_model *model, const double *x, double h, int clamp,
                             ms_coefficients *a) {
  const ms_half_edges *half_edges = &model->half_edges;
  a->drag = ms_external_matrix(&model->external, h);
  if (a->block == 1) {
    compute_scalar(model, h, a);
    return;
  }
  ms_rank_model_refresh(model, x, NULL);
  ms_vector_copy_all(model->shape, x, a->x);
  ms_coefficients_job j = {.model = model, .a = a, .x = x, .h = h, .clamp = clamp};
  ms_pool_run_chunks(model->pool, compute_coefficients_chunk, &j,
                     ms_half_edges_count_ranges(half_edges), CHUNK);
  ms_half_edges_add_part_sums(half_edges, (int32_t)ms_coefficients_diagonal_size((size_t)a->block),
                              (size_t)model->unknowns.first_pinned, a->diagonal);
  if (model->laws) ms_law_springs_add_matrix(model, h, clamp, a);
  ms_angle_springs_add_matrix(model, h, clamp, a);
  if (a->own) add_own_blocks(model, h, clamp, a);
}

/* Of n n^T of direction k, beyond friction in all directions */
static double find_weight(const ms_constraint *g, int32_t k, double share) {
  return (k < g->n ? share * g->weight : 0) - g->friction;
}

void ms_coefficients_add_constraints(const ms_model *model, ms_constraint *constraint, int32_t n,
                                     ms_coefficients *a) {
  const size_t sd = (size_t)model->unknowns.first_pinned, dims = (size_t)a->block;
  a->constraint = constraint, a->nconstraints = n;
  for (int32_t i = 0; i < n; i++) {
    ms_constraint *g = &constraint[i];
    double *own = a->diagonal + g->row, largest = model->mass[g->row];
    for (size_t c = 0; c < dims; c++) largest = fmax(largest, own[c * sd]);
    g->weight = MS_CONSTRAINT_WEIGHT * largest;
    for (size_t b = 0; b < dims; b++) own[b * sd] += g->friction;
    for (int32_t k = 0; k < 3 && k <= g->n; k++)
      for (size_t b = 0; b < dims; b++)
        for (size_t c = b; c < dims; c++)
          own[ms_coefficients_diagonal_element(dims, b, c) * sd] +=
              find_weight(g, k, 1) * g->direction[k][model->unknowns.axis[b]] *
              g->direction[k][model->unknowns.axis[c]];
  }
}

/* y += by (share weight n n^T + drag (I - n n^T - s s^T)) x for each constraint, n n^T summed over
 * its directions. Returns x.(y - y before). */
double ms_coefficients_apply_constraints(const ms_model *model, const ms_coefficients *a,
                                         double share, double by, ms_operands o) {
  const ms_unknowns *rows = &model->unknowns;
  double sum = 0;
  for (int32_t i = 0; i < a->nconstraints; i++) {
    const ms_constraint *g = &a->constraint[i];
    const size_t stride = (size_t)rows->stride, row = (size_t)g->row;
    double own[3] = {0}, add[3];
    for (size_t c = 0; c < (size_t)rows->dims; c++)
      own[rows->axis[c]] = ms_operands_get(&o, c * stride + row);
    for (int c = 0; c < 3; c++) add[c] = by * g->friction * own[c];
    for (int32_t k = 0; k < 3 && k <= g->n; k++)
      ms_vec3_axpy(by * find_weight(g, k, share) * ms_vec3_dot(g->direction[k], own),
                   g->direction[k], add);
    sum += ms_vec3_dot(add, own);
    for (size_t c = 0; c < (size_t)rows->dims; c++)
      ms_operands_add(&o, c * stride + row, add[rows->axis[c]]);
  }
  return sum;
}

static void apply_coefficients(const ms_model *model, const ms_coefficients *a, double share,
                               int32_t components, const double *x, double *y) {
  const size_t stride = (size_t)model->unknowns.stride, end = (size_t)model->unknowns.first_pinned;
  ms_rank_model_refresh_components(model, components, x);
  ms_product_job j = {
      .model = model, .a = a, .x = x, .y = y, .share = share, .components = components};
  ms_pool_run_chunks(model->pool, apply_coefficients_chunk, &j,
                     ms_half_edges_count_ranges(&model->half_edges), CHUNK);
  ms_half_edges_add_part_sums(&model->half_edges, components, stride, y);
  const ms_operands o = {x, y, 0};
  ms_angle_springs_apply(model, a, 1, o);
  ms_coefficients_apply_constraints(model, a, share, 1, o);
  if (a->own && share > 0) ms_particle_blocks_apply(model, a->own, 0, 1, o);
  for (size_t c = 0; c < (size_t)components; c++)
    memset(y + c * stride + end, 0, (stride - end) * sizeof *y);
}

void ms_coefficients_apply(const ms_model *model, const ms_coefficients *a, const double *x,
                           double *y) {
  apply_coefficients(model, a, 1, model->unknowns.dims, x, y);
}

void ms_coefficients_apply_massless(const ms_model *model, const ms_coefficients *a,
                                    const double *x, double *y) {
  apply_coefficients(model, a, 0, model->unknowns.dims, x, y);
}

void ms_coefficients_apply_component(const ms_model *model, const ms_coefficients *a,
                                     const double *x, double *y) {
  apply_coefficients(model, a, 1, 1, x, y);
}

/* y_i = |A_ii| |x_i| + sum over half-edges of (|t| I + g |d| |d|^T) |x_j| */
static void apply_abs_row(const ms_model *model, const ms_coefficients *a, const double *x,
                          size_t row, double *y) {
  const size_t stride = (size_t)model->unknowns.stride, sd = (size_t)model->unknowns.first_pinned;
  const size_t dims = (size_t)model->unknowns.dims;
  const int is_scalar = a->block == 1;
  for (size_t c = 0; c < dims; c++) {
    y[c * stride + row] = is_scalar ? fabs(a->diagonal[row] * x[c * stride + row]) : 0;
    for (size_t b = 0; b < dims && !is_scalar; b++)
      y[c * stride + row] +=
          fabs(a->diagonal[ms_coefficients_diagonal_element(dims, c, b) * sd + row] *
               x[b * stride + row]);
  }
  const ms_half_edge_span span = ms_half_edges_of_row(&model->half_edges, (int32_t)row);
  for (int32_t at = span.begin; at < span.end; at += span.step) {
    const size_t j = (size_t)ms_half_edges_neighbour(&model->half_edges, at);
    double d[3] = {0}, along = 0;
    for (size_t c = 0; c < dims && !is_scalar; c++) {
      d[c] = fabs(a->x[c * stride + j] - a->x[c * stride + row]);
      along += d[c] * fabs(x[c * stride + j]);
    }
    for (size_t c = 0; c < dims; c++)
      y[c * stride + row] +=
          fabs(a->t[at] * x[c * stride + j]) + (is_scalar ? 0 : a->g[at] * along * d[c]);
  }
}

void ms_coefficients_apply_abs(const ms_model *model, const ms_coefficients *a, const double *x,
                               double *y) {
  ms_rank_model_refresh(model, x, NULL);
  for (size_t row = 0; row < (size_t)model->unknowns.nfree; row++)
    apply_abs_row(model, a, x, row, y);
  ms_angle_springs_apply_abs(model, a, x, y);
}
