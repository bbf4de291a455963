#include <math.h>

#include "integrate/methods.h"

/* The seed's Verlet carries v(t - h/2):
 *   x' = x + h v + h^2 a,  v' = (x' - x)/h,  reflect both.
 * v' is formed as v + h a: the same number, without the cancellation in x' - x.
 *
 * verlet.start: taylor, v(-h/2) = v0 - h/2 a0 with a0 = a(x0, v0), and the first step uses this
 * a0: order 2. plain, v(-h/2) = v0: symplectic Euler, order 1. */
static void start(ms_stepper *s) {
  if (s->opt->verlet_start == MSIM_VERLET_PLAIN) return;
  double *a = s->work[0];
  ms_pass_run(s->model, &(ms_pass){.x = s->x, .v = s->v, .a = a});
  ms_combine(s->model->shape, s->v, -s->h / 2, a, s->v);
  s->warm = 1;
}

/* The first step, with the a of start() */
static void first_step(ms_stepper *s) {
  const ms_shape shape = s->model->shape;
  ms_combine(shape, s->v, s->h, s->work[0], s->v_next);
  ms_combine(shape, s->x, s->h, s->v_next, s->x_next);
  s->stats->force_evaluations++;
  s->stats->spring_evaluations += s->model->springs.n;
}

static msim_status step(ms_stepper *s, msim_error *err) {
  (void)err;
  const ms_pass pass = ms_kick_drift(s);
  if (s->warm) first_step(s);
  else ms_evaluate(s, &pass);
  s->warm_next = 0;
  ms_reflect(s, s->x_next, s->v_next);
  return MSIM_OK;
}

/* v(t) = v(t - h/2) + h/2 a(x, v(t - h/2)): second order where forces do not depend on v */
static void sync(const ms_stepper *s, double *v, double *scratch) {
  const double *a = s->warm ? s->work[0] : scratch;
  if (!s->warm) ms_pass_run(s->model, &(ms_pass){.x = s->x, .v = s->v, .a = scratch});
  ms_combine(s->model->shape, s->v, s->h / 2, a, v);
}

/* h^2 w^2 + 2 h g < 4, worst at the bounds of both */
double ms_verlet_limit(const ms_bounds *b) { return 4 / (b->rate + hypot(b->rate, 2 * b->omega)); }

const ms_integrator ms_verlet = {
    .entry = {.name = "verlet",
              .doc = "x' = x + h v + h^2 a, v' = (x' - x)/h, v being that of t - h/2 (Teschner)",
              .order = 2},
    .nwork = 1,
    .carried = 1,
    .start = start,
    .step = step,
    .limit = ms_verlet_limit,
    .sync = sync};
