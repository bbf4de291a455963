/* This file is compiled once per instruction set, MS_ISA. Blocks are by columns, of n scalars, a
 * constant where functions are inlined. */
#include "linear/coarse_cycle_kernels.h"

#include "base/simd.h"

enum { BLOCK = MS_BLOCK_CHOLESKY_MAX_BLOCK, QUADS = BLOCK / MS_MODES };

/*------------------------------------- blocks and vectors ---------------------------------------*/

typedef enum triangle { LOWER, UPPER } triangle;

/* 1: the triangle has quad q of column c. Loops over all quads are unrolled. */
MS_INLINE int has_quad(triangle is, size_t c, size_t q) {
  return is == LOWER ? q >= c / 4 : q <= c / 4;
}

/* y += a x */
MS_INLINE void add_product(triangle is, size_t n, const float *a, const double *x,
                           ms_quad y[QUADS]) {
  for (size_t c = 0; c < n; c++)
    for (size_t q = 0; q < n / 4; q++)
      if (has_quad(is, c, q)) y[q] += ms_simd_load_float_quad(a) * x[c], a += 4;
}

/* sums[c] += column c of a times y, lane by lane */
MS_INLINE void add_transposed(triangle is, size_t n, const float *a, const double *y,
                              ms_quad sums[BLOCK]) {
  for (size_t c = 0; c < n; c++)
    for (size_t q = 0; q < n / 4; q++)
      if (has_quad(is, c, q))
        sums[c] += ms_simd_load_float_quad(a) * ms_simd_load_quad(y + 4 * q), a += 4;
}

MS_INLINE ms_quad total(const ms_quad *sums) {
  return ms_simd_quad_sums(sums[0], sums[1], sums[2], sums[3]);
}

/* The sums of 4 floats of 4 columns: two octets */
MS_INLINE ms_quad total_pairs(const ms_float_octet *sums) {
  float lanes[16];
  ms_simd_store_octet(lanes, sums[0]);
  ms_simd_store_octet(lanes + 8, sums[1]);
  ms_quad wide[4];
  for (size_t c = 0; c < 4; c++) wide[c] = ms_simd_load_float_quad(lanes + 4 * c);
  return total(wide);
}

/* y = N x at place p, in single precision: two thirds of the work of a cycle. Columns are in pairs
 * (coarse_cycle.h), and independent sums keep the processor busy. */
MS_INLINE void multiply_links(size_t n, const ms_coarse_cycle *s, const float *x, int32_t p,
                              ms_quad y[QUADS]) {
  ms_float_octet sums[BLOCK / 2], parts[2][QUADS];
  for (size_t pair = 0; pair < n / 2; pair++)
    sums[pair] = parts[pair % 2][pair / 2] = (ms_float_octet){0};
  for (int32_t i = s->left.first[p]; i < s->left.first[p + 1]; i++) {
    const int32_t e = s->left.item[i];
    const int16_t *a = s->link + n * n * (size_t)e;
    const float *from = x + n * (size_t)s->column[e];
    ms_float_octet repeated[QUADS];
    for (size_t q = 0; q < n / 4; q++) repeated[q] = ms_simd_repeat_quad(from + 4 * q);
    for (size_t pair = 0; pair < n / 2; pair++)
      for (size_t q = 0; q < n / 4; q++, a += 8)
        sums[pair] = ms_simd_fma_octet(ms_simd_load_integer_octet(a), repeated[q], sums[pair]);
  }
  for (int32_t e = s->first[p]; e < s->first[p + 1]; e++) {
    const int16_t *a = s->link + n * n * (size_t)e;
    const float *from = x + n * (size_t)s->row[e];
    for (size_t two = 0; two < n / 4; two++)
      for (size_t k = 0; k < 2; k++) {
        const ms_float_octet spread = ms_simd_spread_pair(from + 4 * two + 2 * k);
        for (size_t q = 0; q < n / 4; q++, a += 8)
          parts[k][q] = ms_simd_fma_octet(ms_simd_load_integer_octet(a), spread, parts[k][q]);
      }
  }
  for (size_t q = 0; q < n / 4; q++) {
    float lanes[8];
    ms_simd_store_octet(lanes, parts[0][q] + parts[1][q]);
    const ms_quad part = ms_simd_load_float_quad(lanes) + ms_simd_load_float_quad(lanes + 4);
    y[q] = (part + total_pairs(sums + 2 * q)) * (1.0 / INT16_MAX);
  }
}

