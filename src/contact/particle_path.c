#include "contact/particle_path.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "contact/friction.h"
#include "contact/moving_obstacles.h"
#include "contact/path_bounces.h"
#include "contact/path_impact.h"
#include "contact/path_surface.h"
#include "physics/signed_distance.h"

/*------------------------------------- contact --------------------------------------------------*/

/* The planes in contact that a presses on at the velocity v, relative to the frame; a becomes its
 * part along them, relative to it. */
static ms_plane_set press(const ms_path_progress *k, const double v[3], double a[3],
                          double *friction) {
  const ms_particle_path *p = k->p;
  if (!p->planes.nsolids) return ms_impacts_remove_pressing(&k->contact, 0, a, friction);
  double least[MS_MAX_TOUCHED_PLANES], size = ms_vec3_norm(a);
  ms_path_surface_find_least(k, &k->contact, v, least);
  const ms_plane_set pressed = ms_impacts_raise_pressing(&k->contact, least, 0, a, friction);
  for (int i = 0; i < k->contact.n; i++) size += fabs(least[i]);
  ms_path_surface_make_relative(k, &pressed, v, a);
  ms_impacts_remove_normal(&pressed, a, NULL);
  if (ms_vec3_norm(a) <= 16 * DBL_EPSILON * size) memset(a, 0, 3 * sizeof *a);
  return pressed;
}

/* Advance v by dt at the constant a, in contact. On curved surfaces friction depends on the speed:
 * that in the middle of dt, for order 2. */
