#include "contact/path_impact.h"

#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "contact/impact_time.h"
#include "contact/moving_obstacles.h"
#include "contact/path_surface.h"
#include "physics/signed_distance.h"

/*------------------------------------- the next impact ------------------------------------------*/

/* A normal acceleration of a particle that touches a surface, 0 if it is but a rounding error: else
 * a particle that slides along the surface, not pressed, would hit it again and again. */
static double round_acceleration(const ms_path_progress *k, double g, double left) {
  return fabs(g) * left > k->tolerance ? g : 0;
}

/* When s + u t + g t^2/2 falls below 0; INFINITY: never. touches: s counts as 0. */
static double time_to_plane(const ms_path_progress *k, double s, double u, double g, double left,
                            int touches) {
  if (!touches) return ms_impact_time_to_plane(s, u, g);
  if (u < -k->tolerance) return 0;
  return round_acceleration(k, g, left) < 0 ? fmax(0, -2 * u / g) : INFINITY;
}

/* When a particle that touches a surface, with s = u t + g t^2/2, u >= 0, is twice the tolerance
 * away from it, or turns back */
static double time_to_leave(double u, double g, double left, double tolerance) {
  const double SOON = 1. / 16; /* of the time left: if hardly anything moves it */
  const double by_speed = 4 * tolerance / u, by_force = sqrt(4 * tolerance / fabs(g));
  return g < 0 ? fmin(by_speed, -u / g) : fmin(SOON * left, fmin(by_speed, by_force));
}

/* The same for solid i, from x with v and a. A particle that touches it first leaves it. */
static double time_to_solid(const ms_path_progress *k, int32_t i, const double v[3],
                            const double a[3], double left, double tolerance) {
  const ms_particle_path *p = k->p;
  const ms_solid *solid = &p->planes.solid[i];
  const msim_plane *q = &p->planes.tangent[i];
  const ms_parabola parabola = {.planes = &p->planes, .t = p->t + k->t, .x = p->x, .v = v, .a = a};
  if (ms_impacts_distance(q, p->x) > tolerance)
    return ms_impact_time_find(&parabola, i, 0, left, tolerance);
  double u = ms_vec3_dot(q->normal, v),
         g = ms_vec3_dot(q->normal, a) + ms_signed_distance_bend(solid, p->x, v);
  if (ms_path_surface_moves(k)) {
    double of[3];
    ms_signed_distance_find_velocity(solid, p->x, of);
    u -= ms_vec3_dot(q->normal, of);
    g = ms_vec3_dot(q->normal, a) -
        ms_moving_obstacles_find_normal_acceleration(solid, q->normal, p->x, v);
  }
  if (u < -k->tolerance) return 0;
  g = round_acceleration(k, g, left);
  double from = time_to_leave(fmax(0, u), g, left, tolerance);
  double when = ms_impact_time_find(&parabola, i, from, left, tolerance);
  while (g >= 0 && when == from && from > 0 &&
         !ms_impact_time_is_inside(&parabola, i, from, tolerance)) {
    from *= 2;
    when = ms_impact_time_find(&parabola, i, from, left, tolerance);
  }
  return when;
}

const msim_plane *ms_path_impact_find(const ms_path_progress *k, const double v[3],
                                      const double a[3], double left, double *when) {
  const ms_collision_planes *planes = &k->p->planes;
  const double tolerance = ms_impacts_distance_tolerance(planes, k->p->x);
  const msim_plane *first = NULL;
  *when = left;
  const msim_plane *tangents = planes->plane + planes->n - planes->nsolids;
  for (const msim_plane *q = planes->plane; q < tangents; q++) {
    if (ms_impacts_contains_plane(&k->contact, q)) continue;
    const double s = ms_impacts_distance(q, k->p->x), *n = q->normal;
    const double t =
        time_to_plane(k, s, ms_vec3_dot(n, v), ms_vec3_dot(n, a), left, s <= tolerance);
    if (t < *when) *when = t, first = q;
  }
  for (int32_t i = 0; i < planes->nsolids; i++) {
    if (ms_impacts_contains_plane(&k->contact, &tangents[i])) continue;
    const double t = time_to_solid(k, i, v, a, *when, tolerance);
    if (t < *when) *when = t, first = &tangents[i];
  }
  return first;
}

const msim_plane *ms_path_impact_find_in_frame(const ms_path_progress *k, const double bend[3],
                                               double left, double *when) {
  const ms_particle_path *p = k->p;
  double v[3], a[3] = {bend[0], bend[1], bend[2]}, A[3] = {0};
  for (int c = 0; c < 3; c++) v[c] = p->v[c] + k->frame[c];
  if (ms_path_surface_moves(k))
    ms_moving_obstacles_find_acceleration(&p->planes, &k->contact, p->x, v, A);
  ms_vec3_axpy(1, A, a);
  return ms_path_impact_find(k, v, a, left, when);
}
