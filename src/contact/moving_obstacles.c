#include "contact/moving_obstacles.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/vec3.h"
#include "physics/signed_distance.h"

/*------------------------------------- placing --------------------------------------------------*/

static int32_t get_collider(const ms_collision_planes *planes, int32_t i) {
  const ms_obstacles *o = planes->moving;
  return o->number[o->nplanes + i] - planes->scene->nplanes;
}

/* Solid i is a collider or, with a face +-(k + 1), the half-space beyond its faces along axis k. */
static void place_solid(const ms_collision_planes *planes, int32_t i, ms_instant at, ms_solid *to) {
  ms_solid room;
  const ms_solid *from =
      ms_collider_motion_place(planes->scene, get_collider(planes, i), at, &room);
  const int32_t face = planes->moving->face[i];
  const ms_solid own = planes->solid[i];
  *to = *from;
  to->type = own.type, to->inside = own.inside;
  memcpy(to->half, own.half, sizeof to->half);
  for (int c = 0; c < 3 && face; c++)
    to->axis[2][c] = (face > 0 ? -1 : 1) * from->axis[abs(face) - 1][c];
}

int ms_moving_obstacles_moves(const ms_collision_planes *planes, int32_t i) {
  return planes->moving && planes->scene->collider_motions[get_collider(planes, i)].x.nt > 0;
}

void ms_moving_obstacles_place(const ms_collision_planes *planes, ms_instant at) {
  ms_obstacles *o = planes->moving;
  if (!o || (at.t == o->now.t && at.before == o->now.before)) return;
  for (int32_t i = 0; i < o->nsolids; i++)
    if (ms_moving_obstacles_moves(planes, i)) place_solid(planes, i, at, &o->solid[i]);
  o->now = at;
}

const ms_solid *ms_moving_obstacles_get(const ms_collision_planes *planes, int32_t i, ms_instant at,
                                        ms_solid *room) {
  if (!ms_moving_obstacles_moves(planes, i)) return &planes->solid[i];
  place_solid(planes, i, at, room);
  return room;
}

double ms_moving_obstacles_next_time(const ms_collision_planes *planes, double t) {
  return planes->moving ? ms_collider_motion_next_time(planes->scene, t) : INFINITY;
}

/*------------------------------------- the frame of a contact -----------------------------------*/

static void add_cross(const double a[3], const double b[3], double to[3]) {
  for (int c = 0; c < 3; c++)
    to[c] += a[(c + 1) % 3] * b[(c + 2) % 3] - a[(c + 2) % 3] * b[(c + 1) % 3];
}

void ms_moving_obstacles_find_point_acceleration(const ms_solid *s, const double x[3],
                                                 const double v[3], double a[3]) {
  double r[3], w[3];
  for (int c = 0; c < 3; c++) r[c] = x[c] - s->center[c], w[c] = v[c] - s->velocity[c];
  memcpy(a, s->acceleration, sizeof s->acceleration);
  add_cross(s->spin_rate, r, a);
  add_cross(s->spin, w, a);
}

void ms_moving_obstacles_combine(const ms_plane_set *on, double of[][3], double u[3]) {
  double to[MS_MAX_TOUCHED_PLANES], J[MS_MAX_INDEPENDENT_PLANES];
  memset(u, 0, 3 * sizeof *u);
  for (int i = 0; i < on->n; i++) {
    to[i] = ms_vec3_dot(on->plane[i]->normal, of[i]);
    ms_vec3_axpy(1, of[i], u);
  }
  for (int c = 0; c < 3 && on->n > 1; c++) u[c] /= on->n;
  if (on->n > 1) ms_impacts_set_normal_components(on, to, u, J);
}

void ms_moving_obstacles_find_velocity(const ms_collision_planes *planes, const ms_plane_set *on,
                                       const double x[3], double u[3]) {
  double of[MS_MAX_TOUCHED_PLANES][3] = {0};
  for (int i = 0; i < on->n; i++) {
    const ms_solid *solid = ms_obstacles_get_solid(planes, on->plane[i]);
    if (solid) ms_signed_distance_find_velocity(solid, x, of[i]);
  }
  ms_moving_obstacles_combine(on, of, u);
}

