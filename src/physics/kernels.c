/* Compiled once for each instruction set, with MS_ISA its name. */
#include <math.h>
#include <string.h>

#include "base/simd.h"
#include "physics/kernels.h"

/* Every loop is written for any number of components and built for 2 and for 3: `dims` is a
 * constant where inlined. */
#define EACH(c) for (size_t c = 0; c < dims; c++)

typedef struct vec {
  ms_lanes c[3]; /* dims of them are used */
} vec;

MS_INLINE vec load(const double *from, size_t stride, size_t dims) {
  vec v;
  EACH(c) v.c[c] = ms_load(from + c * stride);
  return v;
}

MS_INLINE void store(double *to, size_t stride, vec v, size_t dims) {
  EACH(c) ms_store(to + c * stride, v.c[c]);
}

/* The neighbours' part of x: consecutive rows, or gathered. */
MS_INLINE vec load_neighbours(const ms_halves *halves, int32_t slot, size_t lane, const double *x,
                              size_t stride, size_t dims) {
  const int32_t start = halves->start[slot];
  if (start >= 0) return load(x + (size_t)start + lane, stride, dims);
  const int32_t *j = halves->neighbour + MS_GROUP * (size_t)slot + lane;
  vec v;
  EACH(c) {
    ms_lanes part = {0};
    for (int l = 0; l < MS_LANES; l++) part[l] = x[c * stride + (size_t)j[l]];
    v.c[c] = part;
  }
  return v;
}

/* Where a segment's sums go, and whose they are: a group's own rows, or one long row. */
typedef struct place {
  size_t row;    /* of the segment's first lane */
  int is_part;   /* all lanes are of that row */
  double *sums;  /* where lane 0's first sum goes */
  size_t stride; /* to the next of its sums */
} place;

static inline place place_of(const ms_halves *halves, int32_t segment, double *to, size_t stride) {
  const int32_t part = segment - halves->ngroups;
  const size_t row = MS_GROUP * (size_t)segment;
  if (part < 0) return (place){row, 0, to + row, stride};
  return (place){(size_t)halves->part_row[part], 1, halves->part_sums + MS_GROUP * (size_t)part,
                 MS_GROUP * (size_t)halves->nparts};
}

/* x of the segment's own rows */
MS_INLINE vec load_own(place p, size_t lane, const double *x, size_t stride, size_t dims) {
  if (!p.is_part) return load(x + p.row + lane, stride, dims);
  const ms_lanes zero = {0};
  vec v;
  EACH(c) v.c[c] = zero + x[c * stride + p.row];
  return v;
}

/*------------------------------------- forces ---------------------------------------------------*/

MS_INLINE vec minus(vec a, vec b, size_t dims) {
  EACH(c) a.c[c] -= b.c[c];
  return a;
}

MS_INLINE ms_lanes dot(vec a, vec b, size_t dims) {
  ms_lanes sum = a.c[0] * b.c[0] + a.c[1] * b.c[1];
  return dims == 3 ? sum + a.c[2] * b.c[2] : sum;
}

/* Where l2 = |d|^2 says that a spring has a direction. NaN goes on, to be seen. */
static inline ms_mask has_direction(ms_lanes l2) { return (l2 > MS_ZERO_LENGTH2) | (l2 != l2); }

/* (k (l - L)/l + c (d.dv)/l^2) d, to be added to the force; 0 where l = 0. One branch a phase:
 * `damped` is a constant where inlined. */
MS_INLINE ms_lanes pull(vec d, vec dv, const ms_halves *halves, size_t at, int damped,
                        size_t dims) {
  const ms_lanes zero = {0}, one = zero + 1;
  const ms_lanes l2 = dot(d, d, dims);
  const ms_mask there = has_direction(l2);
  const ms_lanes l = ms_sqrt(ms_select(there, l2, one));
  ms_lanes scale = ms_load(halves->k + at) * ((l - ms_load(halves->rest + at)) / l);
  if (damped) {
    vec u = d;
    EACH(c) u.c[c] /= l;
    scale += ms_load(halves->damping + at) * dot(u, dv, dims) / l;
  }
  return ms_select(there, scale, zero);
}

MS_INLINE void add_springs(const ms_model *m, const double *x, const double *v, double *f,
                           int damped, size_t dims) {
  const size_t stride = (size_t)m->rows.stride;
  const ms_halves *halves = &m->halves;
  for (int32_t s = 0; s < halves->ngroups + halves->nparts; s++) {
    const place p = place_of(halves, s, f, stride);
    for (size_t lane = 0; lane < MS_GROUP; lane += MS_LANES) {
      const vec xi = load_own(p, lane, x, stride, dims);
      const vec vi = damped ? load_own(p, lane, v, stride, dims) : xi;
      vec sum = {{{0}}};
      if (!p.is_part) sum = load(p.sums + lane, p.stride, dims);
      for (int32_t slot = halves->first[s]; slot < halves->first[s + 1]; slot++) {
        const vec d = minus(load_neighbours(halves, slot, lane, x, stride, dims), xi, dims);
        const vec dv =
            damped ? minus(load_neighbours(halves, slot, lane, v, stride, dims), vi, dims) : d;
        const ms_lanes scale = pull(d, dv, halves, MS_GROUP * (size_t)slot + lane, damped, dims);
        EACH(c) sum.c[c] += scale * d.c[c];
      }
      store(p.sums + lane, p.stride, sum, dims);
    }
  }
  ms_halves_add_parts(halves, (int32_t)dims, stride, f);
}

