#include "physics/angle.h"

#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "physics/spring_law.h"
#include "scene/angles.h"

/* v -= its part along p, twice, as a first difference may consist of rounding errors */
static void project_across(const double p[3], double p2, double v[3]) {
  for (int i = 0; i < 2; i++) ms_vec3_axpy(-ms_vec3_dot(p, v) / p2, p, v);
}

/* Comparisons are such that NaN counts as a plane, and propagates to results. */
void ms_angle_measure(const double p[3], const double q[3], ms_angle *to) {
  double w[3];
  *to = (ms_angle){.kind = MS_ANGLE_NONE};
  for (int c = 0; c < 3; c++) to->p[c] = p[c], to->q[c] = q[c];
  to->a2 = ms_vec3_dot(to->p, to->p), to->b2 = ms_vec3_dot(to->q, to->q);
  if (to->a2 <= MS_MIN_LENGTH2 || to->b2 <= MS_MIN_LENGTH2) return;
  ms_vec3_cross(to->p, to->q, w);
  project_across(to->p, to->a2, w);
  const double across = ms_vec3_norm(w), along = ms_vec3_dot(to->p, to->q);
  to->phi = atan2(across, -along);
  if (across <= MS_ANGLE_SMALLEST_SINE * sqrt(to->a2) * sqrt(to->b2)) {
    to->kind = along < 0 ? MS_ANGLE_STRAIGHT : MS_ANGLE_FOLDED;
    return;
  }
  to->kind = MS_ANGLE_PLANE;
  for (int c = 0; c < 3; c++) to->n[c] = w[c] / across;
  ms_vec3_cross(to->n, to->p, to->grad[0]);
  ms_vec3_cross(to->q, to->n, to->grad[1]);
  for (int c = 0; c < 3; c++) to->grad[0][c] /= to->a2, to->grad[1][c] /= to->b2;
}

double ms_angle_energy(const ms_angle *at, const ms_angle_spring *s) {
  const double turn = at->phi - s->bend;
  return at->kind == MS_ANGLE_NONE ? 0 : s->k * turn * turn / 2;
}

/* -by e/a on i and -+by e/b on k, e = vp/a +- vq/b across the edges; +: straight */
static void add_collinear_force(const ms_angle *at, double by, const double vp[3],
                                const double vq[3], double fi[3], double fk[3]) {
  const double a = sqrt(at->a2), b = sqrt(at->b2), sign = at->kind == MS_ANGLE_STRAIGHT ? 1 : -1;
  double e[3];
  for (int c = 0; c < 3; c++) e[c] = vp[c] / a + sign * vq[c] / b;
  project_across(at->p, at->a2, e);
  ms_vec3_axpy(-by / a, e, fi);
  ms_vec3_axpy(-sign * by / b, e, fk);
}

void ms_angle_force(const ms_angle *at, const ms_angle_spring *s, const double vp[3],
                    const double vq[3], double fi[3], double fk[3]) {
  double torque = s->k * (at->phi - s->bend);
  for (int c = 0; c < 3; c++) fi[c] = fk[c] = 0;
  if (at->kind == MS_ANGLE_NONE) return;
  if (at->kind != MS_ANGLE_PLANE) {
    const double rest = at->kind == MS_ANGLE_STRAIGHT ? 0 : MS_PI;
    if (s->bend == rest) add_collinear_force(at, s->k, at->p, at->q, fi, fk);
    if (vp) add_collinear_force(at, s->damping, vp, vq, fi, fk);
    return;
  }
  if (vp) torque += s->damping * (ms_vec3_dot(at->grad[0], vp) + ms_vec3_dot(at->grad[1], vq));
  ms_vec3_axpy(-torque, at->grad[0], fi);
  ms_vec3_axpy(-torque, at->grad[1], fk);
}

/*------------------------------------- matrix ---------------------------------------------------*/

/* The index of element (r, c), r <= c, in an upper triangle by rows */
static int triangle(int r, int c) { return r * (5 - r) / 2 + c; }

