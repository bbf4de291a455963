#include "integrate/control.h"

#include <float.h>
#include <math.h>

#include "contact/contact_set.h"

int ms_control_is_supported(const ms_integrator *integrator) {
  return integrator->estimate || integrator->one_step;
}

/*------------------------------------- error ----------------------------------------------------*/

/* An estimate holds for the step that the method made: the errors of particles that followed paths
 * of their own are in s->path_error. */
static void clear_path_errors(const ms_stepper *s, double *dx, double *dv) {
  const double none[3] = {0};
  for (int32_t i = 0; s->events && i < s->events->nfollowed; i++) {
    ms_unknowns_set(&s->model->unknowns, none, s->events->followed[i], dx);
    ms_unknowns_set(&s->model->unknowns, none, s->events->followed[i], dv);
  }
}

/* Writes an estimate to the first spare pair. which: 0, the fine one; 1, the coarse one */
static void write_estimate(const ms_integrator *integrator, ms_stepper *s, int which) {
  const ms_shape shape = s->model->shape;
  double *dx = s->x_spare[0], *dv = s->v_spare[0];
  if (integrator->estimate) {
    integrator->estimate(s, which, dx, dv);
    clear_path_errors(s, dx, dv);
    return;
  }
  const double richardson = 1 / (ldexp(1, integrator->entry.order) - 1);
  ms_vector_add_scaled(shape, s->x_next, -1, s->x_spare[1], dx);
  ms_vector_add_scaled(shape, s->v_next, -1, s->v_spare[1], dv);
  ms_vector_scale(shape, richardson, dx);
  ms_vector_scale(shape, richardson, dv);
}

/* E of a connected part, from the squares of both estimates */
static double error_of_part(const ms_norm_body *p, int two_estimates) {
  const double fine = p->square[0], weight = fine + (two_estimates ? 0.01 * p->square[1] : 0);
  return weight == 0 ? 0 : fine / sqrt(weight);
}

double ms_control_error(const ms_integrator *integrator, ms_stepper *s, const ms_norm *norm,
                        double allowed) {
  double largest = 0;
  for (int which = 0; which <= integrator->two_estimates; which++) {
    write_estimate(integrator, s, which);
    ms_norm_square_errors(norm, s->model->shape, which, s->x_spare[0], s->v_spare[0]);
  }
  for (const ms_norm_body *p = norm->body; p < norm->body + norm->n; p++) {
    const double r = error_of_part(p, integrator->two_estimates) / fmax(allowed, p->rounding);
    if (!(r <= largest)) largest = r;
    if (isnan(r)) return r;
  }
  return largest;
}

int32_t ms_control_find_offender(const ms_integrator *integrator, ms_stepper *s) {
  write_estimate(integrator, s, 0);
  return ms_vector_find_largest(s->model->shape, s->v_spare[0]);
}

/*------------------------------------- step -----------------------------------------------------*/

ms_control ms_control_make(const ms_integrator *integrator, double tol, double span) {
  const double GROWTH = 5, SAFETY = 0.85;
  return (ms_control){
      .tol = tol,
      .span = span,
      .order = integrator->entry.order - (integrator->two_estimates || integrator->low_estimate),
      .growth = integrator->growth > 0 ? integrator->growth : GROWTH,
      .safety = integrator->safety > 0 ? integrator->safety : SAFETY,
      .limited = integrator->limit != NULL};
}

double ms_control_allowed_error(const ms_control *c, double h) { return c->tol * h / c->span; }

/* (h/time)^(k + 1) = tol h/T, the left-hand side an estimate of the error */
double ms_control_first_step(const ms_control *c, const ms_scales *scales) {
  const double time = scales->time;
  return fmin(time * fmin(1, pow(c->tol * time / c->span, 1 / c->order)), c->span / 10);
}

double ms_control_next_step(const ms_control *c, double left) {
  if (c->h >= left) return left;
  return 2 * c->h > left ? left / 2 : c->h;
}

void ms_control_reset(ms_control *c) {
  c->previous = c->unused = c->crossing = c->usual = 0;
  c->shrunk = 0;
}

void ms_control_archive(ms_archive *b, ms_control *c) {
  double *numbers[] = {&c->tol,    &c->span,     &c->order,  &c->h,    &c->growth,
                       &c->safety, &c->previous, &c->unused, &c->usual};
  for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
    MS_ARCHIVE_TRANSFER(b, *numbers[i]);
    ms_archive_check(b, isfinite(*numbers[i]) && *numbers[i] >= 0,
                     "the state of the step-size controller");
  }
  MS_ARCHIVE_TRANSFER(b, c->limited);
  MS_ARCHIVE_TRANSFER(b, c->shrunk);
}

void ms_control_reject_failed(ms_control *c, double h) {
  c->h = h / 4;
  c->crossing = c->usual = 0;
  c->shrunk = 1;
}

/* h'/h = s r^(-1/k), for the error r of this step alone */
static double factor_of_one_step(const ms_control *c, double r) {
  return c->safety * pow(r, -1 / c->order);
}

double ms_control_expected_change(const ms_control *c) {
  return c->previous > 0 ? factor_of_one_step(c, c->previous) : 1;
}