/*------------------------------------- one cycle ------------------------------------------------*/

MS_INLINE void scale_of(size_t n, ms_coarse_cycle *s, const double *r, int32_t p) {
  ms_quad y[QUADS] = {{0}};
  add_product(LOWER, n, s->inverse + ms_coarse_cycle_triangle(n) * (size_t)p,
              r + n * (size_t)s->members.item[p], y);
  for (size_t q = 0; q < n / 4; q++) ms_simd_store_float_quad(s->r + n * (size_t)p + 4 * q, y[q]);
}

/* After z = w r, the residual is r - (I + N) w r. */
MS_INLINE void restrict_of(size_t n, ms_coarse_cycle *s, int32_t cluster) {
  const double w = MS_COARSE_CYCLE_DAMPING;
  ms_quad sums[BLOCK];
  for (size_t c = 0; c < n; c++) sums[c] = (ms_quad){0};
  for (int32_t p = s->members.first[cluster]; p < s->members.first[cluster + 1]; p++) {
    const size_t at = n * (size_t)p;
    ms_quad y[QUADS];
    double residual[BLOCK];
    multiply_links(n, s, s->r, p, y);
    for (size_t q = 0; q < n / 4; q++)
      ms_simd_store_quad(residual + 4 * q,
                         (1 - w) * ms_simd_load_float_quad(s->r + at + 4 * q) - w * y[q]);
    add_transposed(UPPER, n, s->prolongation + ms_coarse_cycle_triangle(n) * (size_t)p, residual,
                   sums);
  }
  for (size_t q = 0; q < n / 4; q++)
    ms_simd_store_quad(s->c + n * (size_t)cluster + 4 * q,
                       MS_COARSE_CYCLE_OVER_CORRECTION * total(sums + 4 * q));
}

MS_INLINE void correct_of(size_t n, ms_coarse_cycle *s, int32_t cluster) {
  for (int32_t p = s->members.first[cluster]; p < s->members.first[cluster + 1]; p++) {
    const size_t at = n * (size_t)p;
    ms_quad z[QUADS];
    for (size_t q = 0; q < n / 4; q++)
      z[q] = MS_COARSE_CYCLE_DAMPING * ms_simd_load_float_quad(s->r + at + 4 * q);
    add_product(UPPER, n, s->prolongation + ms_coarse_cycle_triangle(n) * (size_t)p,
                s->c + n * (size_t)cluster, z);
    for (size_t q = 0; q < n / 4; q++) ms_simd_store_float_quad(s->z + at + 4 * q, z[q]);
  }
}

/* L^-T (z + w (r - (I + N) z)) */
MS_INLINE void finish_of(size_t n, const ms_coarse_cycle *s, double *out, int32_t p) {
  const size_t at = n * (size_t)p;
  double *to = out + n * (size_t)s->members.item[p];
  ms_quad y[QUADS], sums[BLOCK];
  double smooth[BLOCK];
  multiply_links(n, s, s->z, p, y);
  for (size_t q = 0; q < n / 4; q++) {
    const ms_quad r = ms_simd_load_float_quad(s->r + at + 4 * q),
                  z = ms_simd_load_float_quad(s->z + at + 4 * q);
    ms_simd_store_quad(smooth + 4 * q, z + MS_COARSE_CYCLE_DAMPING * (r - z - y[q]));
  }
  for (size_t c = 0; c < n; c++) sums[c] = (ms_quad){0};
  add_transposed(LOWER, n, s->inverse + ms_coarse_cycle_triangle(n) * (size_t)p, smooth, sums);
  for (size_t q = 0; q < n / 4; q++) ms_simd_store_quad(to + 4 * q, total(sums + 4 * q));
}