void ms_moving_obstacles_find_acceleration(const ms_collision_planes *planes,
                                           const ms_plane_set *on, const double x[3],
                                           const double v[3], double a[3]) {
  double of[MS_MAX_TOUCHED_PLANES][3] = {0};
  for (int i = 0; i < on->n; i++) {
    const ms_solid *solid = ms_obstacles_get_solid(planes, on->plane[i]);
    if (solid) ms_moving_obstacles_find_point_acceleration(solid, x, v, of[i]);
  }
  ms_moving_obstacles_combine(on, of, a);
}

double ms_moving_obstacles_find_normal_acceleration(const ms_solid *solid, const double n[3],
                                                    const double x[3], const double v[3]) {
  double u[3], a[3], turn[3] = {0};
  ms_signed_distance_find_velocity(solid, x, u);
  for (int c = 0; c < 3; c++) u[c] = v[c] - u[c];
  ms_moving_obstacles_find_point_acceleration(solid, x, v, a);
  add_cross(solid->spin, n, turn);
  return ms_vec3_dot(n, a) - ms_vec3_dot(turn, u) - ms_signed_distance_bend(solid, x, u);
}

void ms_moving_obstacles_set_frame(const ms_collision_planes *planes, const ms_plane_set *on,
                                   const double x[3], const double v[3], double h,
                                   ms_contact_frame *frame) {
  *frame = (ms_contact_frame){0};
  for (int i = 0; i < on->n; i++) {
    const ms_solid *solid = ms_obstacles_get_solid(planes, on->plane[i]);
    frame->moves |= solid && ms_moving_obstacles_moves(planes, (int32_t)(solid - planes->solid));
  }
  if (!frame->moves) return;
  ms_moving_obstacles_find_velocity(planes, on, x, frame->velocity);
  ms_moving_obstacles_find_acceleration(planes, on, x, v, frame->acceleration);
  for (int c = 0; c < 3; c++) {
    frame->displacement[c] = h * (frame->velocity[c] + h * frame->acceleration[c] / 2);
    frame->end[c] = frame->velocity[c] + h * frame->acceleration[c];
  }
}

/*------------------------------------- displacements --------------------------------------------*/

double ms_moving_obstacles_bound_displacement(const ms_collision_planes *planes, int32_t i,
                                              const double x[3], double distance, double time) {
  if (!planes->moving) return 0;
  const ms_solid_bounds *b = &planes->moving->bounds[i];
  double r[3];
  for (int c = 0; c < 3; c++) r[c] = x[c] - planes->solid[i].center[c];
  const double reach = ms_vec3_norm(r) + distance + b->speed * time;
  return time * (b->speed + (b->spin > 0 ? b->spin * reach : 0));
}

void ms_moving_obstacles_save_poses(const ms_collision_planes *planes, const ms_plane_set *on,
                                    ms_poses *poses) {
  poses->n = on->n;
  for (int i = 0; i < on->n; i++) {
    const ms_solid *solid = ms_obstacles_get_solid(planes, on->plane[i]);
    if (solid) poses->solid[i] = *solid;
  }
}

void ms_moving_obstacles_add_displacement(const ms_solid *from, const ms_solid *to,
                                          const double x[3], double displacement[3]) {
  double r[3];
  for (int c = 0; c < 3; c++) r[c] = x[c] - from->center[c];
  for (int c = 0; c < 3; c++) {
    displacement[c] += to->center[c] - from->center[c];
    for (int k = 0; k < 3; k++)
      displacement[c] += (to->axis[k][c] - from->axis[k][c]) * ms_vec3_dot(from->axis[k], r);
  }
}

void ms_moving_obstacles_carry(const ms_collision_planes *planes, const ms_plane_set *on,
                               const ms_poses *poses, double x[3]) {
  double sum[3] = {0};
  for (int i = 0; i < poses->n; i++) {
    const ms_solid *now = ms_obstacles_get_solid(planes, on->plane[i]);
    if (now) ms_moving_obstacles_add_displacement(&poses->solid[i], now, x, sum);
  }
  for (int c = 0; c < 3 && poses->n; c++) x[c] += sum[c] / poses->n;
}
