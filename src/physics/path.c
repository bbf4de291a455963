#include "physics/path.h"

#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "physics/friction.h"

/* Progress of the particle in the step. */
typedef struct walk {
  ms_path *p;
  double t;
  ms_touch on;  /* the planes that it rests on or slides along */
  double noise; /* rounding tolerance of a velocity */
  int stalled;  /* consecutive impacts at most 1e-6 h apart */
} walk;

static void acceleration_at(const ms_path *p, double t, double b[3]) {
  for (int c = 0; c < 3; c++) b[c] = p->b0[c] + (p->b1[c] - p->b0[c]) * (t / p->h);
}

/*------------------------------------- contact --------------------------------------------------*/

/* Advance v by dt at the constant a, in contact with the planes of `on`. */
static void kick(const ms_touch *on, const double a[3], double dt, double v[3]) {
  double along[3] = {a[0], a[1], a[2]}, friction;
  const ms_touch pressed = ms_touch_pressed(on, 0, along, &friction);
  ms_keep_along(&pressed, v, NULL);
  ms_friction_slide(along, friction, dt, v, NULL);
}

/* Advance w by dt in contact. If n.b becomes positive, w_n is the integral of its positive part. */
static void kick_along(walk *k, double dt) {
  double first[3], last[3];
  double *w = k->p->w;
  acceleration_at(k->p, k->t, first);
  acceleration_at(k->p, k->t + dt, last);
  kick(&k->on, first, dt / 2, w);
  kick(&k->on, last, dt / 2, w);
  if (k->on.n != 1) return;
  const double *n = k->on.plane[0]->normal, g0 = ms_dot3(n, first), g1 = ms_dot3(n, last);
  if (g0 < 0 && g1 > 0) ms_axpy3(g1 * g1 / (g1 - g0) * dt / 2 - ms_dot3(n, w), n, w);
}

/*------------------------------------- the next impact ------------------------------------------*/

/* When s + u t + g t^2/2 falls below 0; INFINITY: never. touches: s counts as 0. */
static double fall_time(double s, double u, double g, int touches, double noise) {
  if (touches) return u < -noise ? 0 : g < 0 ? fmax(0, -2 * u / g) : INFINITY;
  const double d = u * u - 2 * g * s;
  if (d < 0 || (u >= 0 && g >= 0)) return INFINITY;
  return u < 0 ? 2 * s / (sqrt(d) - u) : -(u + sqrt(d)) / g;
}

/* The first plane that the parabola from x with v and a meets within `left`; NULL: none. */
static const msim_plane *find_impact(const walk *k, const double v[3], const double a[3],
                                     double left, double *when) {
  const ms_walls *walls = &k->p->walls;
  const double noise = ms_distance_noise(walls, k->p->x);
  const msim_plane *first = NULL;
  *when = left;
  for (const msim_plane *q = walls->plane; q < walls->plane + walls->n; q++) {
    if (ms_touch_holds(&k->on, q)) continue;
    const double s = ms_distance(q, k->p->x), *n = q->normal;
    const double t = fall_time(s, ms_dot3(n, v), ms_dot3(n, a), s <= noise, k->noise);
    if (t < *when) *when = t, first = q;
  }
  return first;
}

/*------------------------------------- flight and sliding ---------------------------------------*/

static void advance(walk *k, double dt) {
  k->t += dt;
  k->stalled = dt > 1e-6 * k->p->h ? 0 : k->stalled + 1;
}

/* Flight up to the next impact, whose plane it returns; NULL: to the end of the step. */
static const msim_plane *fly(walk *k, double left) {
  ms_path *p = k->p;
  double dt, first[3], last[3];
  const msim_plane *hit = find_impact(k, p->v, p->a, left, &dt);
  acceleration_at(p, k->t, first);
  acceleration_at(p, k->t + dt, last);
  for (int c = 0; c < 3; c++) {
    p->x[c] += dt * (p->v[c] + 0.5 * dt * p->a[c]);
    p->v[c] += dt * p->a[c];
    p->w[c] += 0.5 * dt * (first[c] + last[c]);
  }
  advance(k, dt);
  return hit;
}

/* The same in contact. Impacts are found on the parabola to the end point of sliding in the rest of
 * the step. */
