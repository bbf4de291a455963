/* evaluate - one force sweep of a step, counted and timed (integrator.h) */
#include "base/clock.h"
#include "integrate/integrator.h"

void ms_stepper_evaluate_model(ms_stepper *s, const ms_model *model, const ms_fused_step *pass) {
  double start = ms_clock_now();
  const int good = ms_fused_step_run(model, pass);
  s->finite = good && pass->v_to && (pass->x_to || pass->x == s->x_next);
  s->stats->force_evaluations++;
  s->stats->spring_evaluations += model->springs.n;
  s->stats->force_s += ms_clock_now() - start;
}
