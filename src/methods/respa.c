/* respa - the multirate method r-RESPA: stiff springs take shorter steps than all other forces
 *
 * Stiff springs take n steps of velocity Verlet of length h/n; soft springs, gravity and drag act
 * by kicks before and after them:
 *   v += h/2 a_soft(x),  n steps of x, v by a_stiff,  v += h/2 a_soft(x', v + h a_soft)
 * (Grubmueller et al. 1991; Tuckerman, Berne and Martyna, J. Chem. Phys. 97 (1992) 1990).
 * Particles without stiff springs move in a straight line, at no cost.
 *
 * The kicks resonate with stiff modes of a frequency Omega near k pi/h, k = 1, 2, ...: the closer
 * they are and the stronger the soft forces, the faster the energy grows. If such a mode is excited
 * for long and undamped, h must avoid k pi/Omega, or be below pi/Omega.
 *
 * Without a cost-effective partition of the springs (stiffness_partition.h) this is velocity
 * Verlet. */
#include "base/clock.h"
#include "methods/methods.h"
#include "integrate/multirate.h"

/* n steps of velocity Verlet, for all forces */
static msim_status damped_steps(ms_stepper *s, int32_t n, msim_error *err) {
  s->cached_stage = 0;
  for (int32_t i = 0; i < n; i++) {
    const msim_status status = ms_velocity_verlet.step(s, err);
    if (status) return status;
    ms_stepper_swap(&s->x, &s->x_next);
    ms_stepper_swap(&s->v, &s->v_next);
  }
  return MSIM_OK;
}

/* n steps if forces do not depend on v: two half kicks in a row are one kick. The clock is read
 * once, as it takes more time than a sweep over so few springs. */
static void undamped_steps(ms_stepper *s, int32_t n) {
  const double start = ms_clock_now();
  for (int32_t i = 0; i <= n; i++) {
    const double part = i == 0 || i == n ? 0.5 : 1;
    ms_fused_step sweep = {.x = s->x, .v_to = s->v, .v_from = s->v, .h = part * s->h};
    if (i < n) sweep.x_to = s->x_next, sweep.x_from = s->x, sweep.drift = s->h;
    ms_fused_step_run(s->model, &sweep);
    if (i < n) ms_stepper_swap(&s->x, &s->x_next);
  }
  s->stats->force_evaluations += n + 1;
  s->stats->spring_evaluations += (n + 1) * (int64_t)s->model->springs.n;
  s->stats->force_s += ms_clock_now() - start;
}

/* The steps of the stiff springs, from x and v_next, to x_next and v_next of their particles */
static msim_status inner_steps(ms_stepper *s, msim_error *err) {
  ms_multirate *split = s->split;
  ms_stepper *inner = &split->stepper;
  const ms_shape shape = s->model->shape;
  msim_status status = MSIM_OK;
  ms_multirate_gather(split, shape, s->x, inner->x);
  ms_multirate_gather(split, shape, s->v_next, inner->v);
  inner->stats = s->stats;
  inner->h = s->h / split->inner;
  if (ms_stepper_is_separable(inner)) undamped_steps(inner, split->inner);
  else status = damped_steps(inner, split->inner, err);
  if (status) return status;
  ms_multirate_scatter(split, shape, inner->x, s->x_next);
  ms_multirate_scatter(split, shape, inner->v, s->v_next);
  return MSIM_OK;
}

static msim_status respa_step(ms_stepper *s, msim_error *err) {
  if (!s->split) return ms_velocity_verlet.step(s, err);
  const ms_shape shape = s->model->shape;
  const ms_model *soft = &s->split->soft;
  /* cached_stage: 1 + the work vector that holds a */
  const int at = s->cached_stage == 2, next = 1 - at;
  double *a = s->work[at], *a_next = s->work[next], *v_predicted = s->work[2];
  const int separable = !(soft->features & (MS_HAS_DAMPING | MS_HAS_DRAG));
  if (!s->cached_stage)
    ms_stepper_evaluate_model(s, soft, &(ms_fused_step){.x = s->x, .v = s->v, .a = a});
  ms_vector_add_scaled(shape, s->v, s->h / 2, a, s->v_next);
  ms_vector_add_scaled(shape, s->x, s->h, s->v_next, s->x_next);
  const msim_status status = inner_steps(s, err);
  if (status) return status;
  if (!separable) ms_vector_add_scaled(shape, s->v_next, s->h / 2, a, v_predicted);
  ms_stepper_evaluate_model(s, soft,
                            &(ms_fused_step){.x = s->x_next,
                                             .v = v_predicted,
                                             .a = a_next,
                                             .v_to = s->v_next,
                                             .v_from = s->v_next,
                                             .h = s->h / 2});
  const int64_t reflected = ms_stepper_reflect(s, s->x_next, s->v_next);
  s->cached_stage_next = separable && !reflected ? 1 + next : 0;
  return MSIM_OK;
}

const ms_integrator ms_respa = {
    .entry =
        {.name = "respa",
         .doc =
             "multirate velocity Verlet: short steps for stiff springs within long steps for all "
             "other forces; inaccurate if h is near a multiple of half the period of a stiff "
             "vibration (Tuckerman 1992)",
         .order = 2},
    .is_multirate = 1,
    .nwork = 3,
    .carried = 1,
    .step = respa_step};
