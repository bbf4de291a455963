/* stepper - force evaluations and reflections of a step, for all methods (integrator.h) */
#include <math.h>

#include "base/clock.h"
#include "contact/contact_joining.h"
#include "contact/reflection.h"
#include "physics/rank_model.h"
#include "physics/single.h"

void ms_stepper_set_bounds(const ms_integrator *method, ms_stepper *s) {
  if (method->nonlinear || method->needs_bounds || s->model->features & MS_HAS_PLANES)
    s->bounds = ms_bounds_compute_island(s->model);
}

void ms_stepper_init_stage(const ms_stepper *s, double *x, double *v) {
  ms_vector_copy_all(s->model->state_shape, s->x, x);
  if (v) ms_vector_copy_all(s->model->state_shape, s->v, v);
}

int ms_stepper_has_contacts(const ms_stepper *s) {
  return s->events && (s->events->ncontacts || s->events->others_have_contacts);
}

void ms_stepper_copy_contacts(const ms_stepper *s, const double *v, double *v_to) {
  for (int32_t i = 0; s->events && i < s->events->ncontacts; i++) {
    const int32_t row = s->events->contact[i].row;
    double of[3];
    ms_unknowns_get(&s->model->unknowns, v, row, of);
    ms_unknowns_set(&s->model->unknowns, of, row, v_to);
  }
}

void ms_stepper_remove_constrained(const ms_stepper *s, double *vec) {
  for (int32_t i = 0; s->events && i < s->events->ncontacts; i++) {
    const ms_contact *c = &s->events->contact[i];
    double along[3] = {0};
    if (!c->sticks) ms_unknowns_get(&s->model->unknowns, vec, c->row, along);
    if (!c->sticks) ms_impacts_remove_normal(&c->on, along, NULL);
    ms_unknowns_set(&s->model->unknowns, along, c->row, vec);
  }
}

int ms_stepper_may_be_rejected(const ms_stepper *s) { return s->events && s->events->may_reject; }

int ms_stepper_is_rejected(ms_stepper *s) {
  s->events->may_reject = 0;
  return s->events->rejected = ms_contact_joining_any_is_new(s);
}

/* Without springs the matrix is a scalar for each particle, and takes no constraints. */
void ms_stepper_add_constraints(ms_stepper *s, ms_linear_system_spec *spec) {
  if (!ms_stepper_has_contacts(s) || !(s->model->features & MS_HAS_SPRINGS)) return;
  ms_contact_set_make_constraints(s, spec->h);
  spec->guess = s->events->guess;
  spec->continues = s->events->continues;
  spec->rtol = fmax(spec->rtol, s->events->draft_rtol);
  spec->max_iterations = s->events->most_iterations;
  spec->constraint = s->events->constraint;
  spec->nconstraints = s->events->ncontacts;
}

/* The same with particles in contact. The acceleration at s->x, s->v may be known. */
static void evaluate_at_planes(ms_stepper *s, const ms_fused_step *sweep) {
  const ms_contact_set *e = s->events;
  ms_fused_step all = *sweep;
  if (!all.a) all.a = e->a_end;
  const int alone = !all.f && !all.v_to && !all.x_to;
  if (e->a_is_known && alone && all.x == s->x && all.v == s->v)
    ms_vector_copy(s->model->state_shape, e->a, all.a);
  else ms_stepper_evaluate_model(s, s->model, &all);
  ms_contact_set_add_reactions(s, &all);
}

void ms_stepper_evaluate(ms_stepper *s, const ms_fused_step *sweep) {
  if (ms_stepper_has_contacts(s)) evaluate_at_planes(s, sweep);
  else ms_stepper_evaluate_model(s, s->model, sweep);
}

ms_fused_step ms_stepper_kick_drift(const ms_stepper *s) {
  return (ms_fused_step){.x = s->x,
                         .v = s->v,
                         .v_to = s->v_next,
                         .v_from = s->v,
                         .h = s->h,
                         .x_to = s->x_next,
                         .x_from = s->x,
                         .drift = s->h};
}

void ms_stepper_acceleration(ms_stepper *s, const double *x, const double *v, double *a) {
  ms_stepper_evaluate(s, &(ms_fused_step){.x = x, .v = v, .a = a});
}

int ms_stepper_is_separable(const ms_stepper *s) {
  return !(s->model->features & (MS_HAS_DAMPING | MS_HAS_DRAG)) && !ms_stepper_has_contacts(s);
}

/* Reflection computes with doubles. */
static int64_t reflect_vectors(const ms_stepper *s, const ms_solid *solids, ms_contact_log *log,
                               double *x, double *v, double *work) {
  const ms_model *model = s->model;
  const ms_single *of = model->single;
  if (!of) return ms_reflection_apply(model, solids, s->x, log, x, v, work);
  ms_single_widen_x(model, s->x, of->x_before);
  ms_single_widen_x(model, x, of->x);
  ms_single_widen_v(model, v, of->v);
  const int64_t own = ms_reflection_apply(model, solids, of->x_before, log, of->x, of->v, work);
  if (own) ms_single_take_changes(model, x, v);
  return own;
}

/* The collider at a time of its motion has the velocity of the interval before. Methods drop cached
 * stages where any particle was reflected: all ranks, or none. */
static int64_t reflect(ms_stepper *s, ms_contact_log *log, double *x, double *v, double *work) {
  if (!(s->model->features & MS_HAS_PLANES)) return 0;
  double start = ms_clock_now();
  const ms_instant end = {.t = s->t + s->h, .before = 1};
  const ms_solid *solids =
      ms_collider_motion_place_all(s->model->scene, end, s->model->moving_solids);
  const int64_t own = reflect_vectors(s, solids, log, x, v, work);
  const int64_t reflected = ms_rank_model_count(s->model, own);
  s->stats->contacts += reflected;
  if (own) s->finite = 0;
  s->stats->collide_s += ms_clock_now() - start;
  return reflected;
}

int64_t ms_stepper_reflect(ms_stepper *s, double *x, double *v) {
  return s->events ? 0 : reflect(s, s->contact_log, x, v, &s->work_in_step);
}

void ms_stepper_reflect_stage(ms_stepper *s, double *x, double *v) {
  double unused = 0;
  if (!s->events) reflect(s, NULL, x, v, &unused);
}

void ms_stepper_reflect_remaining(ms_stepper *s, struct ms_contact_log *log) {
  reflect(s, log, s->x_next, s->v_next, &s->work_in_step);
}
