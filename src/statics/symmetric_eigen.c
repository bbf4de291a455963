#include "statics/symmetric_eigen.h"

#include <float.h>
#include <math.h>
#include <stddef.h>

/* The rotation by the angle t, tan 2t = 2 a_pq/(a_qq - a_pp), |t| <= pi/4, makes a_pq = 0. */
static void rotate(int32_t n, double *a, double *vectors, int32_t p, int32_t q) {
  const size_t size = (size_t)n, pp = (size_t)p * size, qq = (size_t)q * size;
  const double apq = a[pp + (size_t)q];
  const double theta = (a[qq + (size_t)q] - a[pp + (size_t)p]) / (2 * apq);
  const double t = copysign(1, theta) / (fabs(theta) + hypot(theta, 1));
  const double c = 1 / sqrt(t * t + 1), s = t * c;
  for (size_t k = 0; k < size; k++) {
    const double x = a[k * size + (size_t)p], y = a[k * size + (size_t)q];
    a[k * size + (size_t)p] = c * x - s * y, a[k * size + (size_t)q] = s * x + c * y;
  }
  for (size_t k = 0; k < size; k++) {
    const double x = a[pp + k], y = a[qq + k], u = vectors[k * size + (size_t)p],
                 v = vectors[k * size + (size_t)q];
    a[pp + k] = c * x - s * y, a[qq + k] = s * x + c * y;
    vectors[k * size + (size_t)p] = c * u - s * v, vectors[k * size + (size_t)q] = s * u + c * v;
  }
}

static void swap_columns(int32_t n, double *a, double *vectors, int32_t i, int32_t j) {
  const size_t size = (size_t)n, ii = (size_t)i * size + (size_t)i,
               jj = (size_t)j * size + (size_t)j;
  const double between = a[ii];
  a[ii] = a[jj], a[jj] = between;
  for (size_t k = 0; k < size; k++) {
    const double entry = vectors[k * size + (size_t)i];
    vectors[k * size + (size_t)i] = vectors[k * size + (size_t)j];
    vectors[k * size + (size_t)j] = entry;
  }
}

static void sort_descending(int32_t n, double *a, double *vectors) {
  const size_t step = (size_t)n + 1;
  for (int32_t i = 0; i < n; i++) {
    int32_t largest = i;
    for (int32_t j = i + 1; j < n; j++)
      if (a[(size_t)j * step] > a[(size_t)largest * step]) largest = j;
    swap_columns(n, a, vectors, i, largest);
  }
}

void ms_symmetric_eigen_solve(int32_t n, double *a, double *vectors) {
  enum { MOST_SWEEPS = 30 };
  const size_t size = (size_t)n;
  for (size_t i = 0; i < size * size; i++) vectors[i] = i % (size + 1) == 0;
  int rotated = 1;
  for (int sweep = 0; sweep < MOST_SWEEPS && rotated; sweep++) {
    rotated = 0;
    for (int32_t p = 0; p < n; p++)
      for (int32_t q = p + 1; q < n; q++) {
        const double app = a[(size_t)p * (size + 1)], aqq = a[(size_t)q * (size + 1)];
        if (fabs(a[(size_t)p * size + (size_t)q]) <= DBL_EPSILON * sqrt(fabs(app * aqq))) continue;
        rotate(n, a, vectors, p, q);
        rotated = 1;
      }
  }
  sort_descending(n, a, vectors);
}
