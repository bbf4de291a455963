/* evaluate - one force sweep of a step, counted and timed (integrator.h) */
#include "base/clock.h"
#include "integrate/integrator.h"

void ms_stepper_evaluate_model(ms_stepper *s, const ms_model *model, const ms_fused_step *sweep) {
  double start = ms_clock_now();
  const int good = ms_fused_step_run(model, sweep);
  s->finite = good && sweep->v_to && (sweep->x_to || sweep->x == s->x_next);
  s->stats->force_evaluations++;
  s->stats->spring_evaluations += model->springs.n;
  s->stats->force_s += ms_clock_now() - start;
}
