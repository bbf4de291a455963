#include "contact/solid_contact.h"

#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "contact/impact_time.h"
#include "contact/moving_obstacles.h"
#include "physics/rank_model.h"
#include "physics/signed_distance.h"

/*------------------------------------- moving solids --------------------------------------------*/

void ms_solid_contact_add_displacement(const ms_stepper *s, int32_t i, const double x[3],
                                       double displacement[3]) {
  const ms_collision_planes planes = ms_contact_set_planes(s);
  ms_solid room;
  if (!planes.moving) return;
  const ms_solid *start = ms_moving_obstacles_get(&planes, i, (ms_instant){.t = s->t}, &room);
  ms_moving_obstacles_add_displacement(start, &planes.solid[i], x, displacement);
}

void ms_solid_contact_move_to_end(ms_stepper *s) {
  const ms_collision_planes planes = ms_contact_set_planes(s);
  if (!planes.moving) return;
  ms_moving_obstacles_place(&planes, (ms_instant){.t = s->t + s->h, .before = 1});
  for (int32_t i = 0; i < s->events->ncontacts; i++) {
    ms_contact *c = &s->events->contact[i];
    double x[3];
    ms_solid_contact_set_frame(s, c);
    ms_unknowns_get(&s->model->unknowns, s->x, c->row, x);
    ms_vec3_axpy(1, c->frame.displacement, x);
    ms_solid_contact_set_tangents(s, c, x);
  }
}

void ms_solid_contact_set_frame(const ms_stepper *s, ms_contact *c) {
  const ms_collision_planes planes = ms_contact_set_planes(s);
  double x[3], displacement[MS_MAX_TOUCHED_PLANES][3] = {0}, of[MS_MAX_TOUCHED_PLANES][3] = {0};
  if (!planes.moving) return;
  c->frame.moves = 0;
  ms_unknowns_get(&s->model->unknowns, s->x, c->row, x);
  for (int i = 0; i < c->on.n; i++) {
    const int32_t solid = ms_contact_set_find_solid(s, c->on.plane[i]);
    if (solid < 0 || !ms_moving_obstacles_moves(&planes, solid)) continue;
    double at[3] = {x[0], x[1], x[2]};
    c->frame.moves = 1;
    ms_solid_contact_add_displacement(s, solid, x, displacement[i]);
    ms_vec3_axpy(1, displacement[i], at);
    ms_signed_distance_find_velocity(&planes.solid[solid], at, of[i]);
  }
  ms_moving_obstacles_combine(&c->on, displacement, c->frame.displacement);
  ms_moving_obstacles_combine(&c->on, of, c->frame.end);
  memcpy(c->frame.velocity, c->frame.end, sizeof c->frame.velocity);
  memset(c->frame.acceleration, 0, sizeof c->frame.acceleration);
}

int ms_solid_contact_any_moves(const ms_stepper *s) {
  int any = 0;
  for (int32_t i = 0; i < s->events->ncontacts && !any; i++)
    any = s->events->contact[i].frame.moves;
  return ms_rank_model_any(s->model, any);
}

double ms_solid_contact_find_work(ms_stepper *s, const double *v_start) {
  const ms_unknowns *rows = &s->model->unknowns;
  double sum = 0;
  if (!ms_solid_contact_any_moves(s)) return 0;
  ms_contact_set_free_acceleration(s, 1, s->x_next, s->v_next, s->events->a_end);
  for (int32_t i = 0; i < s->events->ncontacts; i++) {
    const ms_contact *c = &s->events->contact[i];
    double v[3], before[3], a[3];
    if (!c->frame.moves) continue;
    ms_unknowns_get(rows, s->v_next, c->row, v);
    ms_unknowns_get(rows, v_start, c->row, before);
    ms_unknowns_get(rows, s->events->a_end, c->row, a);
    for (int k = 0; k < 3; k++)
      sum += s->model->mass[c->row] * (v[k] - before[k] - s->h * a[k]) * c->frame.displacement[k] /
             s->h;
  }
  return sum;
}

