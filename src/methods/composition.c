#include "methods/composition.h"

enum { STAGE = 2 };

void ms_composition_start(ms_stepper *s) { ms_stepper_init_stage(s, s->work[STAGE]); }

/* cached_stage: 1 + the index of the work vector that holds a(x) */
void ms_composition_step(ms_stepper *s, const ms_composition *m) {
  const ms_shape shape = s->model->shape;
  const int now = s->cached_stage == 2;
  double *a = s->work[now], *a_next = s->work[1 - now];
  double *x = s->x_next, *other = s->work[STAGE], *v = s->v_next;
  if (!s->cached_stage) ms_stepper_acceleration(s, s->x, NULL, a);
  ms_stepper_add_work(s, m->kick[0], s->x, NULL);
  ms_vector_add_scaled(shape, s->v, s->h * m->kick[0], a, v);
  ms_vector_add_scaled(shape, s->x, s->h * m->drift[0], v, x);
  for (int i = 1; i < m->drifts; i++) {
    s->c += m->drift[i - 1];
    ms_fused_step sweep = {.x = x,
                           .v_to = v,
                           .v_from = v,
                           .h = s->h * m->kick[i],
                           .x_to = other,
                           .x_from = x,
                           .drift = s->h * m->drift[i]};
    if (m->gradient > 0 && 2 * i == m->drifts) {
      ms_stepper_acceleration(s, x, NULL, a_next);
      ms_vector_add_scaled(shape, x, m->gradient * s->h * s->h, a_next, other);
      sweep.x = other, sweep.x_to = x;
    }
    ms_stepper_evaluate(s, &sweep);
    ms_stepper_add_work(s, m->kick[i], sweep.x, NULL);
    if (sweep.x_to == other) other = x, x = sweep.x_to;
  }
  s->c = 1;
  ms_stepper_evaluate(
      s, &(ms_fused_step){
             .x = x, .a = a_next, .v_to = v, .v_from = v, .h = s->h * m->kick[m->drifts]});
  ms_stepper_add_work(s, m->kick[m->drifts], x, NULL);
  s->cached_stage_next = ms_stepper_reflect(s, x, v) ? 0 : 2 - now;
}
