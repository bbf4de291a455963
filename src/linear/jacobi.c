#include "linear/jacobi.h"

#include <float.h>
#include <math.h>

#include "base/simd.h"
#include "physics/angle_springs.h"
#include "physics/constraint_weight.h"
#include "physics/rank_model.h"

msim_status ms_jacobi_create(const ms_model *model, const ms_coefficients *a, ms_jacobi *jacobi,
                             msim_error *err) {
  const size_t n =
      ms_coefficients_diagonal_size((size_t)a->block) * (size_t)model->unknowns.first_pinned;
  *jacobi = (ms_jacobi){.block = a->block, .scale = 1};
  if (MS_NEW(&model->scene->alloc, jacobi->inverse, n)) return MSIM_OK;
  return ms_error_set_memory(err, "the preconditioner");
}

void ms_jacobi_destroy(const ms_model *model, ms_jacobi *jacobi) {
  ms_memory_free(&model->scene->alloc, jacobi->inverse);
  *jacobi = (ms_jacobi){0};
}

static double near_power_of_4(double largest) {
  int exponent;
  frexp(largest, &exponent);
  return ldexp(1, 2 * (exponent / 2));
}

static double find_largest_on_diagonal(const ms_model *model, const ms_coefficients *a,
                                       int32_t row) {
  const size_t s = (size_t)model->unknowns.first_pinned;
  double largest = DBL_MIN;
  for (size_t c = 0; c < (size_t)a->block; c++)
    largest = fmax(largest, a->diagonal[c * s + (size_t)row]);
  return largest;
}

static double find_largest_beside_diagonal(const ms_model *model, const ms_coefficients *a,
                                           int32_t row) {
  const size_t s = (size_t)model->unknowns.first_pinned, block = (size_t)a->block;
  double largest = DBL_MIN;
  for (size_t q = block; q < ms_coefficients_diagonal_size(block); q++)
    largest = fmax(largest, fabs(a->diagonal[q * s + (size_t)row]));
  return largest;
}

/* What the diagonal of a constrained row had before follows from the weight. Such rows are marked
 * in the first numbers of `inverse`, which is computed later. */
static void choose_scales(const ms_model *model, const ms_coefficients *a, ms_jacobi *jacobi) {
  double largest[2] = {DBL_MIN, DBL_MIN}, *is_constrained = jacobi->inverse;
  for (int32_t r = 0; r < model->unknowns.nfree; r++) is_constrained[r] = 0;
  for (int32_t i = 0; i < a->nconstraints; i++) {
    is_constrained[a->constraint[i].row] = 1;
    largest[1] = fmax(largest[1], a->constraint[i].weight / MS_CONSTRAINT_WEIGHT);
  }
  for (int32_t r = 0; r < model->unknowns.nfree; r++) {
    const double on_diagonal = find_largest_on_diagonal(model, a, r);
    largest[0] = fmax(largest[0], on_diagonal);
    largest[1] =
        fmax(largest[1],
             is_constrained[r] == 0 ? on_diagonal : find_largest_beside_diagonal(model, a, r));
  }
  ms_ranks_maximum(model->shape.ranks, 2, largest);
  jacobi->scale = near_power_of_4(largest[0]);
  jacobi->coupling_scale = near_power_of_4(largest[1]);
}

/* A shift that makes an unknown's diagonal block positive definite: the sum of max(0, -t) over its
 * springs. Each adds t I + g d d^T (force.h), g >= 0, but t = h^2 k s < 0 if it is compressed. And
 * what its angular springs need. */
static double compression_shift(const ms_model *model, const ms_coefficients *a, int32_t row) {
  const ms_half_edge_span span = ms_half_edges_of_row(&model->half_edges, row);
  double sum = 0;
  for (int32_t at = span.begin; at < span.end; at += span.step) sum -= a->t[at] < 0 ? a->t[at] : 0;
  return sum + ms_angle_springs_shift(model, a, row);
}

