#include "contact/contact_impulses.h"

#include "base/vec3.h"
#include "contact/contact_log.h"

/* The number of a plane, or tangent plane, as in ms_touch */
static int32_t find_number(const ms_stepper *s, const msim_plane *plane) {
  const ms_contact_set *e = s->events;
  const ms_obstacles *o = &e->near;
  if (!o->plane) return (int32_t)(plane - s->model->scene->planes);
  const int is_shared = plane >= o->plane && plane < o->plane + o->nplanes + o->nsolids;
  return o->number[is_shared ? plane - o->plane : o->nplanes + e->solid[plane - e->tangent]];
}

void ms_contact_impulses_add(const ms_stepper *s, int32_t row, const ms_plane_set *on,
                             const double x[3], const double from[3], const double to[3]) {
  int32_t number[MS_MAX_TOUCHED_PLANES];
  if (!s->contact_log || on->n == 0) return;
  const double dv[3] = {to[0] - from[0], to[1] - from[1], to[2] - from[2]};
  for (int i = 0; i < on->n; i++) number[i] = find_number(s, on->plane[i]);
  ms_contact_log_share(s->contact_log, row, on, number, x, dv);
}

void ms_contact_impulses_add_path(const ms_stepper *s, int32_t row, const ms_particle_path *p,
                                  const double v[3]) {
  double flown[3] = {v[0], v[1], v[2]};
  ms_vec3_axpy(p->h / 2, p->b0, flown), ms_vec3_axpy(p->h / 2, p->b1, flown);
  ms_contact_impulses_add(s, row, &p->touched, p->x, flown, p->w);
}

void ms_contact_impulses_add_lasting(const ms_integrator *method, const ms_stepper *s,
                                     const double *v_start) {
  const double by_end = s->h * (method->entry.order > 1 ? 0.5 : method->entry.implicit);
  const ms_unknowns *rows = &s->model->unknowns;
  const ms_contact_set *e = s->events;
  int32_t next = 0;
  for (int32_t i = 0; i < e->ncontacts && s->contact_log; i++) {
    const ms_contact *c = &e->contact[i];
    double x[3], v[2][3], a[2][3];
    while (next < e->nfollowed && e->followed[next] < c->row) next++;
    if (next < e->nfollowed && e->followed[next] == c->row) continue;
    ms_unknowns_get(rows, s->x_next, c->row, x);
    ms_unknowns_get(rows, v_start, c->row, v[0]);
    ms_unknowns_get(rows, s->v_next, c->row, v[1]);
    ms_unknowns_get(rows, e->a, c->row, a[0]);
    ms_unknowns_get(rows, e->a_end, c->row, a[1]);
    ms_vec3_axpy(s->h - by_end, a[0], v[0]), ms_vec3_axpy(by_end, a[1], v[0]);
    ms_contact_impulses_add(s, c->row, &c->on, x, v[0], v[1]);
  }
}
