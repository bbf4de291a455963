#include "contact/path_bounces.h"

#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "contact/friction.h"
#include "contact/moving_obstacles.h"
#include "contact/path_surface.h"
#include "physics/signed_distance.h"

/* Bounces on one plane: number, INFINITY until rest; duration, s; final normal speed over the
 * initial one. */
typedef struct bounce_series {
  double number, time, speed_ratio;
} bounce_series;

/* The bounces that end within the time left, the first of normal speed u */
static bounce_series sum_bounces(double e, double u, double g, double left) {
  const double period = 2 * u / g, m = left / period;
  if (e == 1) return (bounce_series){floor(m), period * floor(m), 1};
  if (m * (1 - e) >= 1) return (bounce_series){INFINITY, period / (1 - e), 0};
  const double number = e > 0 ? floor(log1p(-m * (1 - e)) / log(e)) : 0, kept = pow(e, number);
  return (bounce_series){number, period * (1 - kept) / (1 - e), kept};
}

/* The particle cannot reach another plane within that time. */
static int is_far_from_others(const ms_path_progress *k, const msim_plane *plane, double time) {
  const ms_particle_path *p = k->p;
  const double reach =
      time * (ms_vec3_norm(p->v) + ms_vec3_norm(k->frame) + time * ms_vec3_norm(p->a));
  const msim_plane *tangents = p->planes.plane + p->planes.n - p->planes.nsolids;
  for (const msim_plane *q = p->planes.plane; q < p->planes.plane + p->planes.n; q++) {
    const double displacement = q < tangents
                                    ? 0
                                    : ms_moving_obstacles_bound_displacement(
                                          &p->planes, (int32_t)(q - tangents), p->x, reach, time);
    const double distance = ms_impacts_distance(q, p->x);
    const double least =
        q < tangents ? distance
                     : ms_obstacles_bound_distance(&p->planes.solid[q - tangents], distance);
    if (q != plane && least <= reach + displacement) return 0;
  }
  return 1;
}

/* Tangential motion by b during bounces, with the friction of the mean normal force over mass,
 * g (1 + e)/2; the normal velocity is scaled by `kept`. Bounce k lasts 2 u_k/g, u_k = e^k u, and
 * reduces the speed by mu (1 + e) u_k at its end, the mean force gradually: the displacement is
 * larger by half the product of both, in total by mu (u^2/g) (1 - e^2m)/(1 - e). */
static void move_while_bouncing(const msim_plane *q, const double b[3], const bounce_series *s,
                                double v[3], double dx[3]) {
  const double *n = q->normal, u = ms_vec3_dot(n, v), g = ms_vec3_dot(n, b);
  double along[3] = {b[0], b[1], b[2]};
  ms_vec3_axpy(-g, n, along);
  ms_vec3_axpy(-u, n, v);
  ms_friction_slide(along, q->friction * fmax(0, -g) * (1 + q->restitution) / 2, s->time, v, dx);
  const double speed = ms_vec3_norm(v), e = q->restitution;
  const double flights = e < 1 ? (1 - s->speed_ratio * s->speed_ratio) / (1 - e) : 2 * s->number;
  if (speed > 0 && g < 0) ms_vec3_axpy(q->friction * u * u / -g * flights / speed, v, dx);
  ms_vec3_axpy(s->speed_ratio * fmax(0, u), n, v);
}

/* The bounces to be summed, if they come to rest in the time left or are short; number 0: none. */
static bounce_series find_bounce_series(const msim_plane *q, const double v[3], const double a[3],
                                        double h, double left) {
  const double SHORT = 1. / 64; /* duration of a short bounce over the step */
  const double u = ms_vec3_dot(q->normal, v), g = -ms_vec3_dot(q->normal, a);
  if (!(g > 0) || !(u > 0)) return (bounce_series){0};
  const bounce_series s = sum_bounces(q->restitution, u, g, left);
  return s.number >= 1 && (s.speed_ratio == 0 || 2 * u < SHORT * h * g) ? s : (bounce_series){0};
}

/* 1: the height of the bounces and the displacement by their friction are at most `reach`. */
static int reaches_little(const msim_plane *q, const double v[3], const double a[3], double reach) {
  const double u = ms_vec3_dot(q->normal, v), g = -ms_vec3_dot(q->normal, a);
  return u * u * fmax(0.5, 2 * q->friction * (1 + q->restitution)) <= g * reach;
}

