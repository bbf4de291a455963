#include "base/vector.h"

#include <math.h>
#include <string.h>

#include "base/ranks.h"
#include "base/vector_kernels.h"

MS_TABLES(ms_vector_kernels);
MS_TABLES(ms_vector_loop_kernels);

size_t ms_vector_number_size(ms_shape s) { return s.single ? sizeof(float) : sizeof(double); }

int32_t ms_vector_count_components(ms_shape s) { return s.single ? 2 * s.dims : s.dims; }

/* The loops over the numbers that vectors of shape s have */
#define LOOPS(s) (&ms_vector_loop_kernels_of[(s).isa]->of[(s).single != 0])

void ms_vector_copy(ms_shape s, const void *x, void *y) {
  const size_t size = ms_vector_number_size(s);
  EACH_PART(s) memcpy((char *)y + at * size, (const char *)x + at * size, (size_t)s.n * size);
}

void ms_vector_copy_all(ms_shape s, const void *x, void *y) {
  memcpy(y, x, (size_t)s.dims * (size_t)s.stride * sizeof(double));
}

void ms_vector_clear_all(ms_shape s, void *x) {
  memset(x, 0, (size_t)s.dims * (size_t)s.stride * sizeof(double));
}

void ms_vector_scale(ms_shape s, double a, void *x) { LOOPS(s)->scale(s, a, x); }

void ms_vector_axpy(ms_shape s, double a, const void *x, void *y) { LOOPS(s)->axpy(s, a, x, y); }

void ms_vector_add_scaled(ms_shape s, const void *x, double a, const void *y, void *z) {
  LOOPS(s)->add_scaled(s, x, a, y, z);
}

void ms_vector_add_two_scaled(ms_shape s, const void *x, double a, const void *y, double b,
                              const void *z, void *w) {
  LOOPS(s)->add_two_scaled(s, x, a, y, b, z, w);
}

void ms_vector_three_term(ms_shape s, const void *y0, double a, const void *y1, double b,
                          const void *y2, double c, const void *f, void *y) {
  LOOPS(s)->three_term(s, y0, a, y1, b, y2, c, f, y);
}

void ms_vector_linear_combination(ms_shape s, const double *x, int n, const double *w,
                                  const double *const *y, double *z) {
  ms_vector_kernels_of[s.isa]->combinations(s, n, y, 1, &(ms_combination){x, w, z});
}

void ms_vector_two_combinations(ms_shape s, int n, const double *const *y,
                                const ms_combination of[2]) {
  ms_vector_kernels_of[s.isa]->combinations(s, n, y, 2, of);
}

void ms_vector_scale_rows(ms_shape s, const double *d, const double *f, double *a) {
  EACH_COMPONENT(s) {
    const double *fc = f + at;
    double *ac = a + at;
    EACH_ROW(s) ac[r] = d[r] * fc[r];
  }
}

double ms_vector_dot(ms_shape s, const void *x, const void *y) {
  double sum = LOOPS(s)->dot(s, x, y);
  if (s.ranks) ms_ranks_sum(s.ranks, 1, &sum);
  return sum;
}

int ms_vector_is_zero(ms_shape s, const void *x) { return LOOPS(s)->is_zero(s, x); }

int ms_vector_is_equal(ms_shape s, const void *x, const void *y) {
  const size_t size = ms_vector_number_size(s);
  EACH_PART(s) {
    const size_t from = at * size;
    if (memcmp((const char *)x + from, (const char *)y + from, (size_t)s.n * size) != 0) return 0;
  }
  return 1;
}

int32_t ms_vector_find_invalid(ms_shape s, const void *x) {
  if (s.single) return LOOPS(s)->find_above(s, MS_LARGEST_VALID_SINGLE, x);
  if (ms_vector_kernels_of[s.isa]->is_valid(s, x)) return -1;
  return LOOPS(s)->find_above(s, MS_LARGEST_VALID, x);
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

void ms_vector_fill_random(ms_shape s, uint32_t first, double *v) {
  for (int32_t i = 0; i < s.dims * s.stride; i++)
    v[i] = i % s.stride < s.n ? ms_vector_random_entry(first + (uint32_t)i) : 0;
}
