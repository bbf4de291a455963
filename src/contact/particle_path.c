#include "contact/particle_path.h"

#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "contact/friction.h"

/* Progress of the particle in the step. */
typedef struct path_progress {
  ms_particle_path *p;
  double t;
  ms_plane_set contact; /* the planes that it rests on or slides along */
  double tolerance;     /* rounding tolerance of a velocity */
  int stalled;          /* consecutive impacts at most 1e-6 h apart */
} path_progress;

static void acceleration_at(const ms_particle_path *p, double t, double b[3]) {
  for (int c = 0; c < 3; c++) b[c] = p->b0[c] + (p->b1[c] - p->b0[c]) * (t / p->h);
}

/*------------------------------------- contact --------------------------------------------------*/

/* Advance v by dt at the constant a, in contact with the planes of `on`. */
static void kick_in_contact(const ms_plane_set *on, const double a[3], double dt, double v[3]) {
  double along[3] = {a[0], a[1], a[2]}, friction;
  const ms_plane_set pressed = ms_impacts_remove_pressing(on, 0, along, &friction);
  ms_impacts_remove_normal(&pressed, v, NULL);
  ms_friction_slide(along, friction, dt, v, NULL);
}

/* Advance w by dt in contact. If n.b becomes positive, w_n is the integral of its positive part. */
static void kick_w_in_contact(path_progress *k, double dt) {
  double first[3], last[3];
  double *w = k->p->w;
  acceleration_at(k->p, k->t, first);
  acceleration_at(k->p, k->t + dt, last);
  kick_in_contact(&k->contact, first, dt / 2, w);
  kick_in_contact(&k->contact, last, dt / 2, w);
  if (k->contact.n != 1) return;
  const double *n = k->contact.plane[0]->normal, g0 = ms_vec3_dot(n, first),
               g1 = ms_vec3_dot(n, last);
  if (g0 < 0 && g1 > 0) ms_vec3_axpy(g1 * g1 / (g1 - g0) * dt / 2 - ms_vec3_dot(n, w), n, w);
}

/*------------------------------------- the next impact ------------------------------------------*/

/* When s + u t + g t^2/2 falls below 0; INFINITY: never. touches: s counts as 0. */
static double time_to_plane(double s, double u, double g, int touches, double tolerance) {
  if (touches) return u < -tolerance ? 0 : g < 0 ? fmax(0, -2 * u / g) : INFINITY;
  const double d = u * u - 2 * g * s;
  if (d < 0 || (u >= 0 && g >= 0)) return INFINITY;
  return u < 0 ? 2 * s / (sqrt(d) - u) : -(u + sqrt(d)) / g;
}

/* The first plane that the parabola from x with v and a meets within `left`; NULL: none. */
static const msim_plane *find_impact(const path_progress *k, const double v[3], const double a[3],
                                     double left, double *when) {
  const ms_collision_planes *planes = &k->p->planes;
  const double tolerance = ms_impacts_distance_tolerance(planes, k->p->x);
  const msim_plane *first = NULL;
  *when = left;
  for (const msim_plane *q = planes->plane; q < planes->plane + planes->n; q++) {
    if (ms_impacts_contains_plane(&k->contact, q)) continue;
    const double s = ms_impacts_distance(q, k->p->x), *n = q->normal;
    const double t =
        time_to_plane(s, ms_vec3_dot(n, v), ms_vec3_dot(n, a), s <= tolerance, k->tolerance);
    if (t < *when) *when = t, first = q;
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
  advance_path_time(k, dt);
  return hit;
}

/* The same in contact. Impacts are found on the parabola to the end point of sliding in the rest of
 * the step. */
static const msim_plane *follow_slide(path_progress *k, const double along[3], double friction,
                                      double left) {
  ms_particle_path *p = k->p;
  double end[3], dx[3], bend[3], dt;
  ms_impacts_remove_normal(&k->contact, p->v, NULL);
  memcpy(end, p->v, sizeof end);
  ms_friction_slide(along, friction, left, end, dx);
  for (int c = 0; c < 3; c++) bend[c] = 2 * (dx[c] - left * p->v[c]) / (left * left);
  const msim_plane *hit = find_impact(k, p->v, bend, left, &dt);
  for (int c = 0; c < 3 && hit; c++) dx[c] = dt * (p->v[c] + 0.5 * dt * bend[c]);
  ms_vec3_axpy(1, dx, p->x);
  if (ms_vec3_norm(dx) > 0) ms_impacts_move_onto(&k->contact, p->x);
  if (hit) ms_friction_slide(along, friction, dt, p->v, NULL);
  else memcpy(p->v, end, sizeof end);
  kick_w_in_contact(k, dt);
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

/* After a bounce on one plane: sum the bounces that follow. */
static void sum_following_bounces(path_progress *k, const msim_plane *q) {
  ms_particle_path *p = k->p;
  const bounce_series s = find_bounce_series(q, p->v, p->a, p->h, p->h - k->t);
  if (s.number < 1 || !is_far_from_others(k, q, s.time)) return;
  double middle[3], dx[3];
  acceleration_at(p, k->t + s.time / 2, middle);
  move_while_bouncing(q, middle, &s, p->w, dx);
  move_while_bouncing(q, p->a, &s, p->v, dx);
  ms_vec3_axpy(1, dx, p->x);
  ms_impacts_move_onto(&(ms_plane_set){1, {q}}, p->x);
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
  if (hit) ms_impacts_move_onto(&(ms_plane_set){1, {hit}}, p->x);
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
  const ms_plane_set touched = ms_impacts_find_touched(&p->planes, p->x);
  const double tolerance = ms_impacts_distance_tolerance(&p->planes, p->x);
  int outside = 0;
  for (int i = 0; i < touched.n; i++)
    outside |= ms_impacts_distance(touched.plane[i], p->x) < -tolerance;
  if (outside) ms_impacts_move_onto(&touched, p->x);
  handle_impact(k, NULL);
}

void ms_particle_path_compute(ms_particle_path *p) {
  enum { MOST = 1000 };
  path_progress k = {.p = p, .tolerance = 1e-14 * (ms_vec3_norm(p->v) + p->h * ms_vec3_norm(p->a))};
  p->impacts = 0;
  p->touched.n = 0;
  start_path(&k);
  for (int i = 0; i < MOST && k.t < p->h; i++) {
    double along[3] = {p->a[0], p->a[1], p->a[2]}, friction;
    k.contact = ms_impacts_remove_pressing(&k.contact, 0, along, &friction);
    const double left = p->h - k.t;
    const msim_plane *hit =
        k.contact.n ? follow_slide(&k, along, friction, left) : follow_flight(&k, left);
    if (!hit) break;
    handle_impact(&k, hit);
  }
}

/* The parabola lies within the convex hull of its control points (at s, s + u/2 and `end`). */
int ms_particle_path_may_touch(const ms_particle_path *p) {
  const double tolerance = ms_impacts_distance_tolerance(&p->planes, p->x);
  for (const msim_plane *q = p->planes.plane; q < p->planes.plane + p->planes.n; q++) {
    const double s = ms_impacts_distance(q, p->x), u = p->h * ms_vec3_dot(q->normal, p->v);
    const double end = s + u + 0.5 * p->h * p->h * ms_vec3_dot(q->normal, p->a);
    if (fmin(fmin(s, s + u / 2), end) <= tolerance) return 1;
  }
  return 0;
}