static const msim_plane *slide(walk *k, const double along[3], double friction, double left) {
  ms_path *p = k->p;
  double end[3], dx[3], bend[3], dt;
  ms_keep_along(&k->on, p->v, NULL);
  memcpy(end, p->v, sizeof end);
  ms_friction_slide(along, friction, left, end, dx);
  for (int c = 0; c < 3; c++) bend[c] = 2 * (dx[c] - left * p->v[c]) / (left * left);
  const msim_plane *hit = find_impact(k, p->v, bend, left, &dt);
  for (int c = 0; c < 3 && hit; c++) dx[c] = dt * (p->v[c] + 0.5 * dt * bend[c]);
  ms_axpy3(1, dx, p->x);
  if (ms_norm3(dx) > 0) ms_put_on(&k->on, p->x);
  if (hit) ms_friction_slide(along, friction, dt, p->v, NULL);
  else memcpy(p->v, end, sizeof end);
  kick_along(k, dt);
  advance(k, dt);
  return hit;
}

/*------------------------------------- impacts --------------------------------------------------*/

/* Bounces on one plane: number, INFINITY until rest; duration, s; final normal speed over the
 * initial one. */
typedef struct series {
  double number, time, kept;
} series;

/* The bounces that end within the time left, the first of normal speed u */
static series sum_bounces(double e, double u, double g, double left) {
  const double period = 2 * u / g, m = left / period;
  if (e == 1) return (series){floor(m), period * floor(m), 1};
  if (m * (1 - e) >= 1) return (series){INFINITY, period / (1 - e), 0};
  const double number = e > 0 ? floor(log1p(-m * (1 - e)) / log(e)) : 0, kept = pow(e, number);
  return (series){number, period * (1 - kept) / (1 - e), kept};
}

/* The particle cannot reach another plane within that time. */
static int is_alone(const walk *k, const msim_plane *plane, double time) {
  const ms_path *p = k->p;
  const double reach = time * (ms_norm3(p->v) + time * ms_norm3(p->a));
  for (const msim_plane *q = p->walls.plane; q < p->walls.plane + p->walls.n; q++)
    if (q != plane && ms_distance(q, p->x) <= reach) return 0;
  return 1;
}

/* Tangential motion by b during bounces, with the friction of the mean normal force over mass,
 * g (1 + e)/2; the normal velocity is scaled by `kept`. Bounce k lasts 2 u_k/g, u_k = e^k u, and
 * reduces the speed by mu (1 + e) u_k at its end, the mean force gradually: the displacement is
 * larger by half the product of both, in total by mu (u^2/g) (1 - e^2m)/(1 - e). */
static void bounce_along(const msim_plane *q, const double b[3], const series *s, double v[3],
                         double dx[3]) {
  const double *n = q->normal, u = ms_dot3(n, v), g = ms_dot3(n, b);
  double along[3] = {b[0], b[1], b[2]};
  ms_axpy3(-g, n, along);
  ms_axpy3(-u, n, v);
  ms_friction_slide(along, q->friction * fmax(0, -g) * (1 + q->restitution) / 2, s->time, v, dx);
  const double speed = ms_norm3(v), e = q->restitution;
  const double flights = e < 1 ? (1 - s->kept * s->kept) / (1 - e) : 2 * s->number;
  if (speed > 0 && g < 0) ms_axpy3(q->friction * u * u / -g * flights / speed, v, dx);
  ms_axpy3(s->kept * fmax(0, u), n, v);
}

/* The bounces to be summed, if they come to rest in the time left or are short; number 0: none. */
static series find_series(const msim_plane *q, const double v[3], const double a[3], double h,
                          double left) {
  const double SHORT = 1. / 64; /* duration of a short bounce over the step */
  const double u = ms_dot3(q->normal, v), g = -ms_dot3(q->normal, a);
  if (!(g > 0) || !(u > 0)) return (series){0};
  const series s = sum_bounces(q->restitution, u, g, left);
  return s.number >= 1 && (s.kept == 0 || 2 * u < SHORT * h * g) ? s : (series){0};
}

