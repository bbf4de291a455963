#include "contact/path_surface.h"

#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "contact/moving_obstacles.h"
#include "physics/signed_distance.h"

/*------------------------------------- moving surfaces ------------------------------------------*/

int ms_path_surface_moves(const ms_path_progress *k) { return k->p->planes.moving != NULL; }

/* Places obstacles at the time t of the path. At its end, as they move before a motion changes
 * there, unless rounding leaves no time since it began, where it may have changed. */
static void place(const ms_path_progress *k, double t, int is_end) {
  const ms_particle_path *p = k->p;
  const int before = is_end && p->t + t > p->t + k->start;
  ms_moving_obstacles_place(&p->planes, (ms_instant){.t = p->t + t, .before = before});
}

void ms_path_surface_place(const ms_path_progress *k, double t, int is_end) {
  if (!ms_path_surface_moves(k)) return;
  place(k, t, is_end);
  ms_obstacles_touch(&k->p->planes, k->p->x);
}

void ms_path_surface_set_frame(ms_path_progress *k, const ms_plane_set *on) {
  if (ms_path_surface_moves(k))
    ms_moving_obstacles_find_velocity(&k->p->planes, on, k->p->x, k->frame);
}

void ms_path_surface_enter_frame(ms_path_progress *k, const ms_plane_set *on) {
  ms_particle_path *p = k->p;
  if (!ms_path_surface_moves(k)) return;
  ms_path_surface_set_frame(k, on);
  ms_vec3_axpy(-1, k->frame, p->v);
  ms_vec3_axpy(-1, k->frame, p->w);
}

void ms_path_surface_leave_frame(ms_path_progress *k) {
  if (!ms_path_surface_moves(k)) return;
  ms_vec3_axpy(1, k->frame, k->p->v);
  ms_vec3_axpy(1, k->frame, k->p->w);
  memset(k->frame, 0, sizeof k->frame);
}

void ms_path_surface_move(ms_path_progress *k, const ms_plane_set *on, const double dx[3],
                          double dt) {
  ms_particle_path *p = k->p;
  ms_poses poses;
  if (!ms_path_surface_moves(k)) {
    ms_vec3_axpy(1, dx, p->x);
    return;
  }
  ms_moving_obstacles_save_poses(&p->planes, on, &poses);
  place(k, k->t + dt, 1);
  ms_vec3_axpy(0.5, dx, p->x);
  for (int c = 0; c < 3; c++) k->displacement[c] = -p->x[c];
  ms_moving_obstacles_carry(&p->planes, on, &poses, p->x);
  ms_vec3_axpy(1, p->x, k->displacement);
  ms_vec3_axpy(0.5, dx, p->x);
  ms_obstacles_touch(&p->planes, p->x);
}

void ms_path_surface_make_relative(const ms_path_progress *k, const ms_plane_set *on,
                                   const double v[3], double a[3]) {
  const ms_particle_path *p = k->p;
  double A[3], of[3];
  if (!ms_path_surface_moves(k)) return;
  for (int c = 0; c < 3; c++) of[c] = v[c] + k->frame[c];
  ms_moving_obstacles_find_acceleration(&p->planes, on, p->x, of, A);
  ms_vec3_axpy(-1, A, a);
}

void ms_path_surface_find_least(const ms_path_progress *k, const ms_plane_set *on,
                                const double v[3], double *least) {
  const ms_particle_path *p = k->p;
  double of[3];
  for (int c = 0; c < 3; c++) of[c] = v[c] + k->frame[c];
  ms_obstacles_find_centripetal(&p->planes, on, p->x, of, least);
}

int ms_path_surface_is_beyond_edge(const ms_path_progress *k, const ms_solid *solid,
                                   const double dx[3]) {
  const ms_particle_path *p = k->p;
  return ms_obstacles_is_beyond_edge(solid, p->x, dx,
                                     2 * ms_impacts_distance_tolerance(&p->planes, p->x));
}

int ms_path_surface_holds(const ms_path_progress *k, const msim_plane *plane, const double dx[3],
                          double t) {
  const ms_particle_path *p = k->p;
  const ms_plane_set on = {1, {plane}};
  double least, y[3], unused[3];
  ms_path_surface_find_least(k, &on, p->v, &least);
  const double g = ms_vec3_dot(plane->normal, p->a) - least;
  for (int c = 0; c < 3; c++) y[c] = p->x[c] + dx[c] + g * t * t / 2 * plane->normal[c];
  const ms_solid *solid = ms_obstacles_get_solid(&p->planes, plane);
  return ms_signed_distance(solid, y, unused) <= ms_impacts_distance_tolerance(&p->planes, y);
}

double ms_path_surface_time_to_release(const ms_path_progress *k, double left) {
  const double LATER = 1e-9; /* of the time left: then they separate clearly */
  const ms_particle_path *p = k->p;
  const ms_plane_set *on = &k->contact;
  if (!ms_path_surface_moves(k) || on->n != 1) return left;
  const double none[3] = {0};
  double least[2][MS_MAX_TOUCHED_PLANES], g[2];
  ms_path_progress later = *k;
  ms_particle_path moved = *p;
  later.p = &moved;
  for (int end = 0; end < 2; end++) {
    if (end) ms_path_surface_move(&later, on, none, left), ms_path_surface_set_frame(&later, on);
    ms_path_surface_find_least(&later, on, p->v, least[end]);
    g[end] = ms_vec3_dot(on->plane[0]->normal, p->a) - least[end][0];
  }
  ms_path_surface_place(k, k->t, 0);
  if (!(g[0] < 0 && g[1] > 0)) return left;
  return fmin(left, left * (g[0] / (g[0] - g[1]) + LATER));
}

