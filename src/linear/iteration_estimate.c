#include "linear/iteration_estimate.h"

#include <math.h>

#include "scene/laws.h"

/* The larger of `worst` and stiffness over the lighter mass of two rows */
static double raise_ratio(const ms_model *model, double worst, double stiffness, int32_t i,
                          int32_t j) {
  double mass = INFINITY;
  if (i < model->unknowns.nfree) mass = fmin(mass, model->mass[i]);
  if (j < model->unknowns.nfree) mass = fmin(mass, model->mass[j]);
  return fmax(worst, stiffness / mass);
}

/* The bound of kappa(A), estimated by the largest ratio of stiffness to mass in a spring and the
 * mean number of springs per unknown; an angular one counts as the two that bound it */
static double estimate_condition(const ms_model *model, double h) {
  const ms_springs *s = &model->springs;
  const ms_angles *g = &model->angles;
  double worst = 0;
  for (int32_t e = 0; e < s->n; e++) {
    const double k = ms_scene_stiffness(model->scene, ms_springs_number(s, e)),
                 c = ms_scene_damping(model->scene, ms_springs_number(s, e));
    worst = raise_ratio(model, worst, h * h * k + h * c, s->i[e], s->j[e]);
  }
  for (int32_t e = 0; e < g->n; e++)
    for (int end = 0; end < 2; end++)
      worst =
          raise_ratio(model, worst, g->weight[2 * e + end] * (h * h * g->k[e] + h * g->damping[e]),
                      g->row[3 * e + 2 * end], g->row[3 * e + 1]);
  const double springs = s->n + 2.0 * g->n;
  return 1 + 4 * springs / fmax(1, model->unknowns.nfree) * worst;
}

ms_iteration_estimate ms_iteration_estimate_compute(const ms_model *model, double h, double rtol) {
  /* the costs of an iteration with a coarse space and of its setup, in iterations without one */
  const double ITERATION_COST = 2, SETUP_COST = 15, MANY = 75;
  const double kappa = estimate_condition(model, h), digits = log(2 / rtol);
  ms_iteration_estimate p = {.kappa = kappa,
                             .one_level = 0.08 * sqrt(kappa) * digits,
                             .two_level = 0.8 * pow(kappa, 0.125) * digits};
  if (p.one_level > ITERATION_COST * p.two_level + SETUP_COST)
    p.aggregate = p.two_level > MANY ? MS_AGGREGATE * 3 / 4 : MS_AGGREGATE;
  return p;
}
