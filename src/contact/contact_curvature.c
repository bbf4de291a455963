#include "contact/contact_curvature.h"

#include <string.h>

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

/* The curvature of a solid at x, normal n, along its surface; > 0: it bends away. *flat: the axis
 * along which it does not bend, as of a cylinder; NULL: it is the same in all directions. Its trace
 * is that of dn/dx, n.dn/dx n = 0. */
static double find_curvature(const ms_solid *solid, const double x[3], const double n[3],
                             const double **flat) {
  const double *axis = solid->axis[2], share = ms_vec3_dot(n, axis);
  double bend[3];
  for (int k = 0; k < 3; k++) bend[k] = ms_signed_distance_bend(solid, x, solid->axis[k]);
  const double trace = bend[0] + bend[1] + bend[2];
  /* on a sphere c (1 - share^2), c = trace/2; on a cylinder 0 */
  const int is_flat = fabs(bend[2] + share * share * trace / 2) < fabs(trace) / 4;
  *flat = is_flat ? axis : NULL;
  return is_flat ? trace : trace / 2;
}

/* The curvature of a solid along the line in which it meets another obstacle */
static double find_curvature_of_line(const ms_solid *solid, const double x[3], const double m[3],
                                     const double n[3]) {
  const double along[3] = {m[1] * n[2] - m[2] * n[1], m[2] * n[0] - m[0] * n[2],
                           m[0] * n[1] - m[1] * n[0]};
  return ms_signed_distance_bend(solid, x, along) / ms_vec3_dot(along, along);
}

/* Adds the stiffness by the curvature of one surface, or along the line in which two meet, as
 * friction; returns 0 if samples have another one at their edges. */
static int add_curvature(const ms_stepper *s, const ms_contact *c, ms_constraint *to) {
  static const double zero[MS_MAX_TOUCHED_PLANES] = {0};
  double x[3], a[3], J[MS_MAX_INDEPENDENT_PLANES] = {0};
  int is_exact = 1;
  ms_unknowns_get(&s->model->unknowns, s->x, c->row, x);
  ms_unknowns_get(&s->model->unknowns, s->events->a, c->row, a);
  ms_impacts_set_normal_components(&c->on, zero, a, J);
  for (int k = 0; k < c->on.n; k++) {
    const int32_t i = ms_contact_set_find_solid(s, c->on.plane[k]);
    const double *flat = NULL, *n = c->on.plane[k]->normal;
    if (i < 0) continue;
    const ms_solid *solid = &s->events->near.solid[i];
    is_exact &= !solid->samples;
    const double curvature = c->on.n == 1
                                 ? find_curvature(solid, x, n, &flat)
                                 : find_curvature_of_line(solid, x, n, c->on.plane[1 - k]->normal);
    to->friction -= s->model->mass[c->row] * J[k] * curvature;
    if (flat) memcpy(to->direction[1], flat, sizeof to->direction[1]);
  }
  return is_exact;
}

int ms_contact_curvature_constrain(ms_stepper *s, double least, ms_linear_system_spec *spec) {
  const ms_contact_set *e = s->events;
  int is_exact = 1;
  if (!e || !(s->model->features & MS_HAS_SPRINGS)) return !e; /* the matrix takes none */
  ms_contact_set_make_constraints(s, spec->h);
  spec->constraint = e->constraint, spec->nconstraints = e->ncontacts;
  for (int32_t i = 0; i < e->ncontacts; i++) {
    const ms_contact *c = &e->contact[i];
    if (!c->has_solid || c->sticks || c->enters || c->on.n > 2) continue;
    is_exact &= add_curvature(s, c, &e->constraint[i]);
    e->constraint[i].friction = spec->h * spec->h * fmax(least, e->constraint[i].friction);
  }
  return is_exact;
}
