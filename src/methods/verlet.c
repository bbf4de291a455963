/* verlet - Verlet's method with half-step velocities (leapfrog) */
#include <math.h>

#include "methods/methods.h"

/* The method of Teschner's exercises, where v is v(t - h/2):
 *   x' = x + h v + h^2 a,  v' = (x' - x)/h,  then both are reflected.
 * v' is computed as v + h a: equal, but without the cancellation in x' - x.
 *
 * Option verlet.start: taylor, v(-h/2) = v0 - h/2 a0 with a0 = a(x0, v0), which the first step uses
 * again: order 2. plain, v(-h/2) = v0: symplectic Euler, order 1. */
static void verlet_begin(ms_stepper *s) {
  if (s->opt->verlet_start == MSIM_VERLET_PLAIN) return;
  double *a = s->work[0];
  ms_fused_step_run(s->model, &(ms_fused_step){.x = s->x, .v = s->v, .a = a});
  ms_vector_add_scaled(s->model->state_shape, s->v, -s->h / 2, a, s->v);
  s->cached_stage = 1;
}

/* The first step, with the a of verlet_begin() */
static void first_step(ms_stepper *s) {
  const ms_shape shape = s->model->state_shape;
  ms_vector_add_scaled(shape, s->v, s->h, s->work[0], s->v_next);
  ms_vector_add_scaled(shape, s->x, s->h, s->v_next, s->x_next);
  s->stats->force_evaluations++;
  s->stats->spring_evaluations += s->model->springs.n;
}

static msim_status verlet_step(ms_stepper *s, msim_error *err) {
  (void)err;
  const ms_fused_step sweep = ms_stepper_kick_drift(s);
  if (s->cached_stage) first_step(s);
  else ms_stepper_evaluate(s, &sweep);
  s->cached_stage_next = 0;
  ms_stepper_reflect(s, s->x_next, s->v_next);
  return MSIM_OK;
}

/* v(t) = v(t - h/2) + h/2 a(x, v(t - h/2)): of order 2 if forces do not depend on v */
static void verlet_sync(const ms_stepper *s, double *v, double *scratch) {
  const double *a = s->cached_stage ? s->work[0] : scratch;
  if (!s->cached_stage)
    ms_fused_step_run(s->model, &(ms_fused_step){.x = s->x, .v = s->v, .a = scratch});
  ms_vector_add_scaled(s->model->state_shape, s->v, s->h / 2, a, v);
}

const ms_integrator ms_verlet = {
    .entry =
        {.name = "verlet",
         .doc =
             "x' = x + h v + h^2 a, v' = (x' - x)/h, where v is the velocity at t - h/2 (Teschner)",
         .order = 2},
    .nwork = 1,
    .carried = 1,
    .start = verlet_begin,
    .step = verlet_step,
    .limit = ms_bounds_verlet_limit,
    .sync = verlet_sync};