/*------------------------------------- Galerkin product -----------------------------------------*/

/* to += Q_row^T a Q_column, component by component, each 4 x 4; or its transpose */
MS_INLINE void add_projection(size_t n, const double *a, const float *row, const float *column,
                              int transposed, double *to) {
  for (size_t at = 0; at < n * n; at += 4 * n)
    for (size_t c = 0; c < n; c += 4) {
      double right[4][4] = {{0}}; /* a Q_column, by columns */
      for (size_t j = 0; j < 16; j++)
        for (size_t i = 0; i < 4; i++)
          right[j / 4][i] += a[at + j % 4 * n + c + i] * (double)column[j];
      for (size_t j = 0; j < 16; j++) {
        double sum = 0;
        for (size_t i = 0; i < 4; i++) sum += (double)row[j % 4 * 4 + i] * right[j / 4][i];
        to[transposed ? (c + j % 4) * n + at / n + j / 4 : at + j / 4 * n + c + j % 4] += sum;
      }
    }
}

/* Link e to the block of its two clusters, if `own` is the one that is eliminated later, or both */
MS_INLINE void add_link(size_t n, ms_coarse_cycle *s, int32_t e, int32_t own) {
  const int32_t row = s->members.item[s->row[e]], column = s->members.item[s->column[e]];
  const int32_t i = s->cluster[row], j = s->cluster[column], *position = s->chol.position;
  if (position[own] < position[own == i ? j : i]) return;
  double *to = s->chol.value + n * n * (size_t)ms_block_cholesky_find(&s->chol, i, j);
  const double *a = s->value + n * n * (size_t)(s->n + e);
  const float *left = s->modes + 16 * (size_t)row, *right = s->modes + 16 * (size_t)column;
  if (own == i) add_projection(n, a, left, right, 0, to);
  if (own == j) add_projection(n, a, left, right, 1, to);
}

/* A link inside the cluster is one of its rows. */
MS_INLINE void add_products_of(size_t n, ms_coarse_cycle *s, int32_t cluster) {
  const int32_t own = ms_block_cholesky_find(&s->chol, cluster, cluster);
  const int32_t begin = s->members.first[cluster], end = s->members.first[cluster + 1];
  for (int32_t p = begin; p < end; p++) {
    const float *modes = s->modes + 16 * (size_t)s->members.item[p];
    add_projection(n, s->value + n * n * (size_t)p, modes, modes, 0,
                   s->chol.value + n * n * (size_t)own);
    for (int32_t a = s->left.first[p]; a < s->left.first[p + 1]; a++)
      add_link(n, s, s->left.item[a], cluster);
    for (int32_t e = s->first[p]; e < s->first[p + 1]; e++)
      if (s->row[e] >= end) add_link(n, s, e, cluster);
  }
}

/*------------------------------------- 2 and 3 components ---------------------------------------*/

static void add_products(ms_coarse_cycle *s, int32_t cluster) {
  if (s->block == 12) add_products_of(12, s, cluster);
  else add_products_of(8, s, cluster);
}

static void scale(ms_coarse_cycle *s, const double *r, int32_t p) {
  if (s->block == 12) scale_of(12, s, r, p);
  else scale_of(8, s, r, p);
}

static void restrict_cluster(ms_coarse_cycle *s, int32_t cluster) {
  if (s->block == 12) restrict_of(12, s, cluster);
  else restrict_of(8, s, cluster);
}

static void correct_cluster(ms_coarse_cycle *s, int32_t cluster) {
  if (s->block == 12) correct_of(12, s, cluster);
  else correct_of(8, s, cluster);
}

static void finish(const ms_coarse_cycle *s, double *z, int32_t p) {
  if (s->block == 12) finish_of(12, s, z, p);
  else finish_of(8, s, z, p);
}

const ms_coarse_cycle_kernels MS_TABLE(ms_coarse_cycle_kernels) = {
    add_products, scale, restrict_cluster, correct_cluster, finish};