/* The triangle += by (u v^T + v u^T)/2 */
static void add_symmetric(double by, const double u[3], const double v[3], double *to) {
  for (int r = 0; r < 3; r++)
    for (int c = r; c < 3; c++) to[triangle(r, c)] += by / 2 * (u[r] * v[c] + v[r] * u[c]);
}

static void add_outer(double by, const double u[3], const double v[3], double *to) {
  for (int r = 0; r < 3; r++)
    for (int c = 0; c < 3; c++) to[3 * r + c] += by * u[r] * v[c];
}

/* by (I - p p^T/a^2) of vp/a +- vq/b */
static void add_collinear(const ms_angle *at, double by, double *to) {
  const double sign = at->kind == MS_ANGLE_STRAIGHT ? 1 : -1;
  const double a2 = at->a2, b2 = at->b2, ab = sqrt(a2) * sqrt(b2);
  for (int r = 0; r < 3; r++)
    for (int c = 0; c < 3; c++) {
      const double across = by * ((r == c) - at->p[r] * at->p[c] / a2);
      if (r <= c) to[MS_ANGLE_P + triangle(r, c)] += across / a2;
      if (r <= c) to[MS_ANGLE_Q + triangle(r, c)] += across / b2;
      to[MS_ANGLE_R + 3 * r + c] += sign * across / ab;
    }
}

/* torque Hess phi */
static void add_curvature(const ms_angle *at, double torque, int clamp, double *to) {
  const double ab = sqrt(at->a2) * sqrt(at->b2), half = tan(at->phi / 2);
  double sum = torque / half / 2, difference = -torque * half / 2;
  if (clamp) sum = fmax(0, sum), difference = fmax(0, difference);
  add_symmetric((sum + difference) / at->a2, at->n, at->n, to + MS_ANGLE_P);
  add_symmetric((sum + difference) / at->b2, at->n, at->n, to + MS_ANGLE_Q);
  add_outer((sum - difference) / ab, at->n, at->n, to + MS_ANGLE_R);
  if (clamp) return;
  add_symmetric(-2 * torque / at->a2, at->p, at->grad[0], to + MS_ANGLE_P);
  add_symmetric(-2 * torque / at->b2, at->q, at->grad[1], to + MS_ANGLE_Q);
}

void ms_angle_matrix(const ms_angle *at, const ms_angle_spring *s, double h, int clamp,
                     double element[MS_ANGLE_ELEMENT]) {
  const double stiffness = h * h * s->k + h * s->damping;
  memset(element, 0, MS_ANGLE_ELEMENT * sizeof *element);
  if (at->kind == MS_ANGLE_NONE) return;
  if (at->kind != MS_ANGLE_PLANE) {
    add_collinear(at, stiffness, element);
    return;
  }
  add_symmetric(stiffness, at->grad[0], at->grad[0], element + MS_ANGLE_P);
  add_symmetric(stiffness, at->grad[1], at->grad[1], element + MS_ANGLE_Q);
  add_outer(stiffness, at->grad[0], at->grad[1], element + MS_ANGLE_R);
  add_curvature(at, h * h * s->k * (at->phi - s->bend), clamp, element);
}

/* x_i and x_k enter through p and q, x_j through both with the sign -. */
void ms_angle_block(const double element[MS_ANGLE_ELEMENT], int row, int column,
                    double block[3][3]) {
  static const double of_p[3] = {1, -1, 0}, of_q[3] = {0, -1, 1};
  const double *P = element + MS_ANGLE_P, *Q = element + MS_ANGLE_Q, *R = element + MS_ANGLE_R;
  const double pp = of_p[row] * of_p[column], qq = of_q[row] * of_q[column];
  const double pq = of_p[row] * of_q[column], qp = of_q[row] * of_p[column];
  for (int r = 0; r < 3; r++)
    for (int c = 0; c < 3; c++) {
      const int t = r <= c ? triangle(r, c) : triangle(c, r);
      block[r][c] = pp * P[t] + qq * Q[t] + (pq * R[3 * r + c] + qp * R[3 * c + r]);
    }
}