/* h'/h, with r the relative errors of this step and of the one before, and s the safety factor, so
 * that r tends to s^k:
 *   h' = h s^(a - b) r^(-a/k) r_before^(b/k),
 * or h s r^(-1/k) if there is none before or this step is rejected, with Gustafsson's a = 0.7 and
 * b = 0.4, or 0.4 and 0.3 for methods whose steps stability limits.
 * For at the limit r follows the fastest mode u: if log h is off by d,
 *   log u' = log u + p d,  log r = log u + q d,  p = d log|R|/d log h,  q = d log(E/h)/d log h,
 * with the amplification factor R and the error estimate E of that mode. With p and q of dop853 at
 * the boundary of its region, in any direction, d decays by 0.81 a step or faster for 0.4 and 0.3
 * (1.11 for 0.7 and 0.4: it grows); with those of rk4 on the real axis by 0.78 (1.06). */
static double step_factor(const ms_control *c, double r) {
  const double A = c->limited ? 0.4 : 0.7, B = c->limited ? 0.3 : 0.4, TINY = 1e-10, k = c->order;
  if (r < TINY) r = TINY;
  if (c->previous > 0) return pow(c->safety, A - B) * pow(r, -A / k) * pow(c->previous, B / k);
  return factor_of_one_step(c, r);
}

static const double LEAST = 0.2; /* of h'/h */

/* Rejects the step of h, with the relative error r. If a contact changes after the share `change`
 * of it, the next step ends shortly before that, and the one after it goes across: 3/4 as long as
 * its error allows, so that runs have about the same errors as without this. */
static void reject(ms_control *c, double h, double r, double change) {
  const double ACROSS = 0.75, LEAST_ACROSS = 0.05;
  const int changes = change <= 1;
  const double least = changes ? LEAST_ACROSS : LEAST,
               factor = isfinite(r) ? fmax(least, factor_of_one_step(c, r)) : LEAST,
               crossing = changes ? ACROSS * factor * h : 0, until = change * h - crossing / 2;
  const int ends_before = changes && until > crossing / 2;
  c->usual = changes ? fmax(c->usual, h) : 0;
  c->crossing = ends_before ? crossing : 0;
  c->h = ends_before ? until : changes ? crossing : factor * h;
  c->shrunk = 1;
}

/* Plans the step after the accepted one of h. */
static void plan_next(ms_control *c, double h, double r) {
  if (c->crossing > 0) {
    c->h = c->crossing;
    c->crossing = 0;
  } else if (c->usual > h) {
    c->h = c->usual;
  } else {
    c->h = h * fmax(LEAST, fmin(step_factor(c, r), c->shrunk ? 1 : c->growth));
    c->previous = fmax(r, 1e-4);
    c->usual = 0;
  }
  c->shrunk = 0;
}

int ms_control_update(ms_control *c, double h, double r, double change) {
  const double MOST_SHARES = 3, KEPT = 5, unused = c->unused + (1 - r) * h;
  if (!(r <= 1) && !(r <= MOST_SHARES && unused >= KEPT * h)) {
    reject(c, h, r, change);
    return 0;
  }
  plan_next(c, h, r);
  c->unused = unused;
  return 1;
}

/*------------------------------------- attempts -------------------------------------------------*/

ms_attempt ms_control_begin_attempt(const ms_control *c, double t, double left) {
  return (ms_attempt){.t = t, .left = left, .planned = c->h, .h = ms_control_next_step(c, left)};
}

int ms_control_is_shortened(double impact) { return impact < 1 - 1e-9; }

/* Dense output of dop853 has 4 times the error E of its estimate or less in nine of ten random
 * steps, 2.5 times in the median, where the step has a tenth of E; but a tenth of that in the first
 * 0.3 of a step. A step made anew costs so many evaluations that an impact may add a tenth of
 * tol. */
ms_verdict ms_control_judge_attempt(ms_control *c, ms_attempt *a, const ms_attempt_result *of) {
  enum { MOST_CUTS = 8 };
  const double EARLY = 0.3, INTERPOLATED = of->impact < EARLY ? 0.4 : 4, MOST = 0.1;
  const int is_cut = ms_control_is_shortened(of->impact) && a->times_shortened < MOST_CUTS;
  if (of->status || !isnan(of->error) || !is_cut) {
    ms_control after = *c;
    if (of->status) ms_control_reject_failed(&after, a->h);
    if (of->status || !ms_control_update(&after, a->h, of->error, of->change)) {
      *c = after;
      *a = ms_control_begin_attempt(c, a->t, a->left);
      return c->h < 16 * DBL_EPSILON * fmax(fabs(a->t), c->span) ? MS_TOO_SHORT : MS_TRY_AGAIN;
    }
    if (a->times_shortened == 0) *c = after;
    if (!is_cut) return MS_ACCEPTED;
  }
  const double interpolated = INTERPOLATED * of->error * a->h / c->span;
  const int is_shown = interpolated * of->amplification <= MOST;
  a->times_shortened++;
  ms_control_reset(c);
  a->h *= of->impact;
  return is_shown ? MS_SHORTENED : MS_TRY_AGAIN;
}
