/* stepper - force evaluations and reflections of a step, for all methods (integrator.h) */
#include <string.h>

#include "base/clock.h"
#include "integrate/contacts.h"
#include "physics/planes.h"

void ms_bound_stages(const ms_integrator *method, ms_stepper *s) {
  if (method->stages) s->bounds = ms_bounds_of(s->model);
}

void ms_hold_stages(const ms_stepper *s, double *stage) {
  const ms_rows *rows = &s->model->rows;
  memcpy(stage, s->x, (size_t)rows->dims * (size_t)rows->stride * sizeof *stage);
}

int ms_rests(const ms_stepper *s) { return s->events && s->events->ncontacts; }

/* Without springs the matrix is a scalar for each particle, and takes no constraints. */
void ms_hold_rows(ms_stepper *s, ms_request *request) {
  if (!ms_rests(s) || !(s->model->passes & MSIM_SKIP_SPRINGS)) return;
  ms_contacts_hold(s, request->h);
  request->hold = s->events->hold;
  request->nholds = s->events->ncontacts;
}

void ms_evaluate_on(ms_stepper *s, const ms_model *model, const ms_pass *pass) {
  double start = ms_clock();
  const int good = ms_pass_run(model, pass);
  s->finite = good && pass->v_to && (pass->x_to || pass->x == s->x_next);
  s->stats->force_evaluations++;
  s->stats->spring_evaluations += model->springs.n;
  s->stats->force_s += ms_clock() - start;
}

/* The same with particles in contact. The acceleration at s->x, s->v may be known. */
static void evaluate_at_planes(ms_stepper *s, const ms_pass *pass) {
  const ms_events *e = s->events;
  ms_pass all = *pass;
  if (!all.a) all.a = e->a_end;
  const int alone = !all.f && !all.v_to && !all.x_to;
  if (e->known && alone && all.x == s->x && all.v == s->v) ms_copy(s->model->shape, e->a, all.a);
  else ms_evaluate_on(s, s->model, &all);
  ms_contacts_push(s, &all);
}

void ms_evaluate(ms_stepper *s, const ms_pass *pass) {
  if (ms_rests(s)) evaluate_at_planes(s, pass);
  else ms_evaluate_on(s, s->model, pass);
}

ms_pass ms_kick_drift(const ms_stepper *s) {
  return (ms_pass){.x = s->x,
                   .v = s->v,
                   .v_to = s->v_next,
                   .v_from = s->v,
                   .h = s->h,
                   .x_to = s->x_next,
                   .x_from = s->x,
                   .drift = s->h};
}

void ms_acceleration(ms_stepper *s, const double *x, const double *v, double *a) {
  ms_evaluate(s, &(ms_pass){.x = x, .v = v, .a = a});
}

int ms_is_separable(const ms_stepper *s) {
  return !(s->model->passes & (MSIM_SKIP_DAMPING | MSIM_SKIP_DRAG)) && !ms_rests(s);
}

int64_t ms_reflect(ms_stepper *s, double *x, double *v) {
  if (!(s->model->passes & MSIM_SKIP_PLANES) || s->events) return 0;
  double start = ms_clock();
  int64_t reflected = ms_planes_reflect(s->model, x, v);
  s->stats->contacts += reflected;
  s->finite = 0;
  s->stats->collide_s += ms_clock() - start;
  return reflected;
}
