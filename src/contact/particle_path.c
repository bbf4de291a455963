#include "contact/particle_path.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "contact/friction.h"
#include "contact/obstacles.h"
#include "physics/signed_distance.h"

/* Progress of the particle in the step. */
typedef struct path_progress {
  ms_particle_path *p;
  double t;
  ms_plane_set contact; /* the planes that it rests on or slides along */
  double tolerance;     /* rounding tolerance of a velocity */
  int stalled;          /* consecutive impacts at most 1e-6 h apart */
  int is_partial; /* the last part of the path ended before an impact or the end of the step */
} path_progress;

/* rad: normals of curved surfaces turn by less in a part of the path on their tangent planes */
#define SMALL_ANGLE 0.125

static void acceleration_at(const ms_particle_path *p, double t, double b[3]) {
  for (int c = 0; c < 3; c++) b[c] = p->b0[c] + (p->b1[c] - p->b0[c]) * (t / p->h);
}

/*------------------------------------- contact --------------------------------------------------*/

/* The planes in contact that a presses on at the velocity v; a becomes its part along them. */
static ms_plane_set press(const path_progress *k, const double v[3], double a[3],
                          double *friction) {
  const ms_particle_path *p = k->p;
  if (!p->planes.nsolids) return ms_impacts_remove_pressing(&k->contact, 0, a, friction);
  double least[MS_MAX_TOUCHED_PLANES], size = ms_vec3_norm(a);
  ms_obstacles_find_centripetal(&p->planes, &k->contact, p->x, v, least);
  const ms_plane_set pressed = ms_impacts_raise_pressing(&k->contact, least, 0, a, friction);
  for (int i = 0; i < k->contact.n; i++) size += fabs(least[i]);
  ms_impacts_remove_normal(&pressed, a, NULL);
  if (ms_vec3_norm(a) <= 16 * DBL_EPSILON * size) memset(a, 0, 3 * sizeof *a);
  return pressed;
}

/* Advance v by dt at the constant a, in contact. On curved surfaces friction depends on the speed:
 * that in the middle of dt, for order 2. */
static void kick_in_contact(const path_progress *k, const double a[3], double dt, double v[3]) {
  double along[3] = {a[0], a[1], a[2]}, friction;
  ms_plane_set pressed = press(k, v, along, &friction);
  if (k->p->planes.nsolids) {
    double middle[3] = {v[0], v[1], v[2]};
    ms_friction_slide(along, friction, dt / 2, middle, NULL);
    memcpy(along, a, sizeof along);
    pressed = press(k, middle, along, &friction);
  }
  ms_impacts_remove_normal(&pressed, v, NULL);
  ms_friction_slide(along, friction, dt, v, NULL);
}

/* Advance w by half of a part of the path, with the acceleration b at that end of the part. Returns
 * the normal acceleration relative to the surface, if there is one plane. */
static double kick_w_in_contact(path_progress *k, double t, double half) {
  const ms_plane_set *on = &k->contact;
  double b[3], least[MS_MAX_TOUCHED_PLANES] = {0};
  acceleration_at(k->p, t, b);
  kick_in_contact(k, b, half, k->p->w);
  if (on->n != 1) return 0;
  if (k->p->planes.nsolids)
    ms_obstacles_find_centripetal(&k->p->planes, on, k->p->x, k->p->w, least);
  return ms_vec3_dot(on->plane[0]->normal, b) - least[0];
}

/* If the normal acceleration becomes positive, from g0 to g1, w_n is the integral of its positive
 * part. */
static void release_w(path_progress *k, double g0, double g1, double dt) {
  double *w = k->p->w;
  if (!(g0 < 0 && g1 > 0)) return;
  const double *n = k->contact.plane[0]->normal;
  ms_vec3_axpy(g1 * g1 / (g1 - g0) * dt / 2 - ms_vec3_dot(n, w), n, w);
}

/*------------------------------------- the next impact ------------------------------------------*/

/* When s + u t + g t^2/2 falls below 0; INFINITY: never. touches: s counts as 0. */
static double time_to_plane(double s, double u, double g, int touches, double tolerance) {
  if (touches) return u < -tolerance ? 0 : g < 0 ? fmax(0, -2 * u / g) : INFINITY;
  return ms_obstacles_time_to_plane(s, u, g);
}

