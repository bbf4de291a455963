#include "contact/verlet_contact.h"

void ms_verlet_contact_correct_positions(ms_stepper *s, const double *a, double *v_predicted) {
  ms_contact_set *e = s->events;
  if (!e || !e->method_handles_contact) return;
  e->nfollowed = 0;
  for (int32_t r = 0; r < s->model->unknowns.nfree; r++) {
    ms_particle_path p = ms_contact_set_make_path(s, r, a, a);
    if (!ms_particle_path_may_touch(&p)) continue;
    e->followed[e->nfollowed++] = r;
    ms_particle_path_compute(&p);
    ms_unknowns_set(&s->model->unknowns, p.x, r, s->x_next);
    ms_unknowns_set(&s->model->unknowns, p.v, r, v_predicted);
    s->stats->contacts += p.impacts;
  }
}

void ms_verlet_contact_correct_velocities(ms_stepper *s, const double *a, const double *a_next) {
  const ms_contact_set *e = s->events;
  if (!e || !e->method_handles_contact) return;
  for (int32_t i = 0; i < e->nfollowed; i++) {
    ms_particle_path p = ms_contact_set_make_path(s, e->followed[i], a, a_next);
    ms_particle_path_compute(&p);
    ms_unknowns_set(&s->model->unknowns, p.w, e->followed[i], s->v_next);
  }
  if (e->nfollowed) s->finite = 0;
}