/* x, its displacement relative to solid i, or to the frame of c (nullable), and its end */
static void get_positions(const ms_stepper *s, int32_t row, int32_t i, const ms_contact *c,
                          double x[3], double x_next[3], double displacement[3]) {
  ms_unknowns_get(&s->model->unknowns, s->x, row, x);
  ms_unknowns_get(&s->model->unknowns, s->x_next, row, x_next);
  double moved[3] = {0};
  if (i >= 0) ms_solid_contact_add_displacement(s, i, x, moved);
  ms_vec3_axpy(1, i >= 0 || !c ? moved : c->frame.displacement, x);
  for (int k = 0; k < 3; k++) displacement[k] = x_next[k] - x[k];
}

/*------------------------------------- impacts --------------------------------------------------*/

int ms_solid_contact_contains(const ms_stepper *s, const ms_contact *c, int32_t i) {
  for (int k = 0; c && k < c->on.n; k++)
    if (ms_contact_set_find_solid(s, c->on.plane[k]) == i) return 1;
  return 0;
}

/* The straight path decides: it stays inside a solid inside out, which is convex, if its end does;
 * others it may pass through. */
int ms_solid_contact_meets(const ms_stepper *s, int32_t row, const ms_contact *c, int32_t i,
                           double at[3]) {
  static const double none[3] = {0};
  ms_collision_planes planes = ms_contact_set_planes(s);
  planes.moving = NULL; /* the displacement is relative */
  const ms_solid *solid = &planes.solid[i];
  double x[3], x_next[3], displacement[3], n[3];
  if (ms_solid_contact_contains(s, c, i)) return 0;
  get_positions(s, row, i, NULL, x, x_next, displacement);
  const double tolerance = ms_impacts_distance_tolerance(&planes, x);
  const double end = ms_signed_distance(solid, x_next, n);
  memcpy(at, x_next, 3 * sizeof *at);
  const int is_convex_inside = solid->inside && !solid->samples;
  if (end < -tolerance && is_convex_inside) return 1;
  const double start = ms_signed_distance(solid, x, n), length = ms_vec3_norm(displacement);
  const double least =
      ms_obstacles_bound_distance(solid, start) + ms_obstacles_bound_distance(solid, end);
  const ms_parabola parabola = {.planes = &planes, .x = x, .v = displacement, .a = none};
  if (is_convex_inside || least > length + tolerance) return 0;
  const double share = start > tolerance ? ms_impact_time_find(&parabola, i, 0, 1, tolerance)
                       : ms_vec3_dot(n, displacement) < -tolerance ? 0
                                                                   : INFINITY;
  for (int k = 0; k < 3 && share <= 1; k++) at[k] = x[k] + share * displacement[k];
  return share <= 1 || end < -tolerance;
}

/*------------------------------------- surfaces -------------------------------------------------*/

void ms_solid_contact_set_tangents(const ms_stepper *s, const ms_contact *c, const double x[3]) {
  const ms_contact_set *e = s->events;
  for (int i = 0; i < c->on.n; i++) {
    const int32_t solid = ms_contact_set_find_solid(s, c->on.plane[i]);
    if (solid < 0) continue;
    ms_obstacles_set_tangent(&e->near.solid[solid], x, &e->tangent[c->on.plane[i] - e->tangent]);
  }
}

int ms_solid_contact_may_be_concave(const ms_stepper *s, const ms_contact *c) {
  for (int i = 0; i < c->on.n; i++) {
    const int32_t solid = ms_contact_set_find_solid(s, c->on.plane[i]);
    if (solid < 0) continue;
    if (s->events->near.solid[solid].inside || s->events->near.solid[solid].samples) return 1;
  }
  return 0;
}

/* The distance of x from solid i; 0 outside flat faces, which particles leave beyond edges */
static double find_distance(const ms_stepper *s, int32_t i, const double x[3],
                            const double displacement[3]) {
  const ms_solid *solid = &s->events->near.solid[i];
  double unused[3];
  const double distance = ms_signed_distance(solid, x, unused);
  return distance > 0 && !(ms_signed_distance_bend(solid, x, displacement) > 0) ? 0 : distance;
}

