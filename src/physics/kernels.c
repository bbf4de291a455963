/* Compiled once for each instruction set, with MS_ISA its name. */
#include <math.h>
#include <string.h>

#include "base/simd.h"
#include "physics/kernels.h"

typedef struct vec3 {
  ms_lanes x, y, z;
} vec3;

static inline vec3 load3(const double *from, size_t stride) {
  return (vec3){ms_load(from), ms_load(from + stride), ms_load(from + 2 * stride)};
}

static inline void store3(double *to, size_t stride, vec3 v) {
  ms_store(to, v.x), ms_store(to + stride, v.y), ms_store(to + 2 * stride, v.z);
}

/* The neighbours' part of x: consecutive rows, or gathered. */
static inline vec3 load_neighbours(const ms_halves *halves, int32_t slot, size_t lane,
                                   const double *x, size_t stride) {
  const int32_t start = halves->start[slot];
  if (start >= 0) return load3(x + (size_t)start + lane, stride);
  const int32_t *j = halves->neighbour + MS_GROUP * (size_t)slot + lane;
  vec3 v;
  for (int l = 0; l < MS_LANES; l++)
    v.x[l] = x[j[l]], v.y[l] = x[stride + (size_t)j[l]], v.z[l] = x[2 * stride + (size_t)j[l]];
  return v;
}

/*------------------------------------- coefficients ---------------------------------------------*/

static inline vec3 minus(vec3 a, vec3 b) { return (vec3){a.x - b.x, a.y - b.y, a.z - b.z}; }

/* Where l2 = |d|^2 says that a spring has a direction. NaN goes on, to be seen. */
static inline ms_mask has_direction(ms_lanes l2) { return (l2 > MS_ZERO_LENGTH2) | (l2 != l2); }

/* t and w of force.h, at the differences d = x_j - x_i */
static inline void half_coefficients(vec3 d, const ms_halves *halves, double h,
                                     double largest_ratio, ms_coefficients *a, size_t at) {
  const ms_lanes zero = {0}, one = zero + 1, largest = zero + largest_ratio;
  const ms_lanes l2 = d.x * d.x + d.y * d.y + d.z * d.z;
  const ms_mask there = has_direction(l2);
  const ms_lanes l = ms_sqrt(ms_select(there, l2, one));
  const ms_lanes hhk = h * h * ms_load(halves->k + at), full = ms_load(halves->rest + at) / l;
  const ms_lanes ratio = ms_select(there, ms_select(full > largest, largest, full), zero);
  const ms_lanes w2 = hhk * ratio + h * ms_load(halves->damping + at);
  const ms_lanes w = ms_select(there, ms_sqrt(w2) / l, zero);
  ms_store(a->t + at, hhk * (1 - ratio));
  ms_store(a->wx + at, w * d.x), ms_store(a->wy + at, w * d.y), ms_store(a->wz + at, w * d.z);
}

/* m + h b on the diagonal, and every half spring's block on its row */
static void diagonal_blocks(const ms_model *m, double h, int32_t group, ms_coefficients *a) {
  const size_t stride = (size_t)m->rows.first_pinned, row = MS_GROUP * (size_t)group;
  const double drag = m->passes & MSIM_SKIP_DRAG ? h * m->scene->drag : 0;
  const size_t begin = MS_GROUP * (size_t)m->halves.first[group];
  const size_t end = MS_GROUP * (size_t)m->halves.first[group + 1];
  for (size_t lane = 0; lane < MS_GROUP; lane += MS_LANES) {
    ms_lanes xx = ms_load(m->mass + row + lane) + drag, yy = xx, zz = xx;
    ms_lanes xy = {0}, xz = {0}, yz = {0};
    for (size_t at = begin + lane; at < end; at += MS_GROUP) {
      const ms_lanes t = ms_load(a->t + at), wx = ms_load(a->wx + at);
      const ms_lanes wy = ms_load(a->wy + at), wz = ms_load(a->wz + at);
      xx += t + wx * wx, yy += t + wy * wy, zz += t + wz * wz;
      xy += wx * wy, xz += wx * wz, yz += wy * wz;
    }
    double *d = a->diagonal + row + lane;
    ms_store(d, xx), ms_store(d + stride, yy), ms_store(d + 2 * stride, zz);
    ms_store(d + 3 * stride, xy), ms_store(d + 4 * stride, xz), ms_store(d + 5 * stride, yz);
  }
}

static void coefficients(const ms_model *model, const double *x, double h, int clamp,
                         ms_coefficients *a) {
  const size_t stride = (size_t)model->rows.stride;
  const ms_halves *halves = &model->halves;
  const double largest_ratio = clamp ? 1 : INFINITY;
  for (int32_t g = 0; g < halves->ngroups; g++) {
    for (size_t lane = 0; lane < MS_GROUP; lane += MS_LANES) {
      const vec3 xi = load3(x + MS_GROUP * (size_t)g + lane, stride);
      for (int32_t slot = halves->first[g]; slot < halves->first[g + 1]; slot++) {
        const size_t at = MS_GROUP * (size_t)slot + lane;
        const vec3 d = minus(load_neighbours(halves, slot, lane, x, stride), xi);
        half_coefficients(d, halves, h, largest_ratio, a, at);
      }
    }
    diagonal_blocks(model, h, g, a);
  }
}

/*------------------------------------- products -------------------------------------------------*/

static inline vec3 apply_diagonal(const double *d, size_t s, const double *x, size_t stride) {
  const ms_lanes xx = ms_load(d), yy = ms_load(d + s), zz = ms_load(d + 2 * s);
  const ms_lanes xy = ms_load(d + 3 * s), xz = ms_load(d + 4 * s), yz = ms_load(d + 5 * s);
  const vec3 v = load3(x, stride);
  return (vec3){xx * v.x + xy * v.y + xz * v.z, xy * v.x + yy * v.y + yz * v.z,
                xz * v.x + yz * v.y + zz * v.z};
}

/* y_i = D_i x_i - sum over half springs of (t x_j + (w.x_j) w) */
static void apply(const ms_model *model, const ms_coefficients *a, const double *x, double *y) {
  const size_t stride = (size_t)model->rows.stride, sd = (size_t)model->rows.first_pinned;
  const ms_halves *halves = &model->halves;
  for (int32_t g = 0; g < halves->ngroups; g++) {
    for (size_t lane = 0; lane < MS_GROUP; lane += MS_LANES) {
      const size_t row = MS_GROUP * (size_t)g + lane;
      vec3 sum = apply_diagonal(a->diagonal + row, sd, x + row, stride);
      for (int32_t slot = halves->first[g]; slot < halves->first[g + 1]; slot++) {
        const size_t at = MS_GROUP * (size_t)slot + lane;
        const vec3 v = load_neighbours(halves, slot, lane, x, stride);
        const ms_lanes wx = ms_load(a->wx + at), wy = ms_load(a->wy + at);
        const ms_lanes wz = ms_load(a->wz + at), t = ms_load(a->t + at);
        const ms_lanes w = wx * v.x + wy * v.y + wz * v.z;
        sum.x -= t * v.x + w * wx;
        sum.y -= t * v.y + w * wy;
        sum.z -= t * v.z + w * wz;
      }
      store3(y + row, stride, sum);
    }
  }
  for (size_t c = 0; c < 3; c++) memset(y + c * stride + sd, 0, (stride - sd) * sizeof *y);
}

const ms_kernels MS_FOR_ISA(ms_kernels) = {MS_FOR_ISA(ms_pass), coefficients, apply};
