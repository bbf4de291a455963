/* vector_kernels - the loops of vector.h, compiled for each instruction set */
#ifndef MS_VECTOR_KERNELS_H
#define MS_VECTOR_KERNELS_H

#include "base/isa.h"
#include "base/vector.h"

/* loops over the components, which start at x[at], and over the rows r of one */
#define EACH_COMPONENT(s)                                                      \
  for (size_t at = 0, end_ = (size_t)(s).dims * (size_t)(s).stride; at < end_; \
       at += (size_t)(s).stride)
/* the same over all components that a vector has, errors of sums included */
#define EACH_PART(s)                                                                     \
  for (size_t at = 0, end_ = (size_t)ms_vector_count_components(s) * (size_t)(s).stride; \
       at < end_; at += (size_t)(s).stride)
/* A result may replace an operand, but no row depends on another one: compilers need not check. */
#ifdef __clang__
#  define INDEPENDENT_ITERATIONS _Pragma("clang loop vectorize(assume_safety)")
#else
#  define INDEPENDENT_ITERATIONS _Pragma("GCC ivdep")
#endif
#define EACH_ROW(s) INDEPENDENT_ITERATIONS for (int32_t r = 0; r < (s).n; r++)

/* Functions of vector.h over doubles, or over floats */
typedef struct ms_vector_loops {
  void (*scale)(ms_shape s, double a, void *x);
  void (*axpy)(ms_shape s, double a, const void *x, void *y);
  void (*add_scaled)(ms_shape s, const void *x, double a, const void *y, void *z);
  void (*add_two_scaled)(ms_shape s, const void *x, double a, const void *y, double b,
                         const void *z, void *w);
  void (*three_term)(ms_shape s, const void *y0, double a, const void *y1, double b, const void *y2,
                     double c, const void *f, void *y);
  double (*dot)(ms_shape s, const void *x, const void *y); /* of this rank */
  int (*is_zero)(ms_shape s, const void *x);
  int32_t (*find_above)(ms_shape s, double limit, const void *x);
} ms_vector_loops;

/* [0] doubles, [1] floats (vector_loop_kernels.c); results do not depend on the instruction set. */
typedef struct ms_vector_loop_kernels {
  ms_vector_loops of[2];
} ms_vector_loop_kernels;

/* Functions of vector.h; neither do theirs. */
typedef struct ms_vector_kernels {
  /* sums: 1 or 2 */
  void (*combinations)(ms_shape s, int n, const double *const *y, int sums,
                       const ms_combination *of);
  /* 1: no number is NaN or beyond MS_LARGEST_VALID; 0: some may be */
  int (*is_valid)(ms_shape s, const double *x);
} ms_vector_kernels;

#endif
