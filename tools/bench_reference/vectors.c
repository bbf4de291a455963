#include "vectors.h"

#include <math.h>
#include <nvector/nvector_serial.h>
#include <string.h>

#include "target_clones.h"

double *value_of(N_Vector v) { return NV_DATA_S(v); }

static size_t nvector_length(N_Vector v) { return (size_t)NV_LENGTH_S(v); }

/*------------------------------------- loops ----------------------------------------------------*/

/* Operations in place have loops of their own, so that the arrays of a loop never overlap. */

TARGET_CLONES static void vector_scaled_copy(size_t n, double a, const double *restrict x,
                                             double *restrict z) {
  for (size_t i = 0; i < n; i++) z[i] = a * x[i];
}

TARGET_CLONES static void vector_scale_in_place(size_t n, double a, double *z) {
  for (size_t i = 0; i < n; i++) z[i] *= a;
}

TARGET_CLONES static void vector_linear_sum(size_t n, double a, const double *restrict x, double b,
                                            const double *restrict y, double *restrict z) {
  for (size_t i = 0; i < n; i++) z[i] = a * x[i] + b * y[i];
}

TARGET_CLONES static void vector_linear_sum_in_place(size_t n, double a, const double *restrict x,
                                                     double b, double *restrict z) {
  for (size_t i = 0; i < n; i++) z[i] = a * x[i] + b * z[i];
}

TARGET_CLONES void multiply(size_t n, const double *restrict w, double *restrict z) {
  for (size_t i = 0; i < n; i++) z[i] *= w[i];
}

/* 8 partial sums, which suit every vector width, then a tree */
enum { LANES = 8 };

static double sum_lanes(const double s[LANES]) {
  return ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]));
}

TARGET_CLONES static double vector_dot_loop(size_t n, const double *x, const double *y) {
  double sum[LANES] = {0};
  size_t i = 0;
  for (; i + LANES <= n; i += LANES)
    for (size_t lane = 0; lane < LANES; lane++) sum[lane] += x[i + lane] * y[i + lane];
  for (size_t lane = 0; i < n; i++, lane++) sum[lane] += x[i] * y[i];
  return sum_lanes(sum);
}

TARGET_CLONES static double weighted_square(size_t n, const double *x, const double *w) {
  double sum[LANES] = {0};
  size_t i = 0;
  for (; i + LANES <= n; i += LANES)
    for (size_t lane = 0; lane < LANES; lane++) {
      const double product = x[i + lane] * w[i + lane];
      sum[lane] += product * product;
    }
  for (size_t lane = 0; i < n; i++, lane++) sum[lane] += x[i] * w[i] * (x[i] * w[i]);
  return sum_lanes(sum);
}

/*------------------------------------- operations -----------------------------------------------*/

static void nvector_const(double c, N_Vector z) {
  double *value = value_of(z);
  for (size_t i = 0; i < nvector_length(z); i++) value[i] = c;
}

static void nvector_scale(double a, N_Vector x, N_Vector z) {
  if (x == z) vector_scale_in_place(nvector_length(z), a, value_of(z));
  else if (a == 1) memcpy(value_of(z), value_of(x), nvector_length(z) * sizeof(double));
  else vector_scaled_copy(nvector_length(z), a, value_of(x), value_of(z));
}

static void nvector_sum(double a, N_Vector x, double b, N_Vector y, N_Vector z) {
  const size_t n = nvector_length(z);
  if (x == y) nvector_scale(a + b, x, z);
  else if (x == z) vector_linear_sum_in_place(n, b, value_of(y), a, value_of(z));
  else if (y == z) vector_linear_sum_in_place(n, a, value_of(x), b, value_of(z));
  else vector_linear_sum(n, a, value_of(x), b, value_of(y), value_of(z));
}

static double nvector_dot(N_Vector x, N_Vector y) {
  return vector_dot_loop(nvector_length(x), value_of(x), value_of(y));
}

static double vector_wrms_norm(N_Vector x, N_Vector w) {
  const size_t n = nvector_length(x);
  return sqrt(weighted_square(n, value_of(x), value_of(w)) / (double)n);
}

/* z = sum of c[k] x[k], in chunks that stay in the cache. z may be one of the x. */
static int nvector_combine(int count, double *c, N_Vector *x, N_Vector z) {
  enum { CHUNK = 512 };
  double sum[CHUNK];
  for (size_t at = 0, n = nvector_length(z); at < n; at += CHUNK) {
    const size_t m = n - at < CHUNK ? n - at : CHUNK;
    vector_scaled_copy(m, c[0], value_of(x[0]) + at, sum);
    for (int k = 1; k < count; k++)
      vector_linear_sum_in_place(m, c[k], value_of(x[k]) + at, 1, sum);
    memcpy(value_of(z) + at, sum, m * sizeof *sum);
  }
  return 0;
}

/* z[k] = a[k] x + y[k] */
static int vector_add_to_all(int count, double *a, N_Vector x, N_Vector *y, N_Vector *z) {
  for (int k = 0; k < count; k++) nvector_sum(a[k], x, 1, y[k], z[k]);
  return 0;
}

/* d[k] = x . y[k] */
static int vector_dots(int count, N_Vector x, N_Vector *y, double *d) {
  for (int k = 0; k < count; k++) d[k] = nvector_dot(x, y[k]);
  return 0;
}

/* z[k] = c[k] x[k] */
static int vector_scale_all(int count, double *c, N_Vector *x, N_Vector *z) {
  for (int k = 0; k < count; k++) nvector_scale(c[k], x[k], z[k]);
  return 0;
}

/* Replaces the operations that steps use. */
N_Vector fast_vector(size_t n, SUNContext context) {
  N_Vector v = N_VNew_Serial((sunindextype)n, context);
  if (!v) return NULL;
  v->ops->nvlinearsum = nvector_sum;
  v->ops->nvconst = nvector_const;
  v->ops->nvscale = nvector_scale;
  v->ops->nvdotprod = nvector_dot;
  v->ops->nvwrmsnorm = vector_wrms_norm;
  v->ops->nvlinearcombination = nvector_combine;
  v->ops->nvscaleaddmulti = vector_add_to_all;
  v->ops->nvdotprodmulti = vector_dots;
  v->ops->nvscalevectorarray = vector_scale_all;
  nvector_const(0, v);
  return v;
}