/* How much the acceleration of the surface of a solid at x changes in the time left */
static double find_change(const ms_path_progress *k, const ms_solid *solid, double left) {
  const ms_particle_path *p = k->p;
  const ms_instant end = {.t = p->t + k->t + left, .before = 1};
  ms_solid room;
  double A[2][3], of[3];
  const ms_solid *later =
      ms_moving_obstacles_get(&p->planes, (int32_t)(solid - p->planes.solid), end, &room);
  for (int c = 0; c < 3; c++) of[c] = p->v[c] + k->frame[c];
  ms_moving_obstacles_find_point_acceleration(solid, p->x, of, A[0]);
  ms_moving_obstacles_find_point_acceleration(later, p->x, of, A[1]);
  ms_vec3_axpy(-1, A[0], A[1]);
  return ms_vec3_norm(A[1]);
}

double ms_path_surface_limit_motion(const ms_path_progress *k, double left) {
  const ms_particle_path *p = k->p;
  for (int i = 0; i < k->contact.n && ms_path_surface_moves(k); i++) {
    const ms_solid *solid = ms_obstacles_get_solid(&p->planes, k->contact.plane[i]);
    const double spin = solid ? ms_vec3_norm(solid->spin) : 0;
    if (spin * left > k->turn) left = k->turn / spin;
    while (solid && find_change(k, solid, left) * left * p->h / 12 > p->x_error) left /= 2;
  }
  return left;
}

/* Rotate u as the rotation that takes the unit vector n to m along the shortest way. */
static void rotate(const double n[3], const double m[3], double u[3]) {
  double sum[3];
  for (int c = 0; c < 3; c++) sum[c] = n[c] + m[c];
  const double normal = ms_vec3_dot(n, u), f = ms_vec3_dot(sum, u) / (1 + ms_vec3_dot(n, m));
  for (int c = 0; c < 3; c++) u[c] += 2 * normal * m[c] - f * sum[c];
}

/* Project u, which is parallel to the planes of `on` up to small angles, and keep its length. */
static void turn_along(const ms_plane_set *on, double u[3]) {
  const double MOSTLY = 0.9, before = ms_vec3_norm(u);
  ms_impacts_remove_normal(on, u, NULL);
  const double after = ms_vec3_norm(u);
  for (int c = 0; c < 3 && after > MOSTLY * before; c++) u[c] *= before / after;
}

/* Scale u by the work of a force over mass on a particle that is moved: |u|^2 += 2 work. */
static void add_work_to(double work, double u[3]) {
  const double before = ms_vec3_dot(u, u), ratio = before > 0 ? 1 + 2 * work / before : 0;
  for (int c = 0; c < 3; c++) u[c] *= sqrt(fmax(0, ratio));
}

/* Where samples bend the surface in a crease, moving x onto it, from `before`, does work against
 * the acceleration of the particle, by which v and w change. */
static void keep_energy(ms_path_progress *k, const ms_plane_set *on, const double before[3]) {
  ms_particle_path *p = k->p;
  const ms_solid *solid = ms_obstacles_get_solid(&p->planes, on->plane[0]);
  double a[3] = {p->a[0], p->a[1], p->a[2]}, work = 0;
  if (on->n != 1 || !solid || !solid->samples) return;
  ms_path_surface_make_relative(k, on, p->v, a);
  for (int c = 0; c < 3; c++) work += a[c] * (p->x[c] - before[c]);
  add_work_to(work, p->v);
  add_work_to(work, p->w);
}

void ms_path_surface_follow(ms_path_progress *k, const ms_plane_set *on, const double n[3]) {
  ms_particle_path *p = k->p;
  if (!p->planes.nsolids) {
    ms_impacts_move_onto(on, p->x);
    return;
  }
  const double before[3] = {p->x[0], p->x[1], p->x[2]};
  ms_obstacles_touch(&p->planes, p->x);
  ms_obstacles_move_onto(&p->planes, on, p->x);
  keep_energy(k, on, before);
  if (on->n == 1 && ms_vec3_dot(n, on->plane[0]->normal) < MS_PATH_SHARP_COSINE) { /* of samples */
    ms_impacts_remove_normal(on, p->v, NULL);
    ms_impacts_remove_normal(on, p->w, NULL);
  } else if (on->n == 1) {
    rotate(n, on->plane[0]->normal, p->v);
    rotate(n, on->plane[0]->normal, p->w);
  } else {
    turn_along(on, p->v);
    turn_along(on, p->w);
  }
}

void ms_path_surface_add_work(ms_path_progress *k, const double before[3], const double from[3],
                              double dt) {
  ms_particle_path *p = k->p;
  double first[3], last[3];
  if (!ms_path_surface_moves(k)) return;
  ms_path_progress_acceleration(p, k->t, first);
  ms_path_progress_acceleration(p, k->t + dt, last);
  for (int c = 0; c < 3; c++) {
    const double faster = k->frame[c] - from[c],
                 impulse = p->w[c] - before[c] - dt * (first[c] + last[c]) / 2;
    p->work +=
        faster * (k->frame[c] + from[c]) / 2 + (dt > 0 ? impulse * k->displacement[c] / dt : 0);
  }
}