/* When a particle that touches a surface, with s = u t + g t^2/2, u >= 0, is twice the tolerance
 * away from it, or turns back */
static double time_to_leave(double u, double g, double left, double tolerance) {
  const double SOON = 1. / 16; /* of the time left: if hardly anything moves it */
  const double by_speed = 4 * tolerance / u, by_force = sqrt(4 * tolerance / fabs(g));
  return g < 0 ? fmin(by_speed, -u / g) : fmin(SOON * left, fmin(by_speed, by_force));
}

/* The same for solid i, from x with v and a. A particle that touches it first leaves it. */
static double time_to_solid(const path_progress *k, int32_t i, const double v[3], const double a[3],
                            double left, double tolerance) {
  const ms_particle_path *p = k->p;
  const ms_solid *solid = &p->planes.solid[i];
  const msim_plane *q = &p->planes.tangent[i];
  if (ms_impacts_distance(q, p->x) > tolerance)
    return ms_obstacles_time_to_solid(solid, p->x, v, a, 0, left, tolerance);
  const double u = ms_vec3_dot(q->normal, v),
               g = ms_vec3_dot(q->normal, a) + ms_signed_distance_bend(solid, p->x, v);
  if (u < -k->tolerance) return 0;
  double from = time_to_leave(fmax(0, u), g, left, tolerance);
  double when = ms_obstacles_time_to_solid(solid, p->x, v, a, from, left, tolerance);
  while (g >= 0 && when == from && from > 0) {
    from *= 2;
    when = ms_obstacles_time_to_solid(solid, p->x, v, a, from, left, tolerance);
  }
  return when;
}

/* The first plane that the parabola from x with v and a meets within `left`; NULL: none. */
static const msim_plane *find_impact(const path_progress *k, const double v[3], const double a[3],
                                     double left, double *when) {
  const ms_collision_planes *planes = &k->p->planes;
  const double tolerance = ms_impacts_distance_tolerance(planes, k->p->x);
  const msim_plane *first = NULL;
  *when = left;
  const msim_plane *tangents = planes->plane + planes->n - planes->nsolids;
  for (const msim_plane *q = planes->plane; q < tangents; q++) {
    if (ms_impacts_contains_plane(&k->contact, q)) continue;
    const double s = ms_impacts_distance(q, k->p->x), *n = q->normal;
    const double t =
        time_to_plane(s, ms_vec3_dot(n, v), ms_vec3_dot(n, a), s <= tolerance, k->tolerance);
    if (t < *when) *when = t, first = q;
  }
  for (int32_t i = 0; i < planes->nsolids; i++) {
    if (ms_impacts_contains_plane(&k->contact, &tangents[i])) continue;
    const double t = time_to_solid(k, i, v, a, *when, tolerance);
    if (t < *when) *when = t, first = &tangents[i];
  }
  return first;
}

/*------------------------------------- flight and sliding ---------------------------------------*/

static void advance_path_time(path_progress *k, double dt) {
  k->t += dt;
  k->stalled = dt > 1e-6 * k->p->h ? 0 : k->stalled + 1;
}

/* Flight up to the next impact, whose plane it returns; NULL: to the end of the step. */
static const msim_plane *follow_flight(path_progress *k, double left) {
  ms_particle_path *p = k->p;
  double dt, first[3], last[3];
  const msim_plane *hit = find_impact(k, p->v, p->a, left, &dt);
  acceleration_at(p, k->t, first);
  acceleration_at(p, k->t + dt, last);
  for (int c = 0; c < 3; c++) {
    p->x[c] += dt * (p->v[c] + 0.5 * dt * p->a[c]);
    p->v[c] += dt * p->a[c];
    p->w[c] += 0.5 * dt * (first[c] + last[c]);
  }
  ms_obstacles_touch(&p->planes, p->x);
  advance_path_time(k, dt);
  return hit;
}

static int is_beyond_edge(const path_progress *k, const ms_solid *solid, const double dx[3]) {
  const ms_particle_path *p = k->p;
  return ms_obstacles_is_beyond_edge(solid, p->x, dx,
                                     2 * ms_impacts_distance_tolerance(&p->planes, p->x));
}

/* When a particle that slides along the tangent plane has just passed an edge, by bisection; `left`
 * if it does not. */
