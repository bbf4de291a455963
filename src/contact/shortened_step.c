#include "contact/shortened_step.h"

#include "contact/contact_change.h"
#include "contact/contact_impulses.h"

/* interpolate() expects an accepted step. */
void ms_shortened_step_interpolate(const ms_integrator *method, ms_stepper *s, double share) {
  double *x = s->events->stage[0], *v = s->events->stage[1];
  ms_stepper_swap(&s->x, &s->x_next), ms_stepper_swap(&s->v, &s->v_next);
  method->interpolate(s, share, x, v);
  ms_stepper_swap(&s->x, &s->x_next), ms_stepper_swap(&s->v, &s->v_next);
  ms_vector_copy(s->model->shape, x, s->x_next);
  ms_vector_copy(s->model->shape, v, s->v_next);
  s->h *= share;
}

int ms_shortened_step_is_possible(const ms_stepper *s) {
  return s->npaths == 0 && (s->dense_output || s->cached_stage_next);
}

/* The end of the whole step goes to the second spare pair. Its stage is none of the new end. */
static void shorten_step(const ms_integrator *method, ms_stepper *s, double share) {
  const int cached_stage = s->cached_stage;
  const double h = s->h;
  ms_vector_copy(s->model->shape, s->x_next, s->x_spare[1]);
  ms_vector_copy(s->model->shape, s->v_next, s->v_spare[1]);
  ms_stepper_init_stage(s, s->events->stage[0], s->events->stage[1]);
  s->cached_stage = s->cached_stage_next;
  ms_shortened_step_interpolate(method, s, share);
  s->cached_stage = cached_stage, s->cached_stage_next = 0;
  s->h_made = h;
  ms_contact_change_finish_substep(s);
}

void ms_shortened_step_end(const ms_integrator *method, ms_stepper *s, double share) {
  ms_contact_set *e = s->events;
  double *x = s->x, *v = s->v;
  if (e->moved) s->x = e->begin[0], s->v = e->begin[1];
  if (share < 1) shorten_step(method, s, share);
  ms_contact_impulses_add_lasting(method, s, s->v);
  s->x = x, s->v = v;
}