/* By cofactors. Returns 0 unless positive definite, by Sylvester: all leading minors > 0. */
static int invert3(const double *b, double *out) {
  const double xx = b[0], yy = b[1], zz = b[2], xy = b[3], xz = b[4], yz = b[5];
  const double cxx = yy * zz - yz * yz, cxy = xz * yz - xy * zz, cxz = xy * yz - xz * yy;
  const double det = xx * cxx + xy * cxy + xz * cxz;
  if (!(xx > 0 && xx * yy - xy * xy > 0 && det > 0)) return 0;
  const double by = 1 / det;
  out[0] = by * cxx, out[1] = by * (xx * zz - xz * xz), out[2] = by * (xx * yy - xy * xy);
  out[3] = by * cxy, out[4] = by * cxz, out[5] = by * (xy * xz - xx * yz);
  return 1;
}

static int invert2(const double *b, double *out) {
  const double xx = b[0], yy = b[1], xy = b[2], det = xx * yy - xy * xy;
  if (!(xx > 0 && det > 0)) return 0;
  out[0] = yy / det, out[1] = xx / det, out[2] = -xy / det;
  return 1;
}

static int invert1(const double *b, double *out) {
  *out = 1 / *b;
  return *b > 0;
}

msim_status ms_jacobi_invert(const ms_model *model, const ms_coefficients *a, int32_t kind,
                             ms_jacobi *jacobi) {
  static int (*const invert[])(const double *, double *) = {NULL, invert1, invert2, invert3};
  const size_t s = (size_t)model->unknowns.first_pinned, block = (size_t)a->block;
  const size_t size = ms_coefficients_diagonal_size(block);
  choose_scales(model, a, jacobi);
  const double by = 1 / jacobi->scale;
  const int braced = kind != MSIM_FACTOR_SPD;
  for (int32_t r = 0; r < model->unknowns.nfree; r++) {
    const double more = braced ? compression_shift(model, a, r) : 0;
    double in[6], out[6];
    for (size_t q = 0; q < size; q++)
      in[q] = by * (a->diagonal[q * s + (size_t)r] + (q < block ? more : 0));
    if (!invert[block](in, out)) return MSIM_NOT_SPD;
    for (size_t q = 0; q < size; q++) jacobi->inverse[q * s + (size_t)r] = out[q];
  }
  return MSIM_OK;
}

void ms_jacobi_apply(const ms_model *model, const ms_jacobi *jacobi, int32_t components,
                     const double *r, double *z) {
  const size_t s = (size_t)model->unknowns.first_pinned, t = (size_t)model->unknowns.stride;
  const size_t dims = (size_t)components, is_scalar = jacobi->block == 1;
  const double by = 1 / jacobi->scale;
  for (size_t i = 0; i < (size_t)model->unknowns.nfree; i++) {
    double in[3];
    for (size_t c = 0; c < dims; c++) in[c] = by * r[c * t + i];
    for (size_t b = 0; b < dims; b++) {
      double sum = is_scalar ? jacobi->inverse[i] * in[b] : 0;
      for (size_t c = 0; c < dims && !is_scalar; c++)
        sum += jacobi->inverse[ms_coefficients_diagonal_element(dims, b, c) * s + i] * in[c];
      z[b * t + i] = sum;
    }
  }
}

double ms_jacobi_relative_distance(const float *p, const float *q, size_t n) {
  double apart[MS_SLICE] = {0}, size[MS_SLICE] = {0};
  for (size_t i = 0; i < n; i += MS_SLICE)
    for (size_t l = 0; l < MS_SLICE; l++) {
      const double d = (double)p[i + l] - (double)q[i + l];
      apart[l] += d * d, size[l] += (double)p[i + l] * (double)p[i + l];
    }
  for (size_t l = 1; l < MS_SLICE; l++) apart[0] += apart[l], size[0] += size[l];
  return sqrt(apart[0] / size[0]);
}

