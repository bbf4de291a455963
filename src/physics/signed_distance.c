/* In the coordinates q of the solid (colliders.h), for particles outside it; formulas after
 * I. Quilez, "Distance functions", iquilezles.org. */
#include "physics/signed_distance.h"

#include <float.h>

#include "base/vec3.h"
#include "physics/sampled_distance.h"

/* sign(q), 1 at q = 0 */
static double sign_of(double q) { return q < 0 ? -1 : 1; }

/* Divide d, of that length, by it. Where the length is 0, d becomes the first axis. */
static void normalize(double length, double d[3]) {
  if (length > 0)
    for (int i = 0; i < 3; i++) d[i] /= length;
  else d[0] = 1;
}

/* |q - c| - radius; c: the nearest point of the axis, |c_2| <= half_2 */
static double capsule_distance(const ms_solid *s, const double q[3], double n[3]) {
  const double c = fmax(-s->half[2], fmin(q[2], s->half[2]));
  n[0] = q[0], n[1] = q[1], n[2] = q[2] - c;
  const double length = ms_vec3_norm(n);
  normalize(length, n);
  return length - s->radius;
}

/* With d = (|(q_0, q_1)| - radius, |q_2| - half_2): max(d) if that is <= 0, else |max(d, 0)| */
static double cylinder_distance(const ms_solid *s, const double q[3], double n[3]) {
  const double radial[3] = {q[0], q[1], 0}, rho = ms_vec3_norm(radial);
  const double across = rho - s->radius, along = fabs(q[2]) - s->half[2];
  const int is_inside = across <= 0 && along <= 0;
  const double a = is_inside ? across >= along : fmax(across, 0),
               b = is_inside ? across < along : fmax(along, 0);
  double u[3] = {q[0], q[1], 0};
  normalize(rho, u);
  for (int i = 0; i < 3; i++) n[i] = a * u[i];
  n[2] = b * sign_of(q[2]);
  if (is_inside) return fmax(across, along);
  const double length = hypot(a, b);
  normalize(length, n);
  return length;
}

/* With d_i = |q_i| - half_i: max(d) if that is <= 0, else |max(d, 0)| */
static double box_distance(const ms_solid *s, const double q[3], double n[3]) {
  double d[3];
  int largest = 0;
  for (int i = 0; i < 3; i++) {
    d[i] = fabs(q[i]) - s->half[i];
    if (d[i] > d[largest]) largest = i;
  }
  const int is_inside = d[largest] <= 0;
  for (int i = 0; i < 3; i++) n[i] = (is_inside ? i == largest : fmax(d[i], 0)) * sign_of(q[i]);
  if (is_inside) return d[largest];
  const double length = ms_vec3_norm(n);
  normalize(length, n);
  return length;
}

static double half_space_distance(const ms_solid *s, const double q[3], double n[3]) {
  n[0] = n[1] = 0, n[2] = 1;
  return q[2] + s->half[2];
}

static double find_distance(const ms_solid *s, const double q[3], double n[3]) {
  switch (s->type) {
    case MS_SOLID_HALF_SPACE:
      return half_space_distance(s, q, n);
    case MSIM_COLLIDER_BOX:
      return box_distance(s, q, n);
    case MSIM_COLLIDER_CYLINDER:
      return cylinder_distance(s, q, n);
    case MSIM_COLLIDER_HEIGHTFIELD:
      return ms_sampled_distance_of_heights(s, q, n);
    case MSIM_COLLIDER_SDF:
      return ms_sampled_distance_of_grid(s, q, n);
    default:
      return capsule_distance(s, q, n);
  }
}

double ms_signed_distance(const ms_solid *s, const double x[3], double normal[3]) {
  double q[3], n[3];
  const double d[3] = {x[0] - s->center[0], x[1] - s->center[1], x[2] - s->center[2]};
  for (int i = 0; i < 3; i++) q[i] = ms_vec3_dot(s->axis[i], d);
  const double distance = find_distance(s, q, n);
  const double side = s->inside ? -1 : 1;
  for (int c = 0; c < 3; c++)
    normal[c] = side * (n[0] * s->axis[0][c] + n[1] * s->axis[1][c] + n[2] * s->axis[2][c]);
  return side * distance;
}

