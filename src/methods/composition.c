#include "methods/composition.h"

#include <math.h>

#include "physics/force_function.h"

enum { STAGE = 2 };

void ms_composition_start(ms_stepper *s) { ms_stepper_init_stage(s, s->work[STAGE], NULL); }

/* The quintic with x, v and a of both ends, and its derivative, at t = theta */
static void interpolate_quintic(const ms_stepper *s, double t, const double *const ends[6],
                                double *x, double *v) {
  const double h = s->h, t2 = t * t, t3 = t2 * t, u = 1 - t, rise = t3 * (10 - 15 * t + 6 * t2),
               slope = 30 * t2 * u * u / h;
  const double of_x[6] = {-rise,
                          rise,
                          h * (t - t3 * (6 - 8 * t + 3 * t2)),
                          h * t3 * (-4 + 7 * t - 3 * t2),
                          h * h / 2 * t2 * u * u * u,
                          h * h / 2 * t3 * u * u};
  const double of_v[6] = {-slope,
                          slope,
                          -t2 * (18 - 32 * t + 15 * t2),
                          t2 * (-12 + 28 * t - 15 * t2),
                          h / 2 * t * u * u * (2 - 5 * t),
                          h / 2 * t2 * u * (3 - 5 * t)};
  ms_vector_linear_combination(s->model->state_shape, ends[0], 6, of_x, ends, x);
  ms_vector_linear_combination(s->model->state_shape, ends[2], 6, of_v, ends, v);
}

/* Add the work of the force function by Lobatto's rule of order 6 on a quintic: its sum over kicks
 * would be of order 2, as kicks have modified forces. ends: x, x', v, v', a, a'; x: scratch */
static void add_function_work(ms_stepper *s, const double *const ends[6], double *x) {
  if (!ms_force_function_does_work(s->model)) return;
  const double inner = (1 - 1 / sqrt(5)) / 2;
  const double node[4] = {0, inner, 1 - inner, 1}, weight[4] = {1. / 12, 5. / 12, 5. / 12, 1. / 12};
  for (int k = 0; k < 4; k++) {
    s->c = node[k];
    interpolate_quintic(s, node[k], ends, x, s->scratch);
    ms_stepper_evaluate_function(s, x, s->scratch);
    ms_stepper_add_work(s, weight[k], x, s->scratch);
  }
}

/* cached_stage: 1 + the index of the work vector that holds a(x) */
void ms_composition_step(ms_stepper *s, const ms_composition *m) {
  const ms_shape shape = s->model->state_shape;
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
  add_function_work(s, (const double *const[]){s->x, x, s->v, v, a, a_next}, other);
  s->cached_stage_next = ms_stepper_reflect(s, x, v) ? 0 : 2 - now;
}
