/* The matrix' coefficients and products with it. Compiled once for each instruction set, with
 * MS_ISA its name; every loop is built for 2 and for 3 components. */
#include "physics/kernels.h"

#include <math.h>

#include "physics/lanes.h"

/*------------------------------------- coefficients ---------------------------------------------*/

/* Where l2 = |d|^2 says that a spring has a direction. NaN goes on, to be seen. */
MS_INLINE ms_mask has_direction(ms_lanes l2) { return (l2 > MS_ZERO_LENGTH2) | (l2 != l2); }

/* t and w of force.h, at the differences d = x_j - x_i */
MS_INLINE void half_coefficients(int dims, int damped, ms_vec d, const ms_halves *halves, double h,
                                 double largest_ratio, ms_coefficients *a, size_t at) {
  const ms_lanes zero = {0}, one = zero + 1, largest = zero + largest_ratio;
  const ms_lanes l2 = ms_dot_vec(dims, d, d);
  const ms_mask there = has_direction(l2);
  ms_lanes inverse;
  ms_root(ms_select(there, l2, one), &inverse);
  const ms_lanes hhk = h * h * ms_load(halves->k + at);
  const ms_lanes full = ms_load(halves->rest + at) * inverse;
  const ms_lanes ratio = ms_select(there, ms_select(full > largest, largest, full), zero);
  ms_lanes w2 = hhk * ratio;
  if (damped) w2 += h * ms_load(halves->damping + at);
  const ms_lanes w = ms_select(there, ms_sqrt(w2) * inverse, zero);
  ms_store(a->t + at, hhk * (1 - ratio));
  for (int c = 0; c < dims; c++) ms_store(a->w[c] + at, w * d.c[c]);
}

/* m + h b, and every half spring's block is added to its row's */
MS_INLINE void diagonal_blocks(int dims, const ms_model *m, int32_t segment, ms_place p,
                               ms_coefficients *a) {
  const size_t begin = MS_GROUP * (size_t)m->halves.first[segment];
  const size_t end = MS_GROUP * (size_t)m->halves.first[segment + 1];
  for (size_t lane = 0; lane < MS_GROUP; lane += MS_LANES) {
    ms_lanes sum[6] = {{0}};
    for (int c = 0; c < dims && !p.is_part; c++) sum[c] = ms_load(m->mass + p.row + lane) + a->drag;
    for (size_t at = begin + lane; at < end; at += MS_GROUP) {
      const ms_lanes t = ms_load(a->t + at);
      ms_lanes w[3];
      for (int c = 0; c < dims; c++) w[c] = ms_load(a->w[c] + at);
      for (int c = 0; c < dims; c++) sum[c] += ms_fma(w[c], w[c], t);
      for (int b = 0; b < dims; b++)
        for (int c = b + 1; c < dims; c++) {
          const size_t e = ms_diagonal_entry((size_t)dims, (size_t)b, (size_t)c);
          sum[e] = ms_fma(w[b], w[c], sum[e]);
        }
    }
    for (size_t e = 0; e < ms_diagonal_size((size_t)dims); e++)
      ms_store(p.sums + lane + e * p.stride, sum[e]);
  }
}

MS_INLINE void coefficients_of(int dims, int damped, const ms_model *model, const double *x,
                               double h, int clamp, ms_coefficients *a, int32_t begin,
                               int32_t end) {
  const size_t stride = (size_t)model->rows.stride, sd = (size_t)model->rows.first_pinned;
  const ms_halves *halves = &model->halves;
  const double largest_ratio = clamp ? 1 : INFINITY;
  for (int32_t s = begin; s < end; s++) {
    const ms_place p = ms_place_of(halves, s, a->diagonal, sd);
    for (size_t lane = 0; lane < MS_GROUP; lane += MS_LANES) {
      const ms_vec xi = ms_load_own(dims, p, lane, x, stride);
      for (int32_t slot = halves->first[s]; slot < halves->first[s + 1]; slot++) {
        const ms_vec xj = ms_load_neighbours(dims, halves, slot, lane, x, stride);
        half_coefficients(dims, damped, ms_minus(dims, xj, xi), halves, h, largest_ratio, a,
                          MS_GROUP * (size_t)slot + lane);
      }
    }
    diagonal_blocks(dims, model, s, p, a);
  }
}

