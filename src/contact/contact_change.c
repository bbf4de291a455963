#include "contact/contact_change.h"

#include <math.h>

#include "base/vec3.h"
#include "contact/friction.h"
#include "physics/signed_distance.h"

/* 1 if v turns by more than 45 degrees in h, or if its direction is stiff: velocity across v decays
 * at the rate F/|v|, F the friction over mass. Straight motion has none. v: at both ends; a: at the
 * second */
static int turns_sharply(const ms_contact *c, double h, double v[2][3], const double a[3]) {
  double along[3] = {a[0], a[1], a[2]};
  if (!c->has_friction || c->sticks || c->fixed || c->bounces) return 0;
  ms_impacts_remove_normal(&c->on, along, NULL);
  const double ahead = ms_vec3_dot(c->sliding_direction, along),
               across2 = ms_vec3_dot(along, along) - ahead * ahead;
  const int is_straight = across2 <= 1e-12 * ahead * ahead;
  return (c->stop < h && !is_straight) ||
         ms_vec3_dot(v[0], v[1]) < sqrt(0.5) * ms_vec3_norm(v[0]) * ms_vec3_norm(v[1]);
}

/* Friction margin (m/s^2): how much larger |a_t| may become before a sticking particle slips */
static double friction_margin(const ms_contact *c, const double a[3]) {
  double along[3] = {a[0], a[1], a[2]};
  const double pull = ms_impacts_remove_normal(&c->on, along, NULL);
  return pull - ms_vec3_norm(along);
}

/* The share of the substep after which g, linear in time, falls below 0 */
static double crossing(double g0, double g1) { return g0 > 0 ? g0 / (g0 - g1) : 0; }

/* The largest centrifugal acceleration from the solids of a contact, v.(dn/dx) v */
static double find_centrifugal(const ms_stepper *s, const ms_contact *c, const double v[3]) {
  double most = -INFINITY, x[3];
  if (!c->has_solid) return 0;
  ms_unknowns_get(&s->model->unknowns, s->x, c->row, x);
  for (int i = 0; i < c->on.n; i++) {
    const int32_t solid = ms_contact_set_find_solid(s, c->on.plane[i]);
    const ms_solid *of = s->events->near.solid + solid;
    most = fmax(most, solid >= 0 ? ms_signed_distance_bend(of, x, v) : 0);
  }
  return most;
}

/* The share of the substep after which a sliding particle stops, as with constant a0 */
static double find_stop(const ms_contact *c, double h, const double v[3], double a0[3]) {
  if (c->bounces || c->fixed || c->sticks || !c->has_friction) return MS_NOWHERE;
  const double friction = ms_impacts_remove_normal(&c->on, a0, NULL);
  const double stop = ms_friction_stop(a0, friction, v) / h;
  return stop <= 1 ? stop : MS_NOWHERE;
}

/* The share of the substep after which a sliding particle is slowest, as with the constant
 * acceleration b = a0 - F v/|v|, F the friction over mass: |v + t b| is least at t = -v.b/|b|^2. */
static double find_slowest(const ms_contact *c, double h, const double v[3], const double a0[3]) {
  double b[3] = {a0[0], a0[1], a0[2]};
  const double friction = ms_impacts_remove_normal(&c->on, b, NULL);
  ms_vec3_axpy(-friction, c->sliding_direction, b);
  const double share = -ms_vec3_dot(v, b) / (h * ms_vec3_dot(b, b));
  return share > 0 && share <= 1 ? share : MS_NOWHERE;
}

/* ms_contact.change. v: at the start; a0, a1: free accelerations at both ends */
static double find_change(const ms_contact *c, double h, const double v[3], double a0[3],
                          const double a1[3], double centrifugal) {
  if (c->bounces) return MS_NOWHERE;
  const double tolerance = MS_REACTION_TOLERANCE * ms_vec3_norm(a1),
               push = ms_contact_set_reaction(c, a1) - centrifugal;
  if (push < -tolerance) return crossing(ms_contact_set_reaction(c, a0) - centrifugal, push);
  if (c->fixed || (c->sticks && friction_margin(c, a1) >= -tolerance)) return MS_NOWHERE;
  if (c->sticks) return crossing(friction_margin(c, a0), friction_margin(c, a1));
  return find_stop(c, h, v, a0);
}

/* Sets `change` by the substep just made, with free accelerations a and a_end. */
static void update_change(const ms_stepper *s, ms_contact *c) {
  const ms_unknowns *rows = &s->model->unknowns;
  double v[2][3], a[2][3];
  ms_unknowns_get(rows, s->v, c->row, v[0]);
  ms_unknowns_get(rows, s->v_next, c->row, v[1]);
  ms_unknowns_get(rows, s->events->a, c->row, a[0]);
  ms_unknowns_get(rows, s->events->a_end, c->row, a[1]);
  c->turns = turns_sharply(c, s->h, v, a[1]);
  c->slowest = c->turns ? find_slowest(c, s->h, v[0], a[0]) : MS_NOWHERE;
  c->change = find_change(c, s->h, v[0], a[0], a[1], find_centrifugal(s, c, v[1]));
}

void ms_contact_change_finish_substep(ms_stepper *s) {
  const ms_contact_set *e = s->events;
  if (!ms_stepper_has_contacts(s)) return;
  ms_contact_set_place(s);
  ms_contact_set_free_acceleration(s, 1, s->x_next, s->v_next, e->a_end);
  for (int32_t i = 0; i < e->ncontacts; i++) update_change(s, &e->contact[i]);
}

int ms_contact_change_any_stops(const ms_stepper *s) {
  const ms_contact_set *e = s->events;
  int any = 0;
  for (int32_t i = 0; i < e->ncontacts && !any; i++) {
    double v[3], a[3];
    ms_unknowns_get(&s->model->unknowns, s->v, e->contact[i].row, v);
    ms_unknowns_get(&s->model->unknowns, e->a, e->contact[i].row, a);
    any = find_stop(&e->contact[i], s->h, v, a) <= 1;
  }
  return any;
}