int ms_solid_contact_is_off(const ms_stepper *s, const ms_contact *c) {
  const double SMALL = 1e-3; /* part of the displacement */
  const ms_collision_planes planes = ms_contact_set_planes(s);
  double x[3], x_next[3], displacement[3];
  if (!c->has_solid) return 0;
  get_positions(s, c->row, -1, c, x, x_next, displacement);
  const double tolerance = ms_impacts_distance_tolerance(&planes, x);
  for (int i = 0; i < c->on.n; i++) {
    const int32_t solid = ms_contact_set_find_solid(s, c->on.plane[i]);
    if (solid >= 0 && fabs(find_distance(s, solid, x_next, displacement)) >
                          SMALL * ms_vec3_norm(displacement) + tolerance)
      return 1;
  }
  return 0;
}

/*------------------------------------- the end of a step ----------------------------------------*/

static int separates(const ms_contact *c, int i) {
  return c->leave[i] > ms_vec3_dot(c->on.plane[i]->normal, c->frame.end);
}

/* The planes and surfaces of the contact onto which x is to be moved: those that it is behind, and
 * with `all` also those of solids inside out that it left. */
static ms_plane_set find_left(const ms_stepper *s, const ms_contact *c, int all, double tolerance,
                              const double x[3]) {
  double from[3], displacement[3];
  ms_plane_set left = {0};
  ms_unknowns_get(&s->model->unknowns, s->x, c->row, from);
  for (int k = 0; k < 3; k++) displacement[k] = x[k] - from[k] - c->frame.displacement[k];
  for (int i = 0; i < c->on.n; i++) {
    const int32_t solid = ms_contact_set_find_solid(s, c->on.plane[i]);
    const double gap = solid < 0 ? ms_impacts_distance(c->on.plane[i], x)
                                 : find_distance(s, solid, x, displacement);
    const int may_curve_in =
        solid >= 0 && (s->events->near.solid[solid].inside || s->events->near.solid[solid].samples);
    if (gap < -tolerance || (all && may_curve_in && !separates(c, i) && gap > tolerance))
      left.plane[left.n++] = c->on.plane[i];
  }
  return left;
}

static int finish_contact(ms_stepper *s, const ms_contact *c, int keeps_distance) {
  enum { MOST = 8 };
  const ms_unknowns *rows = &s->model->unknowns;
  double x[3], v[3] = {0}, J[MS_MAX_INDEPENDENT_PLANES];
  ms_unknowns_get(rows, s->x_next, c->row, x);
  ms_unknowns_get(rows, s->v_next, c->row, v);
  const ms_collision_planes planes = ms_contact_set_planes(s);
  const double tolerance = ms_impacts_distance_tolerance(&planes, x);
  ms_plane_set left = find_left(s, c, !keeps_distance && !c->keeps, 0, x);
  if (!left.n) return 0;
  for (int i = 0; i < MOST && left.n; i++) {
    ms_solid_contact_set_tangents(s, c, x);
    ms_impacts_move_onto(&left, x);
    left = find_left(s, c, !keeps_distance && !c->keeps, tolerance, x);
  }
  ms_solid_contact_set_tangents(s, c, x);
  if (left.n) ms_unknowns_get(rows, s->x, c->row, x), ms_vec3_axpy(1, c->frame.displacement, x);
  if (left.n || c->sticks) memcpy(v, c->frame.end, sizeof v);
  else ms_impacts_set_normal_components(&c->on, c->leave, v, J);
  ms_unknowns_set(rows, x, c->row, s->x_next);
  ms_unknowns_set(rows, v, c->row, s->v_next);
  return 1;
}

int ms_solid_contact_finish(ms_stepper *s, int keeps_distance) {
  int changed = 0;
  for (int32_t i = 0; i < s->events->ncontacts; i++)
    if (s->events->contact[i].has_solid)
      changed |= finish_contact(s, &s->events->contact[i], keeps_distance);
  if (changed) s->finite = 0;
  return changed;
}