static void coefficients(const ms_model *model, const double *x, double h, int clamp,
                         ms_coefficients *a, int32_t begin, int32_t end) {
  const int damped = (model->passes & MSIM_SKIP_DAMPING) != 0;
  if (model->rows.dims == 3) {
    if (damped) coefficients_of(3, 1, model, x, h, clamp, a, begin, end);
    else coefficients_of(3, 0, model, x, h, clamp, a, begin, end);
  } else {
    if (damped) coefficients_of(2, 1, model, x, h, clamp, a, begin, end);
    else coefficients_of(2, 0, model, x, h, clamp, a, begin, end);
  }
}

/*------------------------------------- products -------------------------------------------------*/

MS_INLINE ms_vec apply_diagonal(int dims, const double *d, size_t s, const double *x,
                                size_t stride) {
  const ms_vec v = ms_load_vec(dims, x, stride);
  ms_vec product = {{{0}}};
  for (int b = 0; b < dims; b++)
    for (int c = 0; c < dims; c++) {
      const size_t e = ms_diagonal_entry((size_t)dims, (size_t)b, (size_t)c);
      product.c[b] = ms_fma(ms_load(d + e * s), v.c[c], product.c[b]);
    }
  return product;
}

/* y_i = D_i x_i - sum over half springs of (t x_j + (w.x_j) w) */
MS_INLINE void apply_of(int dims, const ms_model *model, const ms_coefficients *a, const double *x,
                        double *y, int32_t begin, int32_t end) {
  const size_t stride = (size_t)model->rows.stride, sd = (size_t)model->rows.first_pinned;
  const ms_halves *halves = &model->halves;
  for (int32_t s = begin; s < end; s++) {
    const ms_place p = ms_place_of(halves, s, y, stride);
    for (size_t lane = 0; lane < MS_GROUP; lane += MS_LANES) {
      const size_t row = p.row + lane;
      ms_vec sum = {{{0}}};
      if (!p.is_part) sum = apply_diagonal(dims, a->diagonal + row, sd, x + row, stride);
      for (int32_t slot = halves->first[s]; slot < halves->first[s + 1]; slot++) {
        const size_t at = MS_GROUP * (size_t)slot + lane;
        const ms_vec v = ms_load_neighbours(dims, halves, slot, lane, x, stride);
        ms_vec w = {{{0}}};
        for (int c = 0; c < dims; c++) w.c[c] = ms_load(a->w[c] + at);
        sum = ms_fma_vec(dims, -ms_load(a->t + at), v, sum);
        sum = ms_fma_vec(dims, -ms_dot_vec(dims, w, v), w, sum);
      }
      ms_store_vec(dims, p.sums + lane, p.stride, sum);
    }
  }
}

static void apply(const ms_model *model, const ms_coefficients *a, const double *x, double *y,
                  int32_t begin, int32_t end) {
  if (model->rows.dims == 3) apply_of(3, model, a, x, y, begin, end);
  else apply_of(2, model, a, x, y, begin, end);
}

/* y_i = D_i x_i - sum of t x_j, for each component */
MS_INLINE void apply_alike_of(int dims, const ms_model *model, const ms_coefficients *a,
                              const double *x, double *y, int32_t begin, int32_t end) {
  const size_t stride = (size_t)model->rows.stride;
  const ms_halves *halves = &model->halves;
  for (int32_t s = begin; s < end; s++) {
    const ms_place p = ms_place_of(halves, s, y, stride);
    for (size_t lane = 0; lane < MS_GROUP; lane += MS_LANES) {
      ms_vec sum = {{{0}}};
      if (!p.is_part) {
        sum = ms_load_vec(dims, x + p.row + lane, stride);
        for (int c = 0; c < dims; c++) sum.c[c] *= ms_load(a->diagonal + p.row + lane);
      }
      for (int32_t slot = halves->first[s]; slot < halves->first[s + 1]; slot++) {
        const ms_lanes t = ms_load(a->t + MS_GROUP * (size_t)slot + lane);
        const ms_vec v = ms_load_neighbours(dims, halves, slot, lane, x, stride);
        sum = ms_fma_vec(dims, -t, v, sum);
      }
      ms_store_vec(dims, p.sums + lane, p.stride, sum);
    }
  }
}

static void apply_alike(const ms_model *model, const ms_coefficients *a, int32_t components,
                        const double *x, double *y, int32_t begin, int32_t end) {
  if (components == 3) apply_alike_of(3, model, a, x, y, begin, end);
  else if (components == 2) apply_alike_of(2, model, a, x, y, begin, end);
  else apply_alike_of(1, model, a, x, y, begin, end);
}

const ms_kernels MS_TABLE(ms_kernels) = {coefficients, apply, apply_alike};