double ms_path_bounces_find_rest_speed(const ms_collision_planes *planes,
                                       const ms_plane_set *touched, const double x[3], double pull,
                                       double reach) {
  const double LITTLE = 1e-3;
  if (touched->n < 2) return 0;
  return sqrt(2 * pull * LITTLE * fmin(reach, ms_impacts_distance_tolerance(planes, x)));
}

int ms_path_bounces_are_summed(const msim_plane *plane, const double v[3], const double a[3],
                               double h, double reach) {
  return find_bounce_series(plane, v, a, h, h).number > 0 && reaches_little(plane, v, a, reach);
}

/* Makes a relative to a curved or moving surface, of a particle with the relative velocity v. */
static void add_bend(const ms_path_progress *k, const msim_plane *q, const double v[3],
                     double a[3]) {
  const ms_solid *solid = ms_obstacles_get_solid(&k->p->planes, q);
  const ms_plane_set on = {1, {q}};
  double least;
  if (!solid) return;
  if (!ms_path_surface_moves(k)) {
    ms_vec3_axpy(ms_signed_distance_bend(solid, k->p->x, v), q->normal, a);
    return;
  }
  ms_path_surface_find_least(k, &on, v, &least);
  const double g = ms_vec3_dot(q->normal, a) - least;
  ms_path_surface_make_relative(k, &on, v, a);
  ms_vec3_axpy(g - ms_vec3_dot(q->normal, a), q->normal, a);
}

/* 1 if the acceleration of the surface of q changes little within `time`, and stays the same in a
 * motion that does not end before */
static int is_nearly_steady(const ms_path_progress *k, const msim_plane *q, double time, double g) {
  const ms_particle_path *p = k->p;
  const ms_solid *now = ms_obstacles_get_solid(&p->planes, q);
  ms_solid room;
  double change[3];
  if (!ms_path_surface_moves(k) || !now) return 1;
  const ms_instant at = {.t = p->t + k->t + time, .before = 1};
  const ms_solid *later =
      ms_moving_obstacles_get(&p->planes, (int32_t)(now - p->planes.solid), at, &room);
  for (int c = 0; c < 3; c++) change[c] = later->acceleration[c] - now->acceleration[c];
  return ms_vec3_norm(change) <= k->turn * g && ms_vec3_norm(now->spin) * time <= k->turn;
}

/* 1 if the surface of q deviates little from its tangent plane over dx, and has no edge there */
static int is_nearly_flat(const ms_path_progress *k, const msim_plane *q, const double dx[3]) {
  const ms_solid *solid = ms_obstacles_get_solid(&k->p->planes, q);
  if (!solid) return 1;
  const double bend = fabs(ms_signed_distance_bend(solid, k->p->x, dx));
  return bend <= k->turn * ms_vec3_norm(dx) &&
         ms_vec3_norm(dx) <= MS_PATH_SHARE_OF_CELL * ms_obstacles_find_cell(solid) &&
         !ms_path_surface_is_beyond_edge(k, solid, dx);
}

void ms_path_bounces_sum(ms_path_progress *k, const msim_plane *q) {
  ms_particle_path *p = k->p;
  double middle[3], a[3] = {p->a[0], p->a[1], p->a[2]}, dx[3], unused[3], v[3], w[3];
  memcpy(v, p->v, sizeof v), memcpy(w, p->w, sizeof w);
  add_bend(k, q, v, a);
  if (q->friction > 0 && !reaches_little(q, v, a, p->bounce_reach)) return;
  const bounce_series s = find_bounce_series(q, v, a, p->h, k->end - k->t);
  if (s.number < 1 || !is_far_from_others(k, q, s.time)) return;
  if (!is_nearly_steady(k, q, s.time, -ms_vec3_dot(q->normal, a))) return;
  ms_path_progress_acceleration(p, k->t + s.time / 2, middle);
  add_bend(k, q, w, middle);
  move_while_bouncing(q, middle, &s, w, unused);
  move_while_bouncing(q, a, &s, v, dx);
  if (!is_nearly_flat(k, q, dx)) return;
  const ms_plane_set on = {1, {q}};
  double n[3], before[3], from[3];
  memcpy(n, q->normal, sizeof n);
  memcpy(before, p->w, sizeof before), memcpy(from, k->frame, sizeof from);
  memcpy(p->v, v, sizeof v), memcpy(p->w, w, sizeof w);
  ms_path_surface_move(k, &on, dx, s.time);
  ms_path_surface_follow(k, &on, n);
  ms_path_surface_set_frame(k, &on);
  ms_path_surface_add_work(k, before, from, s.time);
  k->t += s.time;
  p->impacts += isinf(s.number) ? 1 : (int64_t)s.number;
}
