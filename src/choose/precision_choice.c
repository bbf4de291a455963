#include "choose/precision_choice.h"

#include <float.h>
#include <math.h>

#include "base/vec3.h"
#include "physics/external_force.h"
#include "sim/error_growth.h"
#include "sim/precision_check.h"

/*------------------------------------- the error of floats --------------------------------------*/

/* How far an island moves as a whole in the run: |v| T + |a| T^2/2 by its mean velocity and by
 * external forces; 0 where pinned particles hold it */
static double find_travel(const ms_pilot_run *p, const ms_model *m) {
  const ms_unknowns *rows = &m->unknowns;
  double momentum[3] = {0}, mass = 0, force = 0;
  for (int32_t r = rows->first_pinned; r < rows->stride; r++)
    if (rows->particle[r] >= 0) return 0;
  for (int32_t r = 0; r < rows->nfree; r++) {
    ms_vec3_axpy(m->mass[r], p->start.v + 3 * (size_t)rows->particle[r], momentum);
    mass += m->mass[r], force += m->mass[r] * ms_model_force_acceleration(m, r);
  }
  const double g = ms_external_acceleration(&m->external) + force / mass;
  return ms_vec3_norm(momentum) / mass * p->span + g * p->span * p->span / 2;
}

/* R: the extent of the island and its travel */
static double find_reach(const ms_pilot_run *p, const ms_model *m) {
  const ms_unknowns *rows = &m->unknowns;
  double extent = 0;
  for (int c = 0; c < 3; c++) {
    double low = INFINITY, high = -INFINITY;
    for (int32_t r = 0; r < rows->stride; r++) {
      if (rows->particle[r] < 0) continue;
      const double x = p->start.x[3 * (size_t)rows->particle[r] + (size_t)c];
      low = fmin(low, x), high = fmax(high, x);
    }
    extent = fmax(extent, high - low);
  }
  return extent + find_travel(p, m);
}

static double inverse_mass(const ms_model *m, int32_t row) {
  return row < m->unknowns.nfree ? m->inv_mass[row] : 0;
}

/* m A^2 of an island */
static double sum_force_errors(const ms_model *m, double reach, double speed) {
  const ms_springs *springs = &m->springs;
  double sum = 0;
  for (int32_t e = 0; e < springs->n; e++) {
    const double error = m->scene->k[ms_springs_number(springs, e)] * reach +
                         m->scene->damping[ms_springs_number(springs, e)] * speed;
    sum += error * error * (inverse_mass(m, springs->i[e]) + inverse_mass(m, springs->j[e]));
  }
  return sum;
}

/* 1: the growth of errors may be measured in an island, whether options.watch is on or not. */
static int measures_growth(const msim_sim *sim) {
  for (int32_t i = 0; i < sim->nislands; i++)
    if (ms_error_growth_is_measurable(&sim->islands[i].model)) return 1;
  return 0;
}

double ms_precision_choice_estimate_error(const ms_pilot_run *p) {
  const double u = FLT_EPSILON / 2, T = p->span, omega = p->bounds.omega;
  const msim_sim *sim = p->sims[MSIM_COLLISION_REFLECT];
  const ms_scales *s = &p->scales;
  double farthest = 0, sum = 0;
  if (p->sim->config.choice.precision != MSIM_PRECISION_AUTO ||
      ms_precision_find_obstacle(p->sim->scene) || measures_growth(sim))
    return INFINITY;
  for (int32_t i = 0; i < sim->nislands; i++) {
    const double reach = find_reach(p, &sim->islands[i].model);
    sum += sum_force_errors(&sim->islands[i].model, reach, s->speed);
    farthest = fmax(farthest, reach);
  }
  const double walk = sqrt((1 / omega + u * farthest / s->speed) * T / 2);
  const double dx = omega * farthest / s->extent, dv = sqrt(sum / s->mass) / s->speed;
  const double error = u * (omega * T + walk * hypot(dx, dv) / sqrt(2));
  return error < INFINITY ? error : INFINITY; /* NaN, too */
}

/*------------------------------------- the choice -----------------------------------------------*/

int ms_precision_choice_takes(const ms_candidate *c) {
  return c->control_tol == 0 && c->collision == MSIM_COLLISION_REFLECT &&
         ms_precision_supports_method(c->method);
}

int ms_precision_choice_allows(const ms_pilot_run *p, const ms_candidate *c) {
  return p->single_error <= p->tol / 4 && ms_precision_choice_takes(c);
}

int ms_precision_choice_is_verifiable(const ms_pilot_run *p, const ms_candidate *c,
                                      const ms_step_verification *v) {
  const double step_error = p->single_error * c->h * sqrt(2 * p->bounds.omega / p->span);
  return v->allowed == 0 || step_error <= v->allowed / 4;
}

/*------------------------------------- report ---------------------------------------------------*/

static void explain_doubles(const msim_sim *sim, ms_text *out) {
  const ms_method_choice *s = &sim->config.choice;
  const char *obstacle = ms_precision_find_obstacle(sim->scene);
  ms_text_append(out, "precision     double: ");
  if (obstacle) ms_text_append(out, "floats do not support %s\n", obstacle);
  else if (measures_growth(sim)) ms_text_append(out, "the growth of errors may be measured\n");
  else if (!(s->single_error <= s->tol / 4))
    ms_text_append(out, "floats may add an error of %.2g, more than tol/4\n", s->single_error);
  else ms_text_append(out, "steps of this method need them; floats would keep tol\n");
}

void ms_precision_choice_explain(const msim_sim *sim, ms_text *out) {
  const int is_chosen = ms_sim_selects(sim);
  if (sim->config.opt.precision == MSIM_PRECISION_SINGLE)
    ms_text_append(out,
                   "precision     single: steps compute with floats, positions from the middle of "
                   "each island\n");
  else if (is_chosen && sim->config.choice.precision == MSIM_PRECISION_AUTO)
    explain_doubles(sim, out);
  if (sim->config.opt.precision == MSIM_PRECISION_SINGLE && is_chosen)
    ms_text_append(out, "              chosen by auto: floats add an error of some %.2g\n",
                   sim->config.choice.single_error);
}