/*------------------------------------- the norm -------------------------------------------------*/

/* B = L L^T, l by rows. Returns 0 at a pivot within the rounding errors of its diagonal entry; with
 * floor = 1 it is raised to that level instead. */
static int factor_block(size_t dims, const double *b, int floor, double l[6]) {
  for (size_t i = 0, row = 0; i < dims; row += ++i) {
    const double least = DBL_EPSILON * b[i];
    double pivot = b[i];
    for (size_t k = 0, other = 0; k < i; other += ++k) {
      double entry = b[ms_coefficients_diagonal_element(dims, k, i)];
      for (size_t q = 0; q < k; q++) entry -= l[row + q] * l[other + q];
      l[row + k] = entry / l[other + k];
      pivot -= l[row + k] * l[row + k];
    }
    if (!(pivot > least) && !floor) return 0;
    l[row + i] = sqrt(fmax(pivot, least));
  }
  return 1;
}

/* y = L^-1 r */
static void solve_lower_block(size_t dims, const double l[6], const double r[3], double y[3]) {
  for (size_t i = 0, row = 0; i < dims; row += ++i) {
    y[i] = r[i];
    for (size_t k = 0; k < i; k++) y[i] -= l[row + k] * y[k];
    y[i] /= l[row + i];
  }
}

/* A block without a root, because of compressed springs, is shifted as in the preconditioner. */
static void factor_block_of_unknown(const ms_model *model, const ms_coefficients *a, int32_t row,
                                    double l[6]) {
  const size_t s = (size_t)model->unknowns.first_pinned, dims = (size_t)a->block;
  double block[6];
  for (size_t q = 0; q < ms_coefficients_diagonal_size(dims); q++)
    block[q] = a->diagonal[q * s + (size_t)row];
  if (factor_block(dims, block, 0, l)) return;
  const double more = compression_shift(model, a, row);
  for (size_t c = 0; c < dims; c++) block[c] += more;
  factor_block(dims, block, 1, l);
}

static double squared_norm_of_unknown(const ms_model *model, const ms_coefficients *a,
                                      const double *r, int32_t row) {
  double l[6], own[3], y[3], sum = 0;
  factor_block_of_unknown(model, a, row, l);
  for (int32_t first = 0; first < model->unknowns.dims; first += a->block) {
    for (int32_t c = 0; c < a->block; c++)
      own[c] = r[(size_t)(first + c) * (size_t)model->unknowns.stride + (size_t)row];
    solve_lower_block((size_t)a->block, l, own, y);
    for (int32_t c = 0; c < a->block; c++) sum += y[c] * y[c];
  }
  return sum;
}

/* r.B^-1 r for one unknown per lane, by B = L D L^T. has_root: lanes where factor_block succeeds */
MS_INLINE ms_lanes squares_of_rows(size_t dims, const ms_lanes b[6], const ms_lanes r[3],
                                   ms_mask *has_root) {
  ms_lanes l[3][3], y[3], inverse[3], sum = {0};
  *has_root = ~(ms_mask){0};
  for (size_t i = 0; i < dims; i++) {
    ms_lanes pivot = b[i], scaled[3];
    y[i] = r[i];
    for (size_t k = 0; k < i; k++) {
      scaled[k] = b[ms_coefficients_diagonal_element(dims, k, i)];
      for (size_t q = 0; q < k; q++) scaled[k] -= scaled[q] * l[k][q];
      l[i][k] = scaled[k] * inverse[k];
      pivot -= scaled[k] * l[i][k];
      y[i] -= l[i][k] * y[k];
    }
    *has_root &= pivot > DBL_EPSILON * b[i];
    inverse[i] = 1 / pivot;
    sum += y[i] * y[i] * inverse[i];
  }
  return sum;
}

