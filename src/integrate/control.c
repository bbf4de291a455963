#include "integrate/control.h"

#include <math.h>

int ms_has_control(const ms_integrator *integrator) {
  return integrator->estimate || integrator->one_step;
}

/*------------------------------------- error ----------------------------------------------------*/

static double square(const ms_stepper *s, const ms_scales *scales, const double *dx,
                     const double *dv) {
  const ms_shape shape = s->model->shape;
  const double *const of[] = {dx, dv}, scale[] = {scales->extent, scales->speed};
  double sum = 0;
  for (int i = 0; i < 2; i++) {
    ms_scale_rows(shape, s->model->mass, of[i], s->scratch);
    sum += ms_dot(shape, of[i], s->scratch) / (scale[i] * scale[i]);
  }
  return sum / (2 * scales->mass);
}

/* which: 0, the fine estimate; 1, the coarse one */
static void put_error(const ms_integrator *integrator, ms_stepper *s, int which) {
  const ms_shape shape = s->model->shape;
  double *dx = s->x_spare[0], *dv = s->v_spare[0];
  if (integrator->estimate) {
    integrator->estimate(s, which, dx, dv);
    return;
  }
  const double richardson = 1 / (ldexp(1, integrator->entry.order) - 1);
  ms_combine(shape, s->x_next, -1, s->x_spare[1], dx);
  ms_combine(shape, s->v_next, -1, s->v_spare[1], dv);
  ms_scale(shape, richardson, dx);
  ms_scale(shape, richardson, dv);
}

ms_error ms_error_of(const ms_integrator *integrator, ms_stepper *s, const ms_scales *scales) {
  ms_error error = {0};
  put_error(integrator, s, 0);
  error.fine = square(s, scales, s->x_spare[0], s->v_spare[0]);
  if (!integrator->two_estimates) return error;
  put_error(integrator, s, 1);
  error.coarse = square(s, scales, s->x_spare[0], s->v_spare[0]);
  return error;
}

int32_t ms_error_culprit(const ms_integrator *integrator, ms_stepper *s) {
  put_error(integrator, s, 0);
  return ms_find_largest(s->model->shape, s->v_spare[0]);
}

/*------------------------------------- step -----------------------------------------------------*/

ms_control ms_control_of(const ms_integrator *integrator, double tol, double span) {
  const double USUAL = 5;
  return (ms_control){.tol = tol,
                      .span = span,
                      .order = integrator->entry.order - integrator->two_estimates,
                      .growth = integrator->growth > 0 ? integrator->growth : USUAL};
}

/* Nothing is asked for that rounding does not allow. */
double ms_control_limit(const ms_control *c, const ms_scales *scales, double h) {
  return fmax(c->tol * h / c->span, scales->rounding);
}

/* The error of a step would be (h/time)^(k + 1), were the scene's motion all at that time. */
double ms_control_first(const ms_control *c, const ms_scales *scales) {
  const double time = scales->time;
  return fmin(time * fmin(1, pow(c->tol * time / c->span, 1 / c->order)), c->span / 10);
}

double ms_control_next(const ms_control *c, double left) {
  if (c->h >= left) return left;
  return 2 * c->h > left ? left / 2 : c->h;
}

void ms_control_forget(ms_control *c) { c->previous = 0, c->shrunk = 0; }

void ms_control_history(ms_bytes *b, ms_control *c) {
  double *numbers[] = {&c->tol, &c->span, &c->order, &c->h, &c->growth, &c->previous};
  for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
    MS_BYTES_PASS(b, *numbers[i]);
    ms_bytes_check(b, isfinite(*numbers[i]) && *numbers[i] >= 0, "error control");
  }
  MS_BYTES_PASS(b, c->shrunk);
}

void ms_control_fail(ms_control *c, double h) {
  c->h = h / 4;
  c->shrunk = 1;
}

/* Motion is close to straight near the impact, or, from rest, goes like h^2. */
void ms_control_land(ms_control *c, double h, double ratio, double share) {
  c->h = h * fmin(0.9, fmax(share, 0.9 / sqrt(ratio)));
  c->previous = 0;
  c->shrunk = 1;
}

/* r = E/limit of this step and of the one before; s a margin of safety, so that r tends to s^k:
 *   h' = h s^0.3 r^(-0.7/k) r_before^(0.4/k),  and h s r^(-1/k) where there is none before */
static double factor(const ms_control *c, double r) {
  const double SAFETY = 0.85, TINY = 1e-10, k = c->order;
  if (r < TINY) r = TINY;
  if (c->previous > 0 && r <= 1)
    return pow(SAFETY, 0.3) * pow(r, -0.7 / k) * pow(c->previous, 0.4 / k);
  return SAFETY * pow(r, -1 / k);
}

/* E, as control.h has it */
double ms_error_size(ms_error error) {
  const double weight = sqrt(error.fine + 0.01 * error.coarse);
  return weight == 0 ? 0 : error.fine / weight;
}

int ms_control_accepts(ms_control *c, const ms_scales *scales, double h, ms_error error) {
  const double LEAST = 0.2;
  const double r = ms_error_size(error) / ms_control_limit(c, scales, h);
  if (!(r <= 1)) {
    c->h = h * (isfinite(r) ? fmax(LEAST, factor(c, r)) : LEAST);
    c->shrunk = 1;
    return 0;
  }
  c->h = h * fmax(LEAST, fmin(factor(c, r), c->shrunk ? 1 : c->growth));
  c->previous = fmax(r, 1e-4);
  c->shrunk = 0;
  return 1;
}