int ms_path_sums_bounces(const msim_plane *plane, const double v[3], const double a[3], double h,
                         double jump) {
  const double u = ms_dot3(plane->normal, v), g = -ms_dot3(plane->normal, a);
  const double reach = fmax(0.5, 2 * plane->friction * (1 + plane->restitution));
  return find_series(plane, v, a, h, h).number > 0 && u * u * reach <= g * jump;
}

/* After a bounce on one plane: sum the bounces that follow. */
static void bounce_on(walk *k, const msim_plane *q) {
  ms_path *p = k->p;
  const series s = find_series(q, p->v, p->a, p->h, p->h - k->t);
  if (s.number < 1 || !is_alone(k, q, s.time)) return;
  double middle[3], dx[3];
  acceleration_at(p, k->t + s.time / 2, middle);
  bounce_along(q, middle, &s, p->w, dx);
  bounce_along(q, p->a, &s, p->v, dx);
  ms_axpy3(1, dx, p->x);
  ms_put_on(&(ms_touch){1, {q}}, p->x);
  k->t += s.time;
  p->impacts += isinf(s.number) ? 1 : (int64_t)s.number;
}

/* The particle rests on, or slides along, the planes of `touched` that v does not leave. */
static void settle(walk *k, const ms_touch *touched, double noise) {
  k->on = ms_touch_approached(touched, k->p->v, noise);
  ms_keep_along(&k->on, k->p->v, NULL);
}

/* Impact on `hit` (nullable) and the other planes that x touches. After PATIENCE stalled impacts,
 * as in a corner, v and w are projected without restitution. */
static void meet(walk *k, const msim_plane *hit) {
  enum { PATIENCE = 8 };
  ms_path *p = k->p;
  if (hit) ms_put_on(&(ms_touch){1, {hit}}, p->x);
  const ms_touch touched = ms_touched(&p->walls, p->x);
  p->impacts += ms_bounce(&touched, p->v);
  ms_bounce(&touched, p->w);
  if (k->stalled > PATIENCE) {
    double unused;
    ms_touch_pressed(&touched, 0, p->v, &unused);
    ms_touch_pressed(&touched, 0, p->w, &unused);
    settle(k, &touched, 1e4 * k->noise);
    k->stalled = 0;
    return;
  }
  settle(k, &touched, k->noise);
  if (touched.n == 1 && !k->on.n) {
    bounce_on(k, touched.plane[0]);
    settle(k, &touched, k->noise);
  }
}

/*------------------------------------- the whole step -------------------------------------------*/

/* A particle already behind planes is moved onto them, and bounces if it approaches them. */
static void start(walk *k) {
  ms_path *p = k->p;
  const ms_touch touched = ms_touched(&p->walls, p->x);
  const double noise = ms_distance_noise(&p->walls, p->x);
  int outside = 0;
  for (int i = 0; i < touched.n; i++) outside |= ms_distance(touched.plane[i], p->x) < -noise;
  if (outside) ms_put_on(&touched, p->x);
  meet(k, NULL);
}

void ms_path_follow(ms_path *p) {
  enum { MOST = 1000 };
  walk k = {.p = p, .noise = 1e-14 * (ms_norm3(p->v) + p->h * ms_norm3(p->a))};
  p->impacts = 0;
  start(&k);
  for (int i = 0; i < MOST && k.t < p->h; i++) {
    double along[3] = {p->a[0], p->a[1], p->a[2]}, friction;
    k.on = ms_touch_pressed(&k.on, 0, along, &friction);
    const double left = p->h - k.t;
    const msim_plane *hit = k.on.n ? slide(&k, along, friction, left) : fly(&k, left);
    if (!hit) break;
    meet(&k, hit);
  }
}

/* The parabola lies within the convex hull of its control points (at s, s + u/2 and `end`). */
int ms_path_is_near(const ms_path *p) {
  const double noise = ms_distance_noise(&p->walls, p->x);
  for (const msim_plane *q = p->walls.plane; q < p->walls.plane + p->walls.n; q++) {
    const double s = ms_distance(q, p->x), u = p->h * ms_dot3(q->normal, p->v);
    const double end = s + u + 0.5 * p->h * p->h * ms_dot3(q->normal, p->a);
    if (fmin(fmin(s, s + u / 2), end) <= noise) return 1;
  }
  return 0;
}
