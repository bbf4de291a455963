#include "base/vector.h"

#include <math.h>
#include <string.h>

#include "base/ranks.h"
#include "base/simd.h"
#include "base/vector_kernels.h"

MS_TABLES(ms_vector_kernels);

/* loops over the components, which start at x[at], and over the rows r of one */
#define EACH_COMPONENT(s)                                                      \
  for (size_t at = 0, end_ = (size_t)(s).dims * (size_t)(s).stride; at < end_; \
       at += (size_t)(s).stride)
#define EACH_ROW(s) for (int32_t r = 0; r < (s).n; r++)

void ms_vector_copy(ms_shape s, const double *x, double *y) {
  EACH_COMPONENT(s) memcpy(y + at, x + at, (size_t)s.n * sizeof *x);
}

void ms_vector_copy_all(ms_shape s, const double *x, double *y) {
  memcpy(y, x, (size_t)s.dims * (size_t)s.stride * sizeof *x);
}

void ms_vector_clear_all(ms_shape s, double *x) {
  memset(x, 0, (size_t)s.dims * (size_t)s.stride * sizeof *x);
}

void ms_vector_scale(ms_shape s, double a, double *x) {
  EACH_COMPONENT(s) EACH_ROW(s) x[at + (size_t)r] *= a;
}

void ms_vector_axpy(ms_shape s, double a, const double *x, double *y) {
  EACH_COMPONENT(s) {
    const double *restrict xc = x + at;
    double *restrict yc = y + at;
    EACH_ROW(s) yc[r] += a * xc[r];
  }
}

void ms_vector_add_scaled(ms_shape s, const double *x, double a, const double *y, double *z) {
  EACH_COMPONENT(s) {
    const double *xc = x + at, *yc = y + at;
    double *zc = z + at;
    EACH_ROW(s) zc[r] = xc[r] + a * yc[r];
  }
}

void ms_vector_add_two_scaled(ms_shape s, const double *x, double a, const double *y, double b,
                              const double *z, double *w) {
  EACH_COMPONENT(s) {
    const double *xc = x + at, *yc = y + at, *zc = z + at;
    double *wc = w + at;
    EACH_ROW(s) wc[r] = xc[r] + (a * yc[r] + b * zc[r]);
  }
}

void ms_vector_three_term(ms_shape s, const double *y0, double a, const double *y1, double b,
                          const double *y2, double c, const double *f, double *y) {
  EACH_COMPONENT(s) {
    const double *from = y0 + at, *one = y1 + at, *two = y2 + at, *fc = f + at;
    double *to = y + at;
    EACH_ROW(s)
    to[r] = from[r] + (a * (one[r] - from[r]) + b * (two[r] - from[r]) + c * fc[r]);
  }
}

void ms_vector_linear_combination(ms_shape s, const double *x, int n, const double *w,
                                  const double *const *y, double *z) {
  ms_vector_kernels_of[s.isa]->linear_combination(s, x, n, w, y, z);
}

void ms_vector_scale_rows(ms_shape s, const double *d, const double *f, double *a) {
  EACH_COMPONENT(s) {
    const double *fc = f + at;
    double *ac = a + at;
    EACH_ROW(s) ac[r] = d[r] * fc[r];
  }
}

enum { LANES = 8, CHUNK = 1024 };

static double dot_chunk(const double *x, const double *y, int32_t n) {
  double sum[LANES] = {0};
  int32_t r = 0;
  for (; r + LANES <= n; r += LANES)
    for (int lane = 0; lane < LANES; lane++) sum[lane] += x[r + lane] * y[r + lane];
  for (int lane = 0; r < n; r++, lane++) sum[lane] += x[r] * y[r];
  return ms_vector_sum_lanes(sum);
}

double ms_vector_dot(ms_shape s, const double *x, const double *y) {
  double sum = 0;
  EACH_COMPONENT(s) {
    for (int32_t r = 0; r < s.n; r += CHUNK)
      sum += dot_chunk(x + at + r, y + at + r, s.n - r < CHUNK ? s.n - r : CHUNK);
  }
  if (s.ranks) ms_ranks_sum(s.ranks, 1, &sum);
  return sum;
}

int ms_vector_is_zero(ms_shape s, const double *x) {
  EACH_COMPONENT(s) {
    int32_t r = 0;
    for (; r + LANES <= s.n; r += LANES) {
      ms_mask moves = {0};
      for (int i = 0; i < LANES; i += MS_LANES) moves |= ms_simd_load(x + at + r + i) != 0;
      for (int i = 0; i < MS_LANES; i++)
        if (moves[i]) return 0;
    }
    for (; r < s.n; r++)
      if (x[at + (size_t)r] != 0) return 0;
  }
  return 1;
}

int ms_vector_is_equal(ms_shape s, const double *x, const double *y) {
  EACH_COMPONENT(s) if (memcmp(x + at, y + at, (size_t)s.n * sizeof *x) != 0) return 0;
  return 1;
}

int32_t ms_vector_find_invalid(ms_shape s, const double *x) {
  if (ms_vector_kernels_of[s.isa]->is_valid(s, x)) return -1;
  for (int32_t r = 0; r < s.n; r++)
    EACH_COMPONENT(s) if (!(fabs(x[at + (size_t)r]) <= MS_LARGEST_VALID)) return r;
  return -1;
}

int32_t ms_vector_find_largest(ms_shape s, const double *x) {
  int32_t row = 0;
  double largest = -1;
  for (int32_t r = 0; r < s.n; r++) EACH_COMPONENT(s) {
      const double size = fabs(x[at + (size_t)r]);
      if (size > largest) largest = size, row = r;
    }
  double most = largest; /* of all ranks */
  if (s.ranks) ms_ranks_maximum(s.ranks, 1, &most);
  return largest == most ? row : -1;
}

double ms_vector_random_entry(uint32_t i) {
  i = (i ^ 61u ^ (i >> 16)) * 2654435769u;
  return (double)(i >> 8) / 16777216.0 - 0.5;
}