/* The same for scalar blocks */
MS_INLINE ms_lanes squares_of_scalars(size_t dims, ms_lanes b, const ms_lanes r[3],
                                      ms_mask *has_root) {
  ms_lanes sum = r[0] * r[0];
  for (size_t c = 1; c < dims; c++) sum += r[c] * r[c];
  *has_root = b > 0;
  return sum / b;
}

/* Add r.D^-1 r of all whole slices of 8 unknowns to 8 running sums. */
MS_INLINE void add_squared_norms(size_t block, size_t dims, const ms_model *model,
                                 const ms_coefficients *a, const double *r, double sums[MS_SLICE]) {
  const size_t s = (size_t)model->unknowns.first_pinned, t = (size_t)model->unknowns.stride;
  const size_t end = (size_t)model->unknowns.nfree / MS_SLICE * MS_SLICE;
  for (size_t row = 0; row < end; row += MS_LANES) {
    double *to = sums + row % MS_SLICE;
    ms_lanes b[6], own[3];
    ms_mask has_root;
    for (size_t q = 0; q < ms_coefficients_diagonal_size(block); q++)
      b[q] = ms_simd_load(a->diagonal + q * s + row);
    for (size_t c = 0; c < dims; c++) own[c] = ms_simd_load(r + c * t + row);
    const ms_lanes squares = block == 1 ? squares_of_scalars(dims, b[0], own, &has_root)
                                        : squares_of_rows(dims, b, own, &has_root);
    ms_simd_store(to, ms_simd_load(to) + ms_simd_select(has_root, squares, (ms_lanes){0}));
    for (size_t i = 0; i < MS_LANES; i++)
      if (!has_root[i]) to[i] += squared_norm_of_unknown(model, a, r, (int32_t)(row + i));
  }
}

double ms_jacobi_norm(const ms_model *model, const ms_coefficients *a, const double *r) {
  const int32_t nfree = model->unknowns.nfree;
  double l[MS_SLICE] = {0};
  if (a->block == 3) add_squared_norms(3, 3, model, a, r, l);
  else if (a->block == 2) add_squared_norms(2, 2, model, a, r, l);
  else if (model->unknowns.dims == 3) add_squared_norms(1, 3, model, a, r, l);
  else add_squared_norms(1, 2, model, a, r, l);
  for (int32_t row = nfree - nfree % MS_SLICE; row < nfree; row++)
    l[row % MS_SLICE] += squared_norm_of_unknown(model, a, r, row);
  double sum = ms_vector_sum_lanes(l);
  ms_ranks_sum(model->shape.ranks, 1, &sum);
  return sqrt(sum);
}

void ms_jacobi_factor_blocks(const ms_model *model, const ms_coefficients *a, double *roots) {
  for (int32_t row = 0; row < model->unknowns.nfree; row++)
    factor_block_of_unknown(model, a, row, roots + 6 * (size_t)row);
}

void ms_jacobi_solve_lower(const ms_model *model, const double *roots, double *r) {
  const size_t t = (size_t)model->unknowns.stride, dims = (size_t)model->unknowns.dims;
  for (size_t row = 0; row < (size_t)model->unknowns.nfree; row++) {
    double own[3], y[3];
    for (size_t c = 0; c < dims; c++) own[c] = r[c * t + row];
    solve_lower_block(dims, roots + 6 * row, own, y);
    for (size_t c = 0; c < dims; c++) r[c * t + row] = y[c];
  }
}

void ms_jacobi_multiply_lower(const ms_model *model, const double *roots, double *y) {
  const size_t t = (size_t)model->unknowns.stride, dims = (size_t)model->unknowns.dims;
  for (size_t row = 0; row < (size_t)model->unknowns.nfree; row++) {
    const double *l = roots + 6 * row;
    for (size_t i = dims; i-- > 0;) {
      double sum = 0;
      for (size_t k = 0; k <= i; k++) sum += l[i * (i + 1) / 2 + k] * y[k * t + row];
      y[i * t + row] = sum;
    }
  }
}