static double time_to_edge(const path_progress *k, const ms_solid *solid, const double bend[3],
                           double left) {
  double low = 0, high = INFINITY, t = left;
  for (;;) {
    double dx[3];
    for (int c = 0; c < 3; c++) dx[c] = t * (k->p->v[c] + 0.5 * t * bend[c]);
    if (is_beyond_edge(k, solid, dx)) high = t;
    else low = t;
    t = 0.5 * (low + fmin(high, left));
    if (low == left) return left;
    if (!(t > low && t < high)) return high;
  }
}

/* Shorten the time `left` in which a particle slides by dx, so that normals of curved surfaces turn
 * by little, and that it ends at edges; *edge: the plane that it slides off, or NULL. */
static double limit_slide(path_progress *k, const double dx[3], const double bend[3], double left,
                          const msim_plane **edge) {
  const double size = ms_vec3_norm(dx), whole = left;
  *edge = NULL;
  for (int i = 0; i < k->contact.n && k->p->planes.nsolids && size > 0; i++) {
    const ms_solid *solid = ms_obstacles_get_solid(&k->p->planes, k->contact.plane[i]);
    if (!solid) continue;
    const double angle = fabs(ms_signed_distance_bend(solid, k->p->x, dx)) / size;
    if (angle > SMALL_ANGLE) left = fmin(left, SMALL_ANGLE / angle * whole);
    const double until = time_to_edge(k, solid, bend, left);
    if (until < left) left = until, *edge = k->contact.plane[i];
  }
  k->is_partial = left < whole;
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

/* Move x onto the surfaces in contact, and turn v and w with their tangent planes (parallel
 * transport), which keeps speeds. */
static void follow_surfaces(path_progress *k, const ms_plane_set *on) {
  ms_particle_path *p = k->p;
  double n[3];
  if (!p->planes.nsolids) {
    ms_impacts_move_onto(on, p->x);
    return;
  }
  memcpy(n, on->plane[0]->normal, sizeof n);
  ms_obstacles_touch(&p->planes, p->x);
  ms_obstacles_move_onto(&p->planes, on, p->x);
  if (on->n == 1) {
    rotate(n, on->plane[0]->normal, p->v);
    rotate(n, on->plane[0]->normal, p->w);
  } else {
    turn_along(on, p->v);
    turn_along(on, p->w);
  }
}

static void remove_plane(ms_plane_set *on, const msim_plane *plane) {
  int n = 0;
  for (int i = 0; i < on->n; i++)
    if (on->plane[i] != plane) on->plane[n++] = on->plane[i];
  on->n = n;
}

/* The same in contact, on tangent planes. Impacts are found on the parabola to the end point of
 * sliding in the rest of the step. */
static const msim_plane *follow_slide(path_progress *k, const double along[3], double friction,
                                      double left) {
  ms_particle_path *p = k->p;
  double end[3], dx[3], bend[3], dt;
  const msim_plane *edge;
  ms_impacts_remove_normal(&k->contact, p->v, NULL);
  memcpy(end, p->v, sizeof end);
  ms_friction_slide(along, friction, left, end, dx);
  for (int c = 0; c < 3; c++) bend[c] = 2 * (dx[c] - left * p->v[c]) / (left * left);
  const double until = limit_slide(k, dx, bend, left, &edge);
  const msim_plane *hit = find_impact(k, p->v, bend, until, &dt);
  const int is_cut = hit || k->is_partial;
  for (int c = 0; c < 3 && is_cut; c++) dx[c] = dt * (p->v[c] + 0.5 * dt * bend[c]);
  const double g0 = kick_w_in_contact(k, k->t, dt / 2);
  ms_vec3_axpy(1, dx, p->x);
  if (is_cut) ms_friction_slide(along, friction, dt, p->v, NULL);
  else memcpy(p->v, end, sizeof end);
  if (ms_vec3_norm(dx) > 0 && (hit || !edge)) follow_surfaces(k, &k->contact);
  release_w(k, g0, kick_w_in_contact(k, k->t + dt, dt / 2), dt);
  if (edge && !hit) {
    remove_plane(&k->contact, edge);
    ms_obstacles_touch(&p->planes, p->x);
  }
  advance_path_time(k, dt);
  return hit;
}

/*------------------------------------- impacts --------------------------------------------------*/

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
static int is_far_from_others(const path_progress *k, const msim_plane *plane, double time) {
  const ms_particle_path *p = k->p;
  const double reach = time * (ms_vec3_norm(p->v) + time * ms_vec3_norm(p->a));
  for (const msim_plane *q = p->planes.plane; q < p->planes.plane + p->planes.n; q++)
    if (q != plane && ms_impacts_distance(q, p->x) <= reach) return 0;
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

int ms_particle_path_sums_bounces(const msim_plane *plane, const double v[3], const double a[3],
                                  double h, double jump) {
  const double u = ms_vec3_dot(plane->normal, v), g = -ms_vec3_dot(plane->normal, a);
  const double reach = fmax(0.5, 2 * plane->friction * (1 + plane->restitution));
  return find_bounce_series(plane, v, a, h, h).number > 0 && u * u * reach <= g * jump;
}

/* Adds the normal acceleration relative to a curved surface that v causes. */
static void add_bend(const path_progress *k, const msim_plane *q, const double v[3], double a[3]) {
  const ms_solid *solid = ms_obstacles_get_solid(&k->p->planes, q);
  if (solid) ms_vec3_axpy(ms_signed_distance_bend(solid, k->p->x, v), q->normal, a);
}

/* 1 if the surface of q deviates little from its tangent plane over dx, and has no edge there */
static int is_nearly_flat(const path_progress *k, const msim_plane *q, const double dx[3]) {
  const ms_solid *solid = ms_obstacles_get_solid(&k->p->planes, q);
  if (!solid) return 1;
  const double bend = fabs(ms_signed_distance_bend(solid, k->p->x, dx));
  return bend <= SMALL_ANGLE * ms_vec3_norm(dx) && !is_beyond_edge(k, solid, dx);
}

/* After a bounce on one plane: sum the bounces that follow. */
static void sum_following_bounces(path_progress *k, const msim_plane *q) {
  ms_particle_path *p = k->p;
  double middle[3], a[3] = {p->a[0], p->a[1], p->a[2]}, dx[3], unused[3], v[3], w[3];
  memcpy(v, p->v, sizeof v), memcpy(w, p->w, sizeof w);
  add_bend(k, q, v, a);
  const bounce_series s = find_bounce_series(q, v, a, p->h, p->h - k->t);
  if (s.number < 1 || !is_far_from_others(k, q, s.time)) return;
  acceleration_at(p, k->t + s.time / 2, middle);
  add_bend(k, q, w, middle);
  move_while_bouncing(q, middle, &s, w, unused);
  move_while_bouncing(q, a, &s, v, dx);
  if (!is_nearly_flat(k, q, dx)) return;
  memcpy(p->v, v, sizeof v), memcpy(p->w, w, sizeof w);
  ms_vec3_axpy(1, dx, p->x);
  follow_surfaces(k, &(ms_plane_set){1, {q}});
  k->t += s.time;
  p->impacts += isinf(s.number) ? 1 : (int64_t)s.number;
}

/* The particle rests on, or slides along, the planes of `touched` that v does not leave. */
static void find_resting_planes(path_progress *k, const ms_plane_set *touched, double tolerance) {
  k->contact = ms_impacts_select_approached(touched, k->p->v, tolerance);
  ms_impacts_remove_normal(&k->contact, k->p->v, NULL);
}

static void add_touched(ms_particle_path *p, const ms_plane_set *touched) {
  for (int i = 0; i < touched->n; i++)
    if (p->touched.n < MS_MAX_TOUCHED_PLANES &&
        !ms_impacts_contains_plane(&p->touched, touched->plane[i]))
      p->touched.plane[p->touched.n++] = touched->plane[i];
}

/* Impact on `hit` (nullable) and the other planes that x touches. After MAX_STALLED stalled
 * impacts, as in a corner, v and w are projected without restitution. */
static void handle_impact(path_progress *k, const msim_plane *hit) {
  enum { MAX_STALLED = 8 };
  ms_particle_path *p = k->p;
  if (hit) ms_obstacles_move_onto(&p->planes, &(ms_plane_set){1, {hit}}, p->x);
  const ms_plane_set touched = ms_impacts_find_touched(&p->planes, p->x);
  add_touched(p, &touched);
  p->impacts += ms_impacts_bounce(&touched, p->v);
  ms_impacts_bounce(&touched, p->w);
  if (k->stalled > MAX_STALLED) {
    double unused;
    ms_impacts_remove_pressing(&touched, 0, p->v, &unused);
    ms_impacts_remove_pressing(&touched, 0, p->w, &unused);
    find_resting_planes(k, &touched, 1e4 * k->tolerance);
    k->stalled = 0;
    return;
  }
  find_resting_planes(k, &touched, k->tolerance);
  if (touched.n == 1 && !k->contact.n) {
    sum_following_bounces(k, touched.plane[0]);
    find_resting_planes(k, &touched, k->tolerance);
  }
}

/*------------------------------------- the whole step -------------------------------------------*/

/* A particle already behind planes is moved onto them, and bounces if it approaches them. */
static void start_path(path_progress *k) {
  ms_particle_path *p = k->p;
  ms_obstacles_touch(&p->planes, p->x);
  const ms_plane_set touched = ms_impacts_find_touched(&p->planes, p->x);
  const double tolerance = ms_impacts_distance_tolerance(&p->planes, p->x);
  int outside = 0;
  for (int i = 0; i < touched.n; i++)
    outside |= ms_impacts_distance(touched.plane[i], p->x) < -tolerance;
  if (outside) ms_obstacles_move_onto(&p->planes, &touched, p->x);
  handle_impact(k, NULL);
}

/* Moves x out of solids, in which rounding or an excess of impacts may have left it. */
static void leave_solids(ms_particle_path *p) {
  enum { MOST = 16 };
  const double tolerance = ms_impacts_distance_tolerance(&p->planes, p->x);
  int inside = p->planes.nsolids > 0;
  for (int i = 0; i < MOST && inside; i++) {
    inside = 0;
    ms_obstacles_touch(&p->planes, p->x);
    for (const msim_plane *q = p->planes.plane; q < p->planes.plane + p->planes.n; q++) {
      if (!(ms_impacts_distance(q, p->x) < -tolerance)) continue;
      ms_obstacles_move_onto(&p->planes, &(ms_plane_set){1, {q}}, p->x);
      inside = 1;
    }
  }
}

void ms_particle_path_compute(ms_particle_path *p) {
  enum { MOST = 1000 };
  path_progress k = {.p = p, .tolerance = 1e-14 * (ms_vec3_norm(p->v) + p->h * ms_vec3_norm(p->a))};
  p->impacts = 0;
  p->touched.n = 0;
  start_path(&k);
  for (int i = 0; i < MOST && k.t < p->h; i++) {
    double along[3] = {p->a[0], p->a[1], p->a[2]}, friction;
    k.contact = press(&k, p->v, along, &friction);
    k.is_partial = 0;
    const double left = p->h - k.t;
    const msim_plane *hit =
        k.contact.n ? follow_slide(&k, along, friction, left) : follow_flight(&k, left);
    if (hit) handle_impact(&k, hit);
    else if (!k.is_partial) break;
  }
  leave_solids(p);
}

/* The parabola lies within the convex hull of its control points (at s, s + u/2 and `end`), and
 * within the length of the way from x. */
int ms_particle_path_may_touch(const ms_particle_path *p) {
  const double tolerance = ms_impacts_distance_tolerance(&p->planes, p->x);
  const msim_plane *tangents = p->planes.plane + p->planes.n - p->planes.nsolids;
  for (const msim_plane *q = p->planes.plane; q < tangents; q++) {
    const double s = ms_impacts_distance(q, p->x), u = p->h * ms_vec3_dot(q->normal, p->v);
    const double end = s + u + 0.5 * p->h * p->h * ms_vec3_dot(q->normal, p->a);
    if (fmin(fmin(s, s + u / 2), end) <= tolerance) return 1;
  }
  if (!p->planes.nsolids) return 0;
  const double way = p->h * (ms_vec3_norm(p->v) + 0.5 * p->h * ms_vec3_norm(p->a));
  for (const ms_solid *s = p->planes.solid; s < p->planes.solid + p->planes.nsolids; s++) {
    double unused[3];
    if (ms_signed_distance(s, p->x, unused) <= way + tolerance) return 1;
  }
  return 0;
}
