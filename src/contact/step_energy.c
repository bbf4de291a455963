#include "contact/step_energy.h"

#include "base/vec3.h"
#include "physics/external_force.h"
#include "physics/force_function.h"
#include "physics/moving_pins.h"
#include "physics/rank_model.h"

typedef struct energy {
  double total;            /* kinetic, elastic and potential energy, J */
  double motion, rounding; /* the first two, and the rounding tolerance of all */
} energy;

double ms_step_energy_sum(const ms_model *model, const double *x, const double *v, ms_totals *parts,
                          double *motion) {
  const ms_totals t = ms_totals_compute(model, x, v, parts);
  const double potential = model->function ? ms_force_function_compute_potential(model, x) : 0;
  *motion = t.kinetic + t.elastic;
  return *motion - ms_external_work(&model->external, t.moment) - t.force_work + potential;
}

/* Of all ranks */
static energy find_energy(const ms_stepper *s, const double *x, const double *v) {
  double sum[3] = {0}; /* total, motion, and the sum of the magnitudes of external forces, N */
  sum[0] = ms_step_energy_sum(s->model, x, v, s->events->parts, &sum[1]);
  for (int32_t r = 0; r < s->model->unknowns.nfree; r++)
    sum[2] += s->model->mass[r] * (ms_external_acceleration(&s->model->external) +
                                   ms_model_force_acceleration(s->model, r));
  ms_ranks_sum(ms_rank_model_ranks(s->model), 3, sum);
  return (energy){sum[0], sum[1], 1e-12 * (sum[1] + sum[2] * s->events->reach)};
}

/* Sets the positions of moving pins in x to those at the start or at the end of the step. */
static void set_pins(const ms_stepper *s, int at_end, double *x) {
  const ms_instant at = {.t = at_end ? s->t + s->h : s->t, .before = at_end};
  if (s->model->pins) ms_moving_pins_set(s->model, at, x, NULL);
}

ms_step_energy ms_step_energy_bound(ms_stepper *s, const double *v) {
  const double SMALL = 1e-5; /* growth by linearization, over kinetic and elastic energy */
  set_pins(s, 0, s->x);
  energy most = find_energy(s, s->x, v);
  const double motion = most.motion;
  if (ms_rank_model_may_have_motions(s->model)) {
    set_pins(s, 1, s->x);
    const energy moved = find_energy(s, s->x, v);
    set_pins(s, 0, s->x);
    if (moved.total > most.total) most = moved;
  }
  return (ms_step_energy){most.total + most.rounding, SMALL * most.motion, motion};
}

double ms_step_energy_find_end(const ms_stepper *s, double *motion) {
  set_pins(s, 1, s->x_next);
  const energy end = find_energy(s, s->x_next, s->v_next);
  *motion = end.motion;
  return end.total;
}

double ms_step_energy_bound_work(ms_stepper *s, const double *v) {
  const double before = s->work_in_step;
  s->work_in_step = 0;
  set_pins(s, 1, s->x_next);
  ms_stepper_add_trapezoidal_work(s, v);
  const double work = ms_rank_model_sum(s->model, s->work_in_step);
  s->work_in_step = before;
  return 2 * fabs(work);
}

/*------------------------------------- shorter steps --------------------------------------------*/

/* The mean displacement and velocity of the moving solids in contact; 0: there are none */
static ms_contact_frame find_mean_frame(const ms_stepper *s) {
  const ms_contact_set *e = s->events;
  double sum[7] = {0}; /* their number, displacements and velocities, of all ranks */
  for (int32_t i = 0; i < e->ncontacts; i++) {
    const ms_contact_frame *f = &e->contact[i].frame;
    if (!f->moves) continue;
    sum[0]++;
    ms_vec3_axpy(1, f->displacement, sum + 1), ms_vec3_axpy(1, f->end, sum + 4);
  }
  ms_ranks_sum(ms_rank_model_ranks(s->model), 7, sum);
  ms_contact_frame mean = {.moves = sum[0] > 0};
  for (int c = 0; c < 3 && mean.moves; c++)
    mean.displacement[c] = sum[1 + c] / sum[0], mean.end[c] = sum[4 + c] / sum[0];
  return mean;
}

/* The mean of the step and of the motion of `frame`, whose impulse does work */
static void halve_step(ms_stepper *s, const ms_contact_frame *frame) {
  const ms_unknowns *rows = &s->model->unknowns;
  for (int32_t r = 0; r < rows->nfree; r++) {
    double x[3], v[3], start[3];
    ms_unknowns_get(rows, s->x, r, start);
    ms_unknowns_get(rows, s->x_next, r, x);
    ms_unknowns_get(rows, s->v_next, r, v);
    for (int c = 0; c < 3; c++) {
      const double dv = (frame->end[c] - v[c]) / 2;
      x[c] += (start[c] + frame->displacement[c] - x[c]) / 2;
      v[c] += dv;
      s->work_in_step += s->model->mass[r] * dv * frame->end[c];
    }
    ms_unknowns_set(rows, x, r, s->x_next);
    ms_unknowns_set(rows, v, r, s->v_next);
  }
}

static double find_energy_less_work(const ms_stepper *s) {
  double motion;
  return ms_step_energy_find_end(s, &motion) - ms_rank_model_sum(s->model, s->work_in_step);
}

void ms_step_energy_shorten(ms_stepper *s, double most) {
  enum { MOST = 24 };
  const ms_shape shape = s->model->shape;
  const ms_contact_frame mean = find_mean_frame(s);
  double *x_best = s->events->begin[0], *v_best = s->events->begin[1];
  double now = find_energy_less_work(s), best = INFINITY, work = 0;
  for (int n = 0;; n++) {
    if (now <= most) return;
    if (now < best) {
      best = now, work = s->work_in_step;
      ms_vector_copy(shape, s->x_next, x_best);
      ms_vector_copy(shape, s->v_next, v_best);
    }
    if (n == MOST) break;
    halve_step(s, &mean);
    ms_stepper_reflect_remaining(s, NULL);
    now = find_energy_less_work(s);
  }
  ms_vector_copy(shape, x_best, s->x_next);
  ms_vector_copy(shape, v_best, s->v_next);
  s->work_in_step = work;
}
