#include "contact/solid_contact.h"

#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "physics/signed_distance.h"

static void get_positions(const ms_stepper *s, int32_t row, double x[3], double x_next[3],
                          double way[3]) {
  ms_unknowns_get(&s->model->unknowns, s->x, row, x);
  ms_unknowns_get(&s->model->unknowns, s->x_next, row, x_next);
  for (int c = 0; c < 3; c++) way[c] = x_next[c] - x[c];
}

/*------------------------------------- impacts --------------------------------------------------*/

static int contains_solid(const ms_stepper *s, const ms_contact *c, int32_t i) {
  for (int k = 0; c && k < c->on.n; k++)
    if (ms_contact_set_find_solid(s, c->on.plane[k]) == i) return 1;
  return 0;
}

/* The straight way decides: it stays inside a solid inside out, which is convex, if its end does;
 * others it may pass through. */
int ms_solid_contact_meets(const ms_stepper *s, int32_t row, const ms_contact *c, int32_t i,
                           double at[3]) {
  static const double none[3] = {0};
  const ms_collision_planes planes = ms_contact_set_planes(s);
  const ms_solid *solid = &planes.solid[i];
  double x[3], x_next[3], way[3], n[3];
  if (contains_solid(s, c, i)) return 0;
  get_positions(s, row, x, x_next, way);
  const double tolerance = ms_impacts_distance_tolerance(&planes, x);
  const double end = ms_signed_distance(solid, x_next, n);
  memcpy(at, x_next, 3 * sizeof *at);
  if (end < -tolerance && solid->inside) return 1;
  const double start = ms_signed_distance(solid, x, n), length = ms_vec3_norm(way);
  if (solid->inside || start + end > length + tolerance) return 0;
  const double share = start > tolerance
                           ? ms_obstacles_time_to_solid(solid, x, way, none, 0, 1, tolerance)
                       : ms_vec3_dot(n, way) < -tolerance ? 0
                                                          : INFINITY;
  for (int k = 0; k < 3 && share <= 1; k++) at[k] = x[k] + share * way[k];
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

int ms_solid_contact_is_inside_out(const ms_stepper *s, const ms_contact *c) {
  for (int i = 0; i < c->on.n; i++) {
    const int32_t solid = ms_contact_set_find_solid(s, c->on.plane[i]);
    if (solid >= 0 && s->events->near.solid[solid].inside) return 1;
  }
  return 0;
}

/* The distance of x from solid i; 0 outside flat faces, which particles leave beyond edges */
static double find_distance(const ms_stepper *s, int32_t i, const double x[3],
                            const double way[3]) {
  const ms_solid *solid = &s->events->near.solid[i];
  double unused[3];
  const double distance = ms_signed_distance(solid, x, unused);
  return distance > 0 && !(ms_signed_distance_bend(solid, x, way) > 0) ? 0 : distance;
}

int ms_solid_contact_is_off(const ms_stepper *s, const ms_contact *c) {
  const double SMALL = 1e-3; /* part of the way */
  const ms_collision_planes planes = ms_contact_set_planes(s);
  double x[3], x_next[3], way[3];
  if (!c->has_solid) return 0;
  get_positions(s, c->row, x, x_next, way);
  const double tolerance = ms_impacts_distance_tolerance(&planes, x);
  for (int i = 0; i < c->on.n; i++) {
    const int32_t solid = ms_contact_set_find_solid(s, c->on.plane[i]);
    if (solid >= 0 &&
        fabs(find_distance(s, solid, x_next, way)) > SMALL * ms_vec3_norm(way) + tolerance)
      return 1;
  }
  return 0;
}

/*------------------------------------- the end of a step ----------------------------------------*/

/* The planes and surfaces of the contact onto which x is to be moved: those that it is behind, and
 * with `all` also those that it left by less than an edge. */
static ms_plane_set find_left(const ms_stepper *s, const ms_contact *c, int all,
                              const double x[3]) {
  const ms_collision_planes planes = ms_contact_set_planes(s);
  const double tolerance = ms_impacts_distance_tolerance(&planes, x);
  double from[3], way[3];
  ms_plane_set left = {0};
  ms_unknowns_get(&s->model->unknowns, s->x, c->row, from);
  for (int k = 0; k < 3; k++) way[k] = x[k] - from[k];
  for (int i = 0; i < c->on.n; i++) {
    const int32_t solid = ms_contact_set_find_solid(s, c->on.plane[i]);
    const double gap =
        solid < 0 ? ms_impacts_distance(c->on.plane[i], x) : find_distance(s, solid, x, way);
    if (gap < -tolerance || (all && c->leave[i] == 0 && gap > tolerance))
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
  ms_plane_set left = find_left(s, c, !keeps_distance, x);
  if (!left.n) return 0;
  for (int i = 0; i < MOST && left.n; i++) {
    ms_solid_contact_set_tangents(s, c, x);
    ms_impacts_move_onto(&left, x);
    left = find_left(s, c, !keeps_distance, x);
  }
  ms_solid_contact_set_tangents(s, c, x);
  if (left.n) ms_unknowns_get(rows, s->x, c->row, x);
  if (left.n || c->sticks) memset(v, 0, sizeof v);
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
