#include "scene/collider_motions.h"

#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "scene/scene.h"

/*------------------------------------- placing --------------------------------------------------*/

/* Rodrigues' formula: with u = w/|w|, a = |w|,
 * R e_i = cos(a) e_i + sin(a) u x e_i + (1 - cos(a)) u_i u. */
void ms_collider_motion_rotate_axes(const double w[3], double axis[3][3]) {
  const double a = hypot(hypot(w[0], w[1]), w[2]), one_minus_cos = 2 * sin(a / 2) * sin(a / 2);
  double u[3] = {0};
  for (int c = 0; c < 3 && a > 0; c++) u[c] = w[c] / a;
  for (int i = 0; i < 3; i++) {
    const int j = (i + 1) % 3, k = (i + 2) % 3; /* u x e_i = u_k e_j - u_j e_k */
    for (int c = 0; c < 3; c++)
      axis[i][c] = (c == i) * (1 - one_minus_cos) + one_minus_cos * u[i] * u[c];
    axis[i][j] += sin(a) * u[k];
    axis[i][k] -= sin(a) * u[j];
  }
}

/* f = (1 - cos a)/a^2 and g = (a - sin a)/a^3, and f'/a and g'/a; near 0 by Taylor's series */
typedef struct spin_factors {
  double f, g, df, dg;
} spin_factors;

static spin_factors find_spin_factors(double a) {
  const double a2 = a * a, half = a > 0 ? sin(a / 2) / (a / 2) : 1;
  const int is_small = a < 0.1;
  return (spin_factors){.f = half * half / 2,
                        .g = a < 0.03 ? (1 - a2 / 20 * (1 - a2 / 42)) / 6 : (a - sin(a)) / (a2 * a),
                        .df = is_small ? -1. / 12 + a2 / 180 - a2 * a2 / 6720
                                       : (a * sin(a) - 2 * (1 - cos(a))) / (a2 * a2),
                        .dg = is_small ? -1. / 60 + a2 / 1260 - a2 * a2 / 60480
                                       : (3 * sin(a) - 2 * a - a * cos(a)) / (a2 * a2 * a)};
}

/* spin = w' + f w x w' + g w x (w x w'), and its derivative, in which a a' = w.w' */
static void set_spin(const double w[3], const double rate[3], const double rate2[3], ms_solid *to) {
  const spin_factors k = find_spin_factors(ms_vec3_norm(w));
  const double growth = ms_vec3_dot(w, rate);
  double once[3], twice[3], once2[3], twice2[3], between[3];
  ms_vec3_cross(w, rate, once), ms_vec3_cross(w, once, twice);
  ms_vec3_cross(w, rate2, once2), ms_vec3_cross(w, once2, twice2),
      ms_vec3_cross(rate, once, between);
  for (int c = 0; c < 3; c++) {
    to->spin[c] = rate[c] + k.f * once[c] + k.g * twice[c];
    to->spin_rate[c] = rate2[c] + k.f * once2[c] + k.g * (twice2[c] + between[c]) +
                       growth * (k.df * once[c] + k.dg * twice[c]);
  }
}

static void rotate_solid(const ms_solid *rest, const double w[3], ms_solid *to) {
  double axes[3][3];
  ms_collider_motion_rotate_axes(w, axes);
  for (int i = 0; i < 3; i++)
    for (int c = 0; c < 3; c++)
      to->axis[i][c] = rest->axis[i][0] * axes[0][c] + rest->axis[i][1] * axes[1][c] +
                       rest->axis[i][2] * axes[2][c];
}

const ms_solid *ms_collider_motion_place(const ms_scene *scene, int32_t i, ms_instant at,
                                         ms_solid *room) {
  const ms_solid *rest = &scene->solids[i];
  const ms_collider_motion *m = &scene->collider_motions[i];
  if (m->x.nt == 0) return rest;
  *room = *rest;
  ms_motion_evaluate(&m->x, 0, at, room->center, room->velocity);
  ms_motion_find_acceleration(&m->x, 0, at, room->acceleration);
  room->reach = rest->reach - ms_vec3_norm(rest->center) + ms_vec3_norm(room->center);
  if (m->rotation.nt == 0) return room;
  double w[3], rate[3], rate2[3];
  ms_motion_evaluate(&m->rotation, 0, at, w, rate);
  ms_motion_find_acceleration(&m->rotation, 0, at, rate2);
  rotate_solid(rest, w, room);
  set_spin(w, rate, rate2, room);
  return room;
}

void ms_collider_motion_get_pose(const ms_scene *scene, int32_t i, ms_instant at, double x[3],
                                 double rotation[3]) {
  const ms_collider_motion *m = &scene->collider_motions[i];
  double unused[3];
  for (int c = 0; c < 3; c++) x[c] = scene->solids[i].center[c], rotation[c] = 0;
  if (m->x.nt) ms_motion_evaluate(&m->x, 0, at, x, unused);
  if (m->rotation.nt) ms_motion_evaluate(&m->rotation, 0, at, rotation, unused);
}

int ms_collider_motion_is_there(const ms_scene *scene) {
  for (int32_t i = 0; i < scene->ncolliders; i++)
    if (scene->collider_motions[i].x.nt) return 1;
  return 0;
}

const ms_solid *ms_collider_motion_place_all(const ms_scene *scene, ms_instant at, ms_solid *room) {
  if (!ms_collider_motion_is_there(scene)) return scene->solids;
  for (int32_t i = 0; i < scene->ncolliders; i++) {
    const ms_solid *solid = ms_collider_motion_place(scene, i, at, &room[i]);
    if (solid != &room[i]) room[i] = *solid;
  }
  return room;
}

double ms_collider_motion_next_time(const ms_scene *scene, double t) {
  double next = INFINITY;
  for (int32_t i = 0; i < scene->ncolliders; i++)
    if (scene->collider_motions[i].x.nt)
      next = fmin(next, ms_motion_next_time(&scene->collider_motions[i].x, t));
  return next;
}

/*------------------------------------- storage --------------------------------------------------*/

void ms_collider_motion_free(const msim_allocator *alloc, ms_collider_motion *motion) {
  ms_motion_free(alloc, &motion->x);
  ms_motion_free(alloc, &motion->rotation);
}

msim_status ms_collider_motion_copy(const msim_allocator *alloc, const ms_collider_motion *from,
                                    ms_collider_motion *to, msim_error *err) {
  *to = (ms_collider_motion){0};
  msim_status status = from->x.nt ? ms_motion_copy(alloc, &from->x, &to->x, err) : MSIM_OK;
  if (!status && from->rotation.nt)
    status = ms_motion_copy(alloc, &from->rotation, &to->rotation, err);
  if (status) ms_collider_motion_free(alloc, to);
  return status;
}
