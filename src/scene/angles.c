#include "scene/angles.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/vec3.h"

/*------------------------------------- geometry -------------------------------------------------*/

void ms_scene_angles_get_edges(const ms_scene *s, const int32_t ijk[3], double p[3], double q[3]) {
  const double *i = s->x + 3 * (size_t)ijk[0], *j = s->x + 3 * (size_t)ijk[1],
               *k = s->x + 3 * (size_t)ijk[2];
  for (int c = 0; c < 3; c++) p[c] = i[c] - j[c], q[c] = k[c] - j[c];
}

double ms_scene_angles_measure(const double *const at[3]) {
  double p[3], q[3], farthest = 0;
  for (int c = 0; c < 3; c++) p[c] = at[0][c] - at[1][c], q[c] = at[2][c] - at[1][c];
  for (int c = 0; c < 9; c++) farthest = fmax(farthest, fabs(at[c / 3][c % 3]));
  const double a = ms_vec3_norm(p), b = ms_vec3_norm(q);
  if (!(a > 0 && b > 0)) return NAN;
  const double w[3] = {p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2],
                       p[0] * q[1] - p[1] * q[0]};
  const double across = ms_vec3_norm(w), along = ms_vec3_dot(p, q);
  const double rounding = 4 * DBL_EPSILON * farthest * (a + b);
  return along < 0 && across <= rounding ? MS_PI : atan2(across, along);
}

static double measure_angle(const ms_scene *s, const int32_t ijk[3]) {
  const double *const at[3] = {s->x + 3 * (size_t)ijk[0], s->x + 3 * (size_t)ijk[1],
                               s->x + 3 * (size_t)ijk[2]};
  return ms_scene_angles_measure(at);
}

void ms_scene_angles_weigh(const ms_scene *scene, int32_t angle, double weight[2]) {
  const ms_scene_angles *g = &scene->angles;
  const int32_t *ijk = g->ijk + 3 * (size_t)angle;
  double p[3], q[3];
  ms_scene_angles_get_edges(scene, ijk, p, q);
  const double a = ms_vec3_norm(p), b = ms_vec3_norm(q);
  weight[0] = weight[1] = 0;
  if (!(a > 0 && b > 0)) return;
  const double by =
      (1 / a + 1 / b) * (1 + fabs(measure_angle(scene, ijk) - g->rest[(size_t)angle]));
  weight[0] = by / a, weight[1] = by / b;
}

/*------------------------------------- memory ---------------------------------------------------*/

static int reserve_angles(ms_scene *s, int64_t needed, msim_error *err) {
  ms_scene_angles *g = &s->angles;
  const ms_array arrays[] = {
      {&g->ijk, 3 * sizeof *g->ijk}, MS_ARRAY(g->k), MS_ARRAY(g->rest), MS_ARRAY(g->damping)};
  return ms_scene_reserve(s, arrays, 4, g->n, &g->capacity, needed, err);
}

msim_status ms_scene_angles_append(ms_scene *s, int32_t n, const int32_t *ijk, const double *k,
                                   const double *rest, const double *damping, msim_error *err) {
  ms_scene_angles *g = &s->angles;
  if (!reserve_angles(s, (int64_t)g->n + n, err)) return MSIM_ERR_MEMORY;
  const size_t at = (size_t)g->n;
  memcpy(g->ijk + 3 * at, ijk, 3 * (size_t)n * sizeof *ijk);
  memcpy(g->k + at, k, (size_t)n * sizeof *k);
  for (size_t e = 0; e < (size_t)n; e++) {
    g->rest[at + e] = rest ? rest[e] : measure_angle(s, ijk + 3 * e);
    g->damping[at + e] = damping ? damping[e] : 0;
  }
  g->n += n;
  return MSIM_OK;
}

int ms_scene_angles_copy(const ms_scene *from, ms_scene *to) {
  const ms_scene_angles *g = &from->angles;
  return g->n == 0 || !ms_scene_angles_append(to, g->n, g->ijk, g->k, g->rest, g->damping, NULL);
}

void ms_scene_angles_free(ms_scene *s) {
  MS_FREE(&s->alloc, s->angles.ijk, s->angles.k, s->angles.rest, s->angles.damping);
}
