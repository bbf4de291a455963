/* vec3 - arithmetic of 3-vectors */
#ifndef MS_VEC3_H
#define MS_VEC3_H

#include <math.h>

static inline double ms_vec3_dot(const double a[3], const double b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline double ms_vec3_norm(const double a[3]) { return sqrt(ms_vec3_dot(a, a)); }

/* to = a x b */
static inline void ms_vec3_cross(const double a[3], const double b[3], double to[3]) {
  to[0] = a[1] * b[2] - a[2] * b[1];
  to[1] = a[2] * b[0] - a[0] * b[2];
  to[2] = a[0] * b[1] - a[1] * b[0];
}

/* y += a x */
static inline void ms_vec3_axpy(double a, const double x[3], double y[3]) {
  for (int c = 0; c < 3; c++) y[c] += a * x[c];
}

#endif
