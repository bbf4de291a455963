#include "contact/contact_curvature.h"

#include "base/vec3.h"
#include "physics/signed_distance.h"

void ms_contact_curvature_update(ms_stepper *s) {
  ms_contact_set_update(s);
  ms_contact_set_require_acceleration(s, 1);
  for (int32_t i = 0; i < s->events->ncontacts; i++) {
    ms_contact *c = &s->events->contact[i];
    c->sticks = c->fixed || (c->has_friction && c->sticks);
  }
}

/* The sum of the principal curvatures of a solid at x, the trace of dn/dx; > 0: it bends away. */
static double find_curvature(const ms_solid *solid, const double x[3]) {
  double sum = 0;
  for (int c = 0; c < 3; c++) {
    const double along[3] = {c == 0, c == 1, c == 2};
    sum += ms_signed_distance_bend(solid, x, along);
  }
  return sum;
}

/* The stiffness of a contact with one solid by its curvature, the same in all directions along the
 * surface */
static double find_stiffness(const ms_stepper *s, const ms_contact *c, const ms_solid *solid,
                             int *is_exact) {
  const ms_unknowns *rows = &s->model->unknowns;
  const double *n = c->on.plane[0]->normal;
  double x[3], a[3];
  ms_unknowns_get(rows, s->x, c->row, x);
  ms_unknowns_get(rows, s->events->a, c->row, a);
  const double reaction = -s->model->mass[c->row] * ms_vec3_dot(n, a);
  const double curvature = find_curvature(solid, x);
  if (solid->type == MSIM_COLLIDER_SPHERE) return -reaction * curvature / 2;
  *is_exact &= curvature == 0;
  return fmax(0, -reaction * curvature);
}

int ms_contact_curvature_make_constraints(ms_stepper *s, double h, double least) {
  const ms_contact_set *e = s->events;
  int is_exact = 1;
  ms_contact_set_make_constraints(s, h);
  for (int32_t i = 0; i < e->ncontacts; i++) {
    const ms_contact *c = &e->contact[i];
    const int32_t solid = ms_contact_set_find_solid(s, c->on.plane[0]);
    if (c->sticks || c->enters || c->on.n > 1 || solid < 0) continue;
    const double stiffness = find_stiffness(s, c, &e->near.solid[solid], &is_exact);
    e->constraint[i].friction = h * h * fmax(least, stiffness);
  }
  return is_exact;
}
