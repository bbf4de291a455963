/* Compiled once for each instruction set, with MS_ISA defined as its name. */
#include <math.h>

#include "base/vector_kernels.h"

enum { LANES = 8, CHUNK = 1024 };

/* *sum = *x + more */
static inline void add_double(ms_shape s, const double *x, double more, double *sum) {
  (void)s;
  *sum = *x + more;
}

static inline void add_float(ms_shape s, const float *x, float more, float *sum) {
  const size_t error = (size_t)s.dims * (size_t)s.stride;
  const float before = *x, change = more + x[error], after = before + change;
  *sum = after, sum[error] = change - (after - before);
}

#define REAL       double
#define LOOP(name) name##_double
#include "base/vector_loops.h"
#undef REAL
#undef LOOP

#define REAL       float
#define LOOP(name) name##_float
#include "base/vector_loops.h"

#define LOOPS_OF(real)                                                                      \
  {                                                                                         \
    scale_##real, axpy_##real, add_scaled_##real, add_two_scaled_##real, three_term_##real, \
        dot_##real, is_zero_##real, find_above_##real                                       \
  }

const ms_vector_loop_kernels MS_TABLE(ms_vector_loop_kernels) = {
    {LOOPS_OF(double), LOOPS_OF(float)}};