static void kick_in_contact(const ms_path_progress *k, const double a[3], double dt, double v[3]) {
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

/* Advance u, which is v or w, by half of a part of the path, with the acceleration b at that end of
 * the part. Returns the normal acceleration relative to the surface, if there is one plane. */
static double kick_half(const ms_path_progress *k, const double b[3], double half, double u[3]) {
  const ms_plane_set *on = &k->contact;
  double least[MS_MAX_TOUCHED_PLANES] = {0};
  kick_in_contact(k, b, half, u);
  if (on->n != 1) return 0;
  if (k->p->planes.nsolids) ms_path_surface_find_least(k, on, u, least);
  return ms_vec3_dot(on->plane[0]->normal, b) - least[0];
}

static double kick_w_half(const ms_path_progress *k, double t, double half) {
  double b[3];
  if (k->p->without_w) return 0;
  ms_path_progress_acceleration(k->p, t, b);
  return kick_half(k, b, half, k->p->w);
}

static int is_on_solid(const ms_path_progress *k) {
  for (int i = 0; i < k->contact.n; i++)
    if (ms_obstacles_get_solid(&k->p->planes, k->contact.plane[i])) return 1;
  return 0;
}

/* If the normal acceleration, from g0 to g1, ends positive, u_n, `start` before, grows by the
 * integral of its positive part. On several surfaces no u_n is below 0: u has turned with those
 * that it leaves. */
static void release(const ms_path_progress *k, double start, double g0, double g1, double dt,
                    double u[3]) {
  const ms_plane_set *on = &k->contact;
  double to[MS_MAX_TOUCHED_PLANES], unused[MS_MAX_INDEPENDENT_PLANES];
  for (int i = 0; i < on->n; i++) to[i] = fmax(0, ms_vec3_dot(on->plane[i]->normal, u));
  if (on->n == 1 && g1 > 0)
    to[0] = (g0 < 0 ? g1 * g1 / (g1 - g0) : g0 + g1) * dt / 2 + (g0 < 0 ? 0 : start);
  if (on->n == 1 ? g1 > 0 : is_on_solid(k)) ms_impacts_set_normal_components(on, to, u, unused);
}

/*------------------------------------- flight and sliding ---------------------------------------*/

static void advance_path_time(ms_path_progress *k, double dt) {
  k->t += dt;
  k->stalled = dt > 1e-6 * k->p->h ? 0 : k->stalled + 1;
}

/* Flight up to the next impact, whose plane it returns; NULL: to the end of the step. */
static const msim_plane *follow_flight(ms_path_progress *k, double left) {
  ms_particle_path *p = k->p;
  double dt, first[3], last[3];
  const msim_plane *hit = ms_path_impact_find(k, p->v, p->a, left, &dt);
  ms_path_progress_acceleration(p, k->t, first);
  ms_path_progress_acceleration(p, k->t + dt, last);
  for (int c = 0; c < 3; c++) {
    p->x[c] += dt * (p->v[c] + 0.5 * dt * p->a[c]);
    p->v[c] += dt * p->a[c];
    p->w[c] += 0.5 * dt * (first[c] + last[c]);
  }
  if (ms_path_surface_moves(k)) ms_path_surface_place(k, k->t + dt, 1);
  else ms_obstacles_touch(&p->planes, p->x);
  advance_path_time(k, dt);
  return hit;
}

/* The velocity after sliding for dt, and the displacement */
static void slide(const ms_path_progress *k, const double along[3], double friction, double dt,
                  double v[3], double dx[3]) {
  memcpy(v, k->p->v, sizeof k->p->v);
  ms_friction_slide(along, friction, dt, v, dx);
}

/* When a particle that slides along the tangent plane has just passed an edge, by bisection; `left`
 * if it does not. */
static double time_to_edge(const ms_path_progress *k, const ms_solid *solid, const double along[3],
                           double friction, double left) {
  double low = 0, high = INFINITY, t = left;
  for (;;) {
    double v[3], dx[3];
    slide(k, along, friction, t, v, dx);
    if (ms_path_surface_is_beyond_edge(k, solid, dx)) high = t;
    else low = t;
    t = 0.5 * (low + fmin(high, left));
    if (low == left) return left;
    if (!(t > low && t < high)) return high;
  }
}

/* Shorten the time in which a particle slides on a surface of curvature q along its motion. In dt,
 * at the speed u, it falls behind by q^2 u^3 dt^3/3, as the tangent plane is not the arc; and half
 * kicks at both ends are off by q u a dt^3/12, as the acceleration along the surface turns. */
static double limit_part(const ms_path_progress *k, double q, double left) {
  const ms_particle_path *p = k->p;
  const double v = ms_vec3_norm(p->v), a = ms_vec3_norm(p->a);
  for (; q > 0; left /= 2) {
    const double u = v + left * a, error = q * u * (q * u * u / 3 + a / 12) * left * left;
    if (q * u * left <= MS_PATH_SMALL_ANGLE && error * p->h <= p->x_error) break;
  }
  return left;
}

/* Shorten the time `left` in which a particle slides by dx, so that normals of curved surfaces turn
 * by little, and that it ends at edges; *edge: the plane that it slides off, or NULL. */
static double limit_slide(ms_path_progress *k, const double dx[3], const double along[3],
                          double friction, double left, const msim_plane **edge) {
  const double size = ms_vec3_norm(dx), whole = left;
  *edge = NULL;
  left = ms_path_surface_limit_motion(k, ms_path_surface_time_to_release(k, left));
  for (int i = 0; i < k->contact.n && k->p->planes.nsolids && size > 0; i++) {
    const ms_solid *solid = ms_obstacles_get_solid(&k->p->planes, k->contact.plane[i]);
    if (!solid) continue;
    const double bend = fabs(ms_signed_distance_bend(solid, k->p->x, dx)),
                 longest = ms_obstacles_find_cell(solid) * MS_PATH_SHARE_OF_CELL;
    left = limit_part(k, bend / (size * size), left);
    if (size > longest) left = fmin(left, longest / size * whole);
    if (solid->samples) {
      double v[3], until[3];
      slide(k, along, friction, left, v, until);
      if (ms_path_surface_holds(k, k->contact.plane[i], until, left)) continue;
    }
    const double until = time_to_edge(k, solid, along, friction, left);
    if (until < left) left = until, *edge = k->contact.plane[i];
  }
  k->is_partial |= left < whole;
  return left;
}

static void remove_plane(ms_plane_set *on, const msim_plane *plane) {
  int n = 0;
  for (int i = 0; i < on->n; i++)
    if (on->plane[i] != plane) on->plane[n++] = on->plane[i];
  on->n = n;
}

/* 1: a slide by dx in dt and its parabola, `off` apart in the middle, clearly stay in front of each
 * other plane, or clearly end behind it. Near its start, where a parabola begins as the slide does,
 * the distance between them is O(t^2): so the last two control points decide. */
static int is_decided(const ms_path_progress *k, const double dx[3], double dt, double off) {
  const ms_particle_path *p = k->p;
  const double MARGIN = 4;
  for (const msim_plane *q = p->planes.plane; q < p->planes.plane + p->planes.n - p->planes.nsolids;
       q++) {
    if (ms_impacts_contains_plane(&k->contact, q)) continue;
    const double s = ms_impacts_distance(q, p->x), end = s + ms_vec3_dot(q->normal, dx),
                 middle = s + dt / 2 * ms_vec3_dot(q->normal, p->v);
    if (fmin(middle, end) <= MARGIN * off && end >= -MARGIN * off) return 0;
  }
  return 1;
}

/* Shorten the time of sliding, as friction turns the motion and ends it, so that impacts may be
 * looked for on the parabola to its end; on solids they are not refined. */
static double limit_turn(ms_path_progress *k, const double along[3], double friction, double left) {
  const double NEAR = 1. / 64, EQUAL = 1e-9; /* distances in the middle, over the length */
  const ms_particle_path *p = k->p;
  const int may_meet_solids = p->planes.nsolids > is_on_solid(k);
  const double whole = left, allowed = may_meet_solids ? p->x_error : INFINITY;
  for (; friction > 0 && p->planes.n > k->contact.n; left /= 2) {
    double v[3], dx[3], middle[3];
    slide(k, along, friction, left, v, dx);
    slide(k, along, friction, left / 2, v, middle);
    for (int c = 0; c < 3; c++) middle[c] -= (dx[c] + left * p->v[c]) / 4;
    const double off = ms_vec3_norm(middle),
                 length = fmax(ms_vec3_norm(dx), left * ms_vec3_norm(p->v));
    if (off <= EQUAL * length) break;
    if (off <= fmin(NEAR * length, allowed) && is_decided(k, dx, left, off)) break;
  }
  k->is_partial = left < whole;
  return left;
}

/* Move the time of an impact from the parabola to the curve, by Newton's method; 0: the curve does
 * not meet the plane. A late impact would be faster, and tiny bounces would never end. */
static int refine_impact(const ms_path_progress *k, const double along[3], double friction,
                         const msim_plane *hit, double until, double *dt) {
  enum { MOST = 16 };
  const ms_particle_path *p = k->p;
  double s = 0;
  if (ms_obstacles_get_solid(&p->planes, hit) || ms_path_surface_moves(k)) return 1;
  for (int i = 0; i < MOST; i++) {
    double v[3], x[3];
    slide(k, along, friction, *dt, v, x);
    ms_vec3_axpy(1, p->x, x);
    s = ms_impacts_distance(hit, x);
    const double u = ms_vec3_dot(hit->normal, v), next = fmin(fmax(0, *dt - s / u), until);
    if (fabs(s) <= 2 * DBL_EPSILON * ms_vec3_norm(x)) return 1;
    if (!(u < 0) || next == *dt) break;
    *dt = next;
  }
  return fabs(s) <= ms_impacts_distance_tolerance(&p->planes, p->x);
}

/* What the first half kicks of a part in contact found */
typedef struct first_kicks {
  int of_v;      /* v is kicked, too */
  double start;  /* n.w before */
  double v0, w0; /* normal accelerations of v and w */
} first_kicks;

/* On a solid v gets half kicks at both ends of a part, as w does: so the path is of order 2 in the
 * length of its parts. `end` is exact on planes alone, and moves nothing after the last part. */
static first_kicks begin_kicks(const ms_path_progress *k, int is_last, double dt,
                               const double end[3]) {
  ms_particle_path *p = k->p;
  first_kicks f = {.of_v = is_on_solid(k) && !is_last,
                   .start = ms_vec3_dot(k->contact.plane[0]->normal, p->w)};
  f.w0 = kick_w_half(k, k->t, dt / 2);
  if (f.of_v) f.v0 = kick_half(k, p->a, dt / 2, p->v);
  else memcpy(p->v, end, sizeof p->v);
  return f;
}

static void end_kicks(const ms_path_progress *k, double dt, const first_kicks *f) {
  ms_particle_path *p = k->p;
  release(k, f->start, f->w0, kick_w_half(k, k->t + dt, dt / 2), dt, p->w);
  if (f->of_v) release(k, 0, f->v0, kick_half(k, p->a, dt / 2, p->v), dt, p->v);
}

/* The same at an edge, beyond which surfaces are bent: on the surface just before it, unless that
 * is too near. n: its normal at the start of the slide by dx */
static void end_kicks_at_edge(ms_path_progress *k, const double n[3], const double dx[3], double dt,
                              const first_kicks *f) {
  const double BACK = 1e-3;
  ms_particle_path *p = k->p;
  const double x[3] = {p->x[0], p->x[1], p->x[2]};
  ms_vec3_axpy(-BACK, dx, p->x);
  ms_obstacles_touch(&p->planes, p->x);
  if (ms_vec3_dot(n, k->contact.plane[0]->normal) >= MS_PATH_SHARP_COSINE) {
    ms_path_surface_follow(k, &k->contact, n);
    end_kicks(k, dt, f);
  }
  memcpy(p->x, x, sizeof x);
}

/* The same in contact, on tangent planes. Impacts are found on the parabola to the end point of
 * sliding in the rest of the step, or in a part of it. */
static const msim_plane *follow_slide(ms_path_progress *k, const double along[3], double friction,
                                      double left) {
  ms_particle_path *p = k->p;
  double end[3], dx[3], bend[3], dt, n[3], before[3], from[3];
  const msim_plane *edge;
  ms_path_surface_enter_frame(k, &k->contact);
  memcpy(before, p->w, sizeof before), memcpy(from, k->frame, sizeof from);
  ms_impacts_remove_normal(&k->contact, p->v, NULL);
  left = limit_turn(k, along, friction, left);
  slide(k, along, friction, left, end, dx);
  for (int c = 0; c < 3; c++) /* without friction, rounding could seem to press in a short time */
    bend[c] = friction > 0 ? 2 * (dx[c] - left * p->v[c]) / (left * left) : along[c];
  const double until = limit_slide(k, dx, along, friction, left, &edge);
  const msim_plane *hit = ms_path_impact_find_in_frame(k, bend, until, &dt);
  if (hit && !refine_impact(k, along, friction, hit, until, &dt)) hit = NULL, k->is_partial = 1;
  if (dt < left) slide(k, along, friction, dt, end, dx);
  const int is_last = !hit && !k->is_partial && k->end == p->h;
  const first_kicks kicks = begin_kicks(k, is_last, dt, end);
  const int passes_edge = edge && !hit;
  memcpy(n, k->contact.plane[0]->normal, sizeof n);
  ms_path_surface_move(k, &k->contact, dx, dt);
  if ((ms_vec3_norm(dx) > 0 || ms_path_surface_moves(k)) && !passes_edge)
    ms_path_surface_follow(k, &k->contact, n);
  ms_path_surface_set_frame(k, &k->contact);
  if (passes_edge) end_kicks_at_edge(k, n, dx, dt, &kicks);
  else end_kicks(k, dt, &kicks);
  ms_path_surface_add_work(k, before, from, dt);
  ms_path_surface_leave_frame(k);
  if (passes_edge) {
    remove_plane(&k->contact, edge);
    ms_obstacles_touch(&p->planes, p->x);
  }
  advance_path_time(k, dt);
  return hit;
}

/*------------------------------------- impacts --------------------------------------------------*/

/* The particle rests on, or slides along, the planes of `touched` that v does not leave. */
static void find_resting_planes(ms_path_progress *k, const ms_plane_set *touched,
                                double tolerance) {
  k->contact = ms_impacts_select_approached(touched, k->p->v, tolerance);
  ms_impacts_remove_normal(&k->contact, k->p->v, NULL);
}

static void add_touched(ms_particle_path *p, const ms_plane_set *touched) {
  for (int i = 0; i < touched->n; i++)
    if (p->touched.n < MS_MAX_TOUCHED_PLANES &&
        !ms_impacts_contains_plane(&p->touched, touched->plane[i]))
      p->touched.plane[p->touched.n++] = touched->plane[i];
}

/* After an impact, in the frame of the planes `touched`: the planes that the particle rests on, or
 * the bounces that follow. After MAX_STALLED stalled impacts, as in a corner, v and w are projected
 * without restitution, and the tolerance grows: normals of solids are rounded to some 1e-14, so
 * that in a groove no v may satisfy all. */
static void rest_on(ms_path_progress *k, const ms_plane_set *touched) {
  enum { MAX_STALLED = 8, MAX_STALLS = 4 };
  ms_particle_path *p = k->p;
  if (k->stalled > MAX_STALLED) {
    double unused;
    ms_impacts_remove_pressing(touched, 0, p->v, &unused);
    ms_impacts_remove_pressing(touched, 0, p->w, &unused);
    find_resting_planes(k, touched, 1e4 * k->tolerance);
    if (k->stalls++ < MAX_STALLS) k->tolerance *= 10;
    k->stalled = 0;
    return;
  }
  const double slow = ms_path_bounces_find_rest_speed(&p->planes, touched, p->x, ms_vec3_norm(p->a),
                                                      p->bounce_reach);
  find_resting_planes(k, touched, fmax(slow, k->tolerance));
  if (touched->n == 1 && !k->contact.n) {
    ms_path_bounces_sum(k, touched->plane[0]);
    find_resting_planes(k, touched, k->tolerance);
  }
}

/* Impact on `hit` (nullable) and the other planes that x touches. For those that it presses on n.v
 * is 0, whatever errors say. */
static void handle_impact(ms_path_progress *k, const msim_plane *hit) {
  ms_particle_path *p = k->p;
  ms_plane_set pressed = {0};
  if (hit) ms_obstacles_move_onto(&p->planes, &(ms_plane_set){1, {hit}}, p->x);
  if (hit && k->contact.n) {
    double unused[3] = {p->a[0], p->a[1], p->a[2]}, friction;
    pressed = press(k, p->v, unused, &friction);
  }
  const ms_plane_set touched = ms_impacts_find_touched(&p->planes, p->x);
  add_touched(p, &touched);
  ms_path_surface_enter_frame(k, &touched);
  const double before[3] = {p->w[0], p->w[1], p->w[2]};
  if (pressed.n) ms_impacts_remove_normal(&pressed, p->v, NULL);
  if (pressed.n) ms_impacts_remove_normal(&pressed, p->w, NULL);
  p->impacts += ms_impacts_bounce(&touched, p->v);
  ms_impacts_bounce(&touched, p->w);
  for (int c = 0; c < 3 && ms_path_surface_moves(k); c++)
    p->work += (p->w[c] - before[c]) * k->frame[c];
  rest_on(k, &touched);
  ms_path_surface_leave_frame(k);
}

/*------------------------------------- the whole step -------------------------------------------*/

/* Sets both ends of the part of the path that begins, and places obstacles at its start. A time of
 * a motion within rounding of the step's end is that. */
static void begin_part(ms_path_progress *k) {
  ms_particle_path *p = k->p;
  const double next = ms_moving_obstacles_next_time(&p->planes, p->t + k->t) - p->t;
  k->start = k->t;
  k->end = next < p->h - 4 * DBL_EPSILON * (p->t + p->h) ? next : p->h;
  ms_path_surface_place(k, k->t, 0);
}

/* A particle already behind planes is moved onto them, and bounces if it approaches them. */
static void start_path(ms_path_progress *k) {
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

/* Where a part turns by the angle q over a length l, x is off by l q^2/3: by that a particle on the
 * tangent plane falls behind one on the arc. */
static double find_turn(const ms_particle_path *p) {
  const double length = p->h * (ms_vec3_norm(p->v) + p->h * ms_vec3_norm(p->a) / 2);
  return fmin(MS_PATH_SMALL_ANGLE, sqrt(3 * p->x_error / length));
}

void ms_particle_path_compute(ms_particle_path *p) {
  enum { MOST = 1000 };
  ms_path_progress k = {.p = p,
                        .turn = find_turn(p),
                        .tolerance = 1e-14 * (ms_vec3_norm(p->v) + p->h * ms_vec3_norm(p->a))};
  p->impacts = 0, p->work = 0;
  p->touched.n = 0;
  for (int32_t i = 0; i < p->planes.nsolids && ms_path_surface_moves(&k); i++)
    k.tolerance = fmax(k.tolerance, 1e-14 * p->planes.moving->bounds[i].speed);
  begin_part(&k);
  start_path(&k);
  int i = 0;
  for (; i < MOST && k.t < p->h; i++) {
    double along[3] = {p->a[0], p->a[1], p->a[2]}, friction;
    k.contact = press(&k, p->v, along, &friction);
    k.is_partial = 0;
    const double left = k.end - k.t;
    const msim_plane *hit =
        k.contact.n ? follow_slide(&k, along, friction, left) : follow_flight(&k, left);
    const int ends = !hit && !k.is_partial;
    if (hit) handle_impact(&k, hit);
    if (ends && k.end == p->h) break;
    if (ends) k.t = k.end;
    if (k.t >= k.end && k.end < p->h) {
      begin_part(&k);
      handle_impact(&k, NULL);
    }
  }
  p->is_complete = i < MOST;
  ms_path_surface_place(&k, p->h, 1);
  leave_solids(p);
}

/* The parabola lies within the convex hull of its control points (at s, s + u/2 and `end`), and
 * within the length of the path from x. */
