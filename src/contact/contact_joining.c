#include "contact/contact_joining.h"

#include <stdlib.h>

#include "base/vec3.h"
#include "contact/broad_phase.h"
#include "contact/solid_contact.h"
#include "physics/external_force.h"
#include "physics/rank_model.h"
#include "physics/signed_distance.h"

/* Adds the planes that an unknown is behind at the end of the step to `on`. */
static void add_planes(const ms_stepper *s, int32_t row, ms_plane_set *on) {
  const ms_collision_planes planes = ms_contact_set_planes(s);
  double x[3];
  ms_unknowns_get(&s->model->unknowns, s->x_next, row, x);
  const double tolerance = ms_impacts_distance_tolerance(&planes, x);
  for (const msim_plane *p = planes.plane; p < planes.plane + planes.n - planes.nsolids; p++)
    if (on->n < MS_MAX_INDEPENDENT_PLANES && !ms_impacts_contains_plane(on, p) &&
        ms_impacts_distance(p, x) < -tolerance)
      on->plane[on->n++] = p;
}

/* The same for tangent planes of solids that it meets */
static void add_tangents(ms_stepper *s, ms_contact *c) {
  double at[3];
  for (int32_t i = 0; i < s->events->near.nsolids && c->on.n < MS_MAX_INDEPENDENT_PLANES; i++)
    if (ms_solid_contact_meets(s, c->row, c, i, at)) ms_contact_set_add_tangent(s, c, i, at);
}

int ms_contact_joining_is_new(const ms_stepper *s, int32_t row, const ms_contact *c) {
  ms_plane_set on = c ? c->on : (ms_plane_set){0};
  const int before = on.n;
  double at[3];
  add_planes(s, row, &on);
  for (int32_t i = 0; i < s->events->near.nsolids && on.n == before; i++)
    if (ms_solid_contact_meets(s, row, c, i, at)) return 1;
  return on.n > before;
}

/* The unknowns that may meet obstacles in the step; planes: outlives it */
static ms_broad_phase begin_broad_phase(const ms_stepper *s, const ms_collision_planes *planes) {
  return (ms_broad_phase){
      .model = s->model, .planes = planes, .x = s->x, .x_end = s->x_next, .h = s->h};
}

int ms_contact_joining_any_is_new(const ms_stepper *s) {
  const ms_collision_planes planes = ms_contact_set_planes(s);
  ms_broad_phase near = begin_broad_phase(s, &planes);
  int32_t next = 0;
  int found = 0;
  for (int32_t r = ms_broad_phase_next(&near, 0); r < s->model->unknowns.nfree && !found;
       r = ms_broad_phase_next(&near, r + 1))
    found = ms_contact_joining_is_new(s, r, ms_contact_set_lookup(s->events, r, &next));
  return ms_rank_model_any(s->model, found);
}

static int compare_rows(const void *a, const void *b) {
  const ms_contact *first = a, *second = b;
  return (first->row > second->row) - (first->row < second->row);
}

int32_t ms_contact_joining_add_penetrating(ms_stepper *s, int keeps) {
  ms_contact_set *e = s->events;
  int32_t nnew = 0, changed = 0, next = 0;
  const ms_collision_planes planes = ms_contact_set_planes(s);
  ms_broad_phase near = begin_broad_phase(s, &planes);
  for (int32_t r = ms_broad_phase_next(&near, 0); r < s->model->unknowns.nfree;
       r = ms_broad_phase_next(&near, r + 1)) {
    ms_contact *c = ms_contact_set_lookup(e, r, &next);
    ms_contact with = c ? *c : (ms_contact){.row = r, .is_prescribed = 1};
    const int before = with.on.n;
    add_planes(s, r, &with.on);
    add_tangents(s, &with);
    if (with.on.n == before) continue;
    changed++;
    with.enters = 1;
    with.keeps = keeps;
    if (c) *c = with;
    else e->contact[e->ncontacts + nnew++] = with;
  }
  e->ncontacts += nnew;
  qsort(e->contact, (size_t)e->ncontacts, sizeof *e->contact, compare_rows);
  s->stats->contacts += ms_rank_model_count(s->model, nnew);
  return changed;
}

/* A solid that an unknown may meet in a step, at the end of the step */
typedef struct approach {
  double at[3];     /* where the point of the solid at the unknown has moved */
  double normal[3]; /* of the solid there */
  double gap;       /* m: the distance there */
  double end;       /* m: the distance after the relative displacement h v */
} approach;

