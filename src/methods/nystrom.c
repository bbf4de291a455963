#include "methods/nystrom.h"

#include "contact/contact_set.h"
#include "physics/force_function.h"

enum { STAGES = MS_NYSTROM_STAGES };

void ms_nystrom_find_slopes(const ms_nystrom *m, const ms_stepper *s, int at, double *k[STAGES]) {
  for (int j = 1; j < m->result; j++) k[j] = s->work[j + 1];
  for (int j = m->result + 1; j < m->stages; j++) k[j] = s->work[j];
  k[0] = s->work[at];
  k[m->result] = s->work[1 - at];
}

void ms_nystrom_add_slopes(const ms_stepper *s, ms_nystrom_sums of, const ms_nystrom_row row2,
                           const ms_nystrom_row row, double *const k[STAGES]) {
  const double *y[STAGES + 1];
  double x_weight[STAGES + 1], v_weight[STAGES + 1];
  int n = 0;
  if (of.time != 0) x_weight[n] = of.time, v_weight[n] = 0, y[n++] = of.v;
  for (int j = 0; j < of.slopes; j++) {
    if (row2[j] == 0 && !(of.to_v && row[j] != 0)) continue;
    x_weight[n] = s->h * s->h * row2[j], v_weight[n] = s->h * row[j], y[n++] = k[j];
  }
  const ms_combination sums[2] = {{of.x, x_weight, of.to_x}, {of.v, v_weight, of.to_v}};
  if (of.to_v) ms_vector_two_combinations(s->model->shape, n, y, sums);
  else ms_vector_linear_combination(s->model->shape, of.x, n, x_weight, y, of.to_x);
}

/* X and V of stage i */
static void put_stage(const ms_nystrom *m, const ms_stepper *s, const ms_nystrom_stages *of,
                      int i) {
  const ms_nystrom_sums sums = {i, of->x, of->v, m->c[i] * s->h, of->X, of->V};
  ms_nystrom_add_slopes(s, sums, m->aa[i], m->a[i], of->k);
}

void ms_nystrom_evaluate(const ms_nystrom *m, ms_stepper *s, const ms_nystrom_stages *of, int from,
                         int to) {
  ms_nystrom_stages with = *of;
  if (ms_stepper_is_separable(s) && !ms_force_function_does_work(s->model)) with.V = NULL;
  for (int i = from; i < to; i++) {
    put_stage(m, s, &with, i);
    s->c = m->c[i];
    ms_stepper_acceleration(s, with.X, with.V, with.k[i]);
    if (i < m->result) ms_stepper_add_work(s, m->a[m->result][i], with.X, with.V);
  }
}

void ms_nystrom_step(const ms_nystrom *m, ms_stepper *s) {
  const int now = s->cached_stage == 2;
  ms_nystrom_stages of = {.x = s->x, .v = s->v, .X = s->x_next, .V = s->v_next};
  ms_nystrom_find_slopes(m, s, now, of.k);
  if (!s->cached_stage) ms_stepper_acceleration(s, s->x, s->v, of.k[0]);
  else ms_stepper_evaluate_function(s, s->x, s->v);
  ms_stepper_add_work(s, m->a[m->result][0], s->x, s->v);
  ms_nystrom_evaluate(m, s, &of, 1, m->result);
  put_stage(m, s, &of, m->result);
  s->c = 1;
  const int64_t reflected = ms_stepper_reflect(s, s->x_next, s->v_next);
  if (!reflected) ms_stepper_acceleration(s, s->x_next, s->v_next, of.k[m->result]);
  s->cached_stage_next = reflected ? 0 : 2 - now;
}

void ms_nystrom_estimate(const ms_nystrom *m, const ms_stepper *s, const ms_nystrom_row row2,
                         const ms_nystrom_row row, double *dx, double *dv) {
  double *k[STAGES];
  ms_nystrom_find_slopes(m, s, s->cached_stage == 2, k);
  const ms_nystrom_sums sums = {.slopes = m->stages, .to_x = dx, .to_v = dv};
  ms_nystrom_add_slopes(s, sums, row2, row, k);
}
