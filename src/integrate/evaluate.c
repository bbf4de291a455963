/* evaluate - one force sweep of a step, counted and timed, and work (integrator.h) */
#include "base/clock.h"
#include "integrate/integrator.h"
#include "physics/force_function.h"
#include "physics/moving_pins.h"
#include "physics/rank_model.h"

/* The instant of the next sweep: at the end of a step the velocities are those before it. */
static ms_instant sweep_instant(const ms_stepper *s) {
  return (ms_instant){.t = s->t + s->c * s->h, .before = s->c > 0.5};
}

/* Of springs the ends that move pull at own unknowns, but angular springs may have ghosts, too. */
void ms_stepper_add_work(ms_stepper *s, double weight, const double *x, const double *v) {
  const ms_scene *scene = s->model->scene;
  if (scene->nmotions && scene->angles.n) ms_rank_model_refresh(s->model, x, v);
  if (s->model->pins)
    s->work_in_step +=
        weight * s->h * ms_moving_pins_compute_power(s->model, sweep_instant(s), x, v);
  if (v && ms_force_function_does_work(s->model))
    s->work_in_step += weight * s->h * ms_force_function_compute_power(s->model, v);
}

void ms_stepper_evaluate_function(ms_stepper *s, const double *x, const double *v) {
  if (ms_force_function_does_work(s->model))
    ms_force_function_evaluate(s->model, sweep_instant(s).t, x, v);
}

void ms_stepper_add_trapezoidal_work(ms_stepper *s, const double *v) {
  s->c = 0;
  ms_stepper_evaluate_function(s, s->x, v);
  ms_stepper_add_work(s, 0.5, s->x, v);
  s->c = 1;
  ms_stepper_evaluate_function(s, s->x_next, s->v_next);
  ms_stepper_add_work(s, 0.5, s->x_next, s->v_next);
}

void ms_stepper_linearize(const ms_stepper *s, const double *x, const double *v) {
  if (s->model->function) ms_force_function_linearize(s->model, sweep_instant(s).t, x, v);
}

/* To read the clock twice takes as long as a sweep over a hundred springs: of the sweeps of small
 * models one in INTERVAL is timed, and counts for those before it. Returns for how many. */
static int64_t count_timed_sweeps(ms_stepper *s, const ms_model *model) {
  enum { FEW_SPRINGS = 1000, INTERVAL = 64 };
  const int64_t sweeps = s->sweeps++;
  if (sweeps == 0 || model->springs.n >= FEW_SPRINGS) return 1;
  return sweeps % INTERVAL == 0 ? INTERVAL : 0;
}

void ms_stepper_evaluate_model(ms_stepper *s, const ms_model *model, const ms_fused_step *sweep) {
  const int64_t timed = count_timed_sweeps(s, model);
  const double start = timed ? ms_clock_now() : 0;
  if (s->model->pins) /* x and v are vectors of the stepper */
    ms_moving_pins_set(s->model, sweep_instant(s), (double *)(uintptr_t)sweep->x,
                       (double *)(uintptr_t)sweep->v);
  ms_fused_step at_time;
  if (model->function) at_time = *sweep, at_time.t = sweep_instant(s).t, sweep = &at_time;
  const int good = ms_fused_step_run(model, sweep);
  s->finite = good && sweep->v_to && (sweep->x_to || sweep->x == s->x_next);
  s->stats->force_evaluations++;
  s->stats->spring_evaluations += model->springs.n;
  if (timed) s->stats->force_s += (double)timed * (ms_clock_now() - start);
}