static void springs(const ms_model *m, const double *x, const double *v, double *f) {
  if (m->rows.dims == 3) v ? add_springs(m, x, v, f, 1, 3) : add_springs(m, x, v, f, 0, 3);
  else v ? add_springs(m, x, v, f, 1, 2) : add_springs(m, x, v, f, 0, 2);
}

/* k (x_j - x_i): the pull of a spring without rest length */
MS_INLINE void add_linear_springs(const ms_model *m, const double *x, double *f, size_t dims) {
  const size_t stride = (size_t)m->rows.stride;
  const ms_halves *halves = &m->halves;
  for (int32_t s = 0; s < halves->ngroups + halves->nparts; s++) {
    const place p = place_of(halves, s, f, stride);
    for (size_t lane = 0; lane < MS_GROUP; lane += MS_LANES) {
      const vec xi = load_own(p, lane, x, stride, dims);
      vec sum = {{{0}}};
      if (!p.is_part) sum = load(p.sums + lane, p.stride, dims);
      for (int32_t slot = halves->first[s]; slot < halves->first[s + 1]; slot++) {
        const vec d = minus(load_neighbours(halves, slot, lane, x, stride, dims), xi, dims);
        const ms_lanes k = ms_load(halves->k + MS_GROUP * (size_t)slot + lane);
        EACH(c) sum.c[c] += k * d.c[c];
      }
      store(p.sums + lane, p.stride, sum, dims);
    }
  }
  ms_halves_add_parts(halves, (int32_t)dims, stride, f);
}

static void linear_springs(const ms_model *m, const double *x, double *f) {
  if (m->rows.dims == 3) add_linear_springs(m, x, f, 3);
  else add_linear_springs(m, x, f, 2);
}

/*------------------------------------- coefficients ---------------------------------------------*/

/* t and w of force.h, at the differences d = x_j - x_i */
MS_INLINE void half_coefficients(vec d, const ms_halves *halves, double h, double largest_ratio,
                                 ms_coefficients *a, size_t at, size_t dims) {
  const ms_lanes zero = {0}, one = zero + 1, largest = zero + largest_ratio;
  const ms_lanes l2 = dot(d, d, dims);
  const ms_mask there = has_direction(l2);
  const ms_lanes l = ms_sqrt(ms_select(there, l2, one));
  const ms_lanes hhk = h * h * ms_load(halves->k + at), full = ms_load(halves->rest + at) / l;
  const ms_lanes ratio = ms_select(there, ms_select(full > largest, largest, full), zero);
  const ms_lanes w2 = hhk * ratio + h * ms_load(halves->damping + at);
  const ms_lanes w = ms_select(there, ms_sqrt(w2) / l, zero);
  ms_store(a->t + at, hhk * (1 - ratio));
  EACH(c) ms_store(a->w[c] + at, w * d.c[c]);
}

/* m + h b, and every half spring's block is added to its row's */
MS_INLINE void diagonal_blocks(const ms_model *m, int32_t segment, place p, ms_coefficients *a,
                               size_t dims) {
  const size_t begin = MS_GROUP * (size_t)m->halves.first[segment];
  const size_t end = MS_GROUP * (size_t)m->halves.first[segment + 1];
  for (size_t lane = 0; lane < MS_GROUP; lane += MS_LANES) {
    ms_lanes sum[6] = {{0}};
    if (!p.is_part) EACH(c) sum[c] = ms_load(m->mass + p.row + lane) + a->drag;
    for (size_t at = begin + lane; at < end; at += MS_GROUP) {
      const ms_lanes t = ms_load(a->t + at);
      vec w;
      EACH(c) w.c[c] = ms_load(a->w[c] + at);
      EACH(c) sum[c] += t + w.c[c] * w.c[c];
      EACH(b)
      for (size_t c = b + 1; c < dims; c++) sum[ms_diagonal_entry(dims, b, c)] += w.c[b] * w.c[c];
    }
    for (size_t e = 0; e < ms_diagonal_size(dims); e++)
      ms_store(p.sums + lane + e * p.stride, sum[e]);
  }
}

