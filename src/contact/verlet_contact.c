#include "contact/verlet_contact.h"

#include "contact/broad_phase.h"
#include "contact/contact_impulses.h"
#include "contact/impact_time.h"
#include "contact/moving_obstacles.h"

void ms_verlet_contact_correct_positions(ms_stepper *s, const double *a, double *v_predicted) {
  ms_contact_set *e = s->events;
  if (!e || !e->method_handles_contact) return;
  e->nfollowed = 0;
  const ms_collision_planes planes = ms_contact_set_planes(s);
  const ms_instant start = {.t = s->t};
  ms_broad_phase near = {
      .model = s->model, .planes = &planes, .x = s->x, .v = s->v, .a = a, .h = s->h};
  ms_moving_obstacles_place(&planes, start);
  for (int32_t r = ms_broad_phase_next(&near, 0); r < s->model->unknowns.nfree;
       r = ms_broad_phase_next(&near, r + 1)) {
    double x[3], v[3], b[3];
    const ms_parabola parabola = {.planes = &planes, .t = s->t, .x = x, .v = v, .a = b};
    ms_unknowns_get(&s->model->unknowns, s->x, r, x);
    ms_unknowns_get(&s->model->unknowns, s->v, r, v);
    ms_unknowns_get(&s->model->unknowns, a, r, b);
    if (!ms_impact_time_may_touch(&parabola, s->h)) continue;
    ms_particle_path p = ms_contact_set_make_path(s, r, a, a);
    e->followed[e->nfollowed++] = r;
    p.without_w = 1;
    ms_particle_path_compute(&p);
    s->paths++;
    ms_unknowns_set(&s->model->unknowns, p.x, r, s->x_next);
    ms_unknowns_set(&s->model->unknowns, p.v, r, v_predicted);
    s->stats->contacts += p.impacts;
    ms_moving_obstacles_place(&planes, start); /* the path moved them */
  }
}

void ms_verlet_contact_correct_velocities(ms_stepper *s, const double *a, const double *a_next) {
  const ms_contact_set *e = s->events;
  if (!e || !e->method_handles_contact) return;
  for (int32_t i = 0; i < e->nfollowed; i++) {
    ms_particle_path p = ms_contact_set_make_path(s, e->followed[i], a, a_next);
    const double v[3] = {p.w[0], p.w[1], p.w[2]};
    ms_particle_path_compute(&p);
    s->paths++;
    ms_contact_impulses_add_path(s, e->followed[i], &p, v);
    s->work_in_step += s->model->mass[e->followed[i]] * p.work;
    ms_unknowns_set(&s->model->unknowns, p.w, e->followed[i], s->v_next);
  }
  if (e->nfollowed) s->finite = 0;
}