/* The point q nearest to the middle of a grid of signed distances counts by its distance from the
 * grid, heights as above the highest one. */
static double bound_sampled_distance(const ms_solid *s, const double q[3], const double extent[3]) {
  const ms_samples *m = s->samples;
  double out[3];
  if (s->inside) return -INFINITY;
  const double above = q[2] - extent[2] - m->highest;
  if (s->type == MSIM_COLLIDER_HEIGHTFIELD) return above > 0 ? above * m->least_cosine : -INFINITY;
  for (int i = 0; i < 3; i++) {
    const double half = 0.5 * (m->n[i] - 1) * m->spacing[i];
    out[i] = fmax(0, fabs(q[i] - half) - half - extent[i]);
  }
  const double beyond = ms_vec3_norm(out);
  return beyond > 0 ? beyond : -INFINITY;
}

/* Other distances grow with each |q_i|: outside a solid the least one is that of the least |q_i| of
 * the box, inside that of the largest ones. */
double ms_signed_distance_bound(const ms_solid *s, const double middle[3], const double half[3]) {
  double q[3], extent[3], at[3], unused[3];
  const double d[3] = {middle[0] - s->center[0], middle[1] - s->center[1],
                       middle[2] - s->center[2]};
  for (int i = 0; i < 3; i++) {
    const double *a = s->axis[i];
    q[i] = ms_vec3_dot(a, d);
    extent[i] = fabs(a[0]) * half[0] + fabs(a[1]) * half[1] + fabs(a[2]) * half[2];
    at[i] = s->inside ? fabs(q[i]) + extent[i] : fmax(0, fabs(q[i]) - extent[i]);
  }
  if (s->samples) return bound_sampled_distance(s, q, extent);
  if (s->type == MS_SOLID_HALF_SPACE) at[2] = q[2] - extent[2];
  return (s->inside ? -1 : 1) * find_distance(s, at, unused);
}

void ms_signed_distance_find_velocity(const ms_solid *s, const double x[3], double v[3]) {
  const double d[3] = {x[0] - s->center[0], x[1] - s->center[1], x[2] - s->center[2]};
  for (int c = 0; c < 3; c++) {
    const int i = (c + 1) % 3, j = (c + 2) % 3;
    v[c] = s->velocity[c] + s->spin[i] * d[j] - s->spin[j] * d[i];
  }
}

/* (|w|^2 - (n.w)^2)/r, r the distance from the axis and n its direction; w is the part of u
 * perpendicular to the axis, or u where the nearest point of the axis is an end. */
double ms_signed_distance_bend(const ms_solid *s, const double x[3], const double u[3]) {
  double q[3], w[3];
  const double d[3] = {x[0] - s->center[0], x[1] - s->center[1], x[2] - s->center[2]};
  for (int i = 0; i < 3; i++) q[i] = ms_vec3_dot(s->axis[i], d), w[i] = ms_vec3_dot(s->axis[i], u);
  const double across = hypot(q[0], q[1]) - s->radius, along = fabs(q[2]) - s->half[2];
  if (s->type == MSIM_COLLIDER_BOX || s->type == MS_SOLID_HALF_SPACE || s->samples ||
      (s->type == MSIM_COLLIDER_CYLINDER && along > across))
    return 0;
  if (along <= 0 || s->type == MSIM_COLLIDER_CYLINDER) q[2] = w[2] = 0;
  else q[2] = copysign(along, q[2]);
  const double r2 = ms_vec3_dot(q, q), n = ms_vec3_dot(q, w);
  if (!(r2 > 0)) return 0;
  return (s->inside ? -1 : 1) * (ms_vec3_dot(w, w) - n * n / r2) / sqrt(r2);
}

double ms_signed_distance_tolerance(const ms_solid *s, const double x[3]) {
  return 64 * DBL_EPSILON * (s->reach + ms_vec3_norm(x));
}