MS_INLINE void all_coefficients(const ms_model *model, const double *x, double h, int clamp,
                                ms_coefficients *a, size_t dims) {
  const size_t stride = (size_t)model->rows.stride, sd = (size_t)model->rows.first_pinned;
  const ms_halves *halves = &model->halves;
  const double largest_ratio = clamp ? 1 : INFINITY;
  for (int32_t s = 0; s < halves->ngroups + halves->nparts; s++) {
    const place p = place_of(halves, s, a->diagonal, sd);
    for (size_t lane = 0; lane < MS_GROUP; lane += MS_LANES) {
      const vec xi = load_own(p, lane, x, stride, dims);
      for (int32_t slot = halves->first[s]; slot < halves->first[s + 1]; slot++) {
        const size_t at = MS_GROUP * (size_t)slot + lane;
        const vec d = minus(load_neighbours(halves, slot, lane, x, stride, dims), xi, dims);
        half_coefficients(d, halves, h, largest_ratio, a, at, dims);
      }
    }
    diagonal_blocks(model, s, p, a, dims);
  }
  ms_halves_add_parts(halves, (int32_t)ms_diagonal_size(dims), sd, a->diagonal);
}

static void coefficients(const ms_model *model, const double *x, double h, int clamp,
                         ms_coefficients *a) {
  if (model->rows.dims == 3) all_coefficients(model, x, h, clamp, a, 3);
  else all_coefficients(model, x, h, clamp, a, 2);
}

/*------------------------------------- products -------------------------------------------------*/

MS_INLINE vec apply_diagonal(const double *d, size_t s, const double *x, size_t stride,
                             size_t dims) {
  const vec v = load(x, stride, dims);
  vec product;
  EACH(b) {
    product.c[b] = ms_load(d + ms_diagonal_entry(dims, b, 0) * s) * v.c[0];
    for (size_t c = 1; c < dims; c++)
      product.c[b] += ms_load(d + ms_diagonal_entry(dims, b, c) * s) * v.c[c];
  }
  return product;
}

/* y_i = D_i x_i - sum over half springs of (t x_j + (w.x_j) w) */
MS_INLINE void apply_all(const ms_model *model, const ms_coefficients *a, const double *x,
                         double *y, size_t dims) {
  const size_t stride = (size_t)model->rows.stride, sd = (size_t)model->rows.first_pinned;
  const ms_halves *halves = &model->halves;
  for (int32_t s = 0; s < halves->ngroups + halves->nparts; s++) {
    const place p = place_of(halves, s, y, stride);
    for (size_t lane = 0; lane < MS_GROUP; lane += MS_LANES) {
      const size_t row = p.row + lane;
      vec sum = {{{0}}};
      if (!p.is_part) sum = apply_diagonal(a->diagonal + row, sd, x + row, stride, dims);
      for (int32_t slot = halves->first[s]; slot < halves->first[s + 1]; slot++) {
        const size_t at = MS_GROUP * (size_t)slot + lane;
        const vec v = load_neighbours(halves, slot, lane, x, stride, dims);
        const ms_lanes t = ms_load(a->t + at);
        vec w;
        EACH(c) w.c[c] = ms_load(a->w[c] + at);
        const ms_lanes along = dot(w, v, dims);
        EACH(c) sum.c[c] -= t * v.c[c] + along * w.c[c];
      }
      store(p.sums + lane, p.stride, sum, dims);
    }
  }
  ms_halves_add_parts(halves, (int32_t)dims, stride, y);
  EACH(c) memset(y + c * stride + sd, 0, (stride - sd) * sizeof *y);
}

static void apply(const ms_model *model, const ms_coefficients *a, const double *x, double *y) {
  if (model->rows.dims == 3) apply_all(model, a, x, y, 3);
  else apply_all(model, a, x, y, 2);
}

/* y_i = D_i x_i - sum of t x_j, for each component */
MS_INLINE void apply_alike_all(const ms_model *model, const ms_coefficients *a, const double *x,
                               double *y, size_t dims) {
  const size_t stride = (size_t)model->rows.stride, end = (size_t)model->rows.first_pinned;
  const ms_halves *halves = &model->halves;
  for (int32_t s = 0; s < halves->ngroups + halves->nparts; s++) {
    const place p = place_of(halves, s, y, stride);
    for (size_t lane = 0; lane < MS_GROUP; lane += MS_LANES) {
      vec sum = {{{0}}};
      if (!p.is_part) {
        sum = load(x + p.row + lane, stride, dims);
        EACH(c) sum.c[c] *= ms_load(a->diagonal + p.row + lane);
      }
      for (int32_t slot = halves->first[s]; slot < halves->first[s + 1]; slot++) {
        const ms_lanes t = ms_load(a->t + MS_GROUP * (size_t)slot + lane);
        const vec v = load_neighbours(halves, slot, lane, x, stride, dims);
        EACH(c) sum.c[c] -= t * v.c[c];
      }
      store(p.sums + lane, p.stride, sum, dims);
    }
  }
  ms_halves_add_parts(halves, (int32_t)dims, stride, y);
  EACH(c) memset(y + c * stride + end, 0, (stride - end) * sizeof *y);
}

static void apply_alike(const ms_model *model, const ms_coefficients *a, int32_t components,
                        const double *x, double *y) {
  if (components == 3) apply_alike_all(model, a, x, y, 3);
  else if (components == 2) apply_alike_all(model, a, x, y, 2);
  else apply_alike_all(model, a, x, y, 1);
}

const ms_kernels MS_TABLE(ms_kernels) = {springs, linear_springs, coefficients, apply, apply_alike};