/* 1: an unknown at x, with velocity v, may end in solid i, which curves outwards. c: its contact;
 * g: a bound on its acceleration by external forces */
static int approaches(const ms_stepper *s, const ms_contact *c, double g, int32_t i,
                      const double x[3], const double v[3], approach *to) {
  const ms_solid *solid = &s->events->near.solid[i];
  if (c && c->on.n >= MS_MAX_INDEPENDENT_PLANES) return 0;
  if (solid->inside || ms_solid_contact_contains(s, c, i)) return 0;
  double moved[3] = {0}, displacement[3];
  ms_solid_contact_add_displacement(s, i, x, moved);
  for (int k = 0; k < 3; k++) to->at[k] = x[k] + moved[k], displacement[k] = s->h * v[k] - moved[k];
  to->gap = ms_signed_distance(solid, to->at, to->normal);
  if (to->gap > 2 * (ms_vec3_norm(displacement) + s->h * s->h * g)) return 0;
  to->end = to->gap + ms_vec3_dot(to->normal, displacement);
  return 1;
}

static double find_external_acceleration(const ms_stepper *s, int32_t row) {
  return ms_external_acceleration(&s->model->external) + ms_model_force_acceleration(s->model, row);
}

/* The first row that approaches a solid; nfree: there is none. */
static int32_t find_first_approach(const ms_stepper *s) {
  const ms_unknowns *rows = &s->model->unknowns;
  int32_t next = 0;
  for (int32_t r = 0; r < rows->nfree && s->events->near.nsolids > 0; r++) {
    const ms_contact *c = ms_contact_set_lookup(s->events, r, &next);
    const double g = find_external_acceleration(s, r);
    double x[3], v[3];
    approach unused;
    ms_unknowns_get(rows, s->x, r, x);
    ms_unknowns_get(rows, s->v, r, v);
    for (int32_t i = 0; i < s->events->near.nsolids; i++)
      if (approaches(s, c, g, i, x, v, &unused)) return r;
  }
  return rows->nfree;
}

/* Adds the tangent planes of solids that curve outwards in which the unknown would end, moved by
 * h v + h^2 a, a its free acceleration at the start, relative to the displacement of the solid.
 * Returns the number of those that it would enter even without forces. */
static int add_predicted_planes(ms_stepper *s, ms_contact *c) {
  const ms_unknowns *rows = &s->model->unknowns;
  const ms_collision_planes planes = ms_contact_set_planes(s);
  const double g = find_external_acceleration(s, c->row);
  double x[3], v[3], a[3];
  int enters = 0;
  ms_unknowns_get(rows, s->x, c->row, x);
  ms_unknowns_get(rows, s->v, c->row, v);
  ms_unknowns_get(rows, s->events->a, c->row, a);
  const double tolerance = ms_impacts_distance_tolerance(&planes, x);
  for (int32_t i = 0; i < s->events->near.nsolids; i++) {
    approach to;
    if (!approaches(s, c, g, i, x, v, &to)) continue;
    if (to.end + s->h * s->h * ms_vec3_dot(to.normal, a) >= -tolerance) continue;
    ms_contact_set_add_tangent(s, c, i, to.at);
    enters += to.end < -tolerance;
  }
  return enters;
}

int64_t ms_contact_joining_add_predicted(ms_stepper *s) {
  ms_contact_set *e = s->events;
  int32_t nnew = 0, next = 0;
  int64_t impacts = 0;
  const int32_t first = find_first_approach(s);
  if (!ms_contact_set_require_acceleration(s, first < s->model->unknowns.nfree)) return 0;
  for (int32_t r = first; r < s->model->unknowns.nfree; r++) {
    ms_contact *c = ms_contact_set_lookup(e, r, &next);
    ms_contact with = c ? *c : (ms_contact){.row = r, .is_prescribed = 1};
    const int before = with.on.n;
    impacts += add_predicted_planes(s, &with);
    if (with.on.n == before) continue;
    if (c) *c = with;
    else e->contact[e->ncontacts + nnew++] = with;
  }
  e->ncontacts += nnew;
  if (nnew) qsort(e->contact, (size_t)e->ncontacts, sizeof *e->contact, compare_rows);
  ms_contact_set_share(s);
  return ms_rank_model_count(s->model, impacts);
}
