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

enum { MEDIUM = 12000, LARGE = 60000 }; /* unknowns */

/* Small aggregates save iterations, but the cost of the coarse factor grows faster than the number
 * of unknowns. LARGE systems get a cycle instead, unless angular springs, which act on up to three
 * aggregates, could make it indefinite. */
ms_coarse_size ms_iteration_estimate_coarse_size(const ms_model *model) {
  const int32_t rows = model->unknowns.nfree;
  if (rows >= LARGE && !model->angles.n) return (ms_coarse_size){.aggregate = 64, .cluster = 8};
  return (ms_coarse_size){.aggregate = rows < MEDIUM   ? 64
                                       : rows < LARGE  ? 128
                                       : rows < 500000 ? 192
                                                       : 256};
}

/* With MANY iterations per factor aggregates are smaller. So they are where each of several ranks
 * factors a MEDIUM part of the coarse matrix, which costs less; small solids would lose by it. */
static ms_coarse_size choose_coarse_size(const ms_model *model, double iterations) {
  const double MANY = 75;
  ms_coarse_size size = ms_iteration_estimate_coarse_size(model);
  const int factors_part = model->shape.ranks && model->unknowns.nfree >= MEDIUM && !size.cluster;
  if (iterations > MANY || factors_part) size.aggregate = size.aggregate * 3 / 4;
  return size;
}

ms_iteration_estimate ms_iteration_estimate_compute(const ms_model *model, double h, double rtol) {
  /* the costs of an iteration with a coarse space and of its setup, in iterations without one */
  const double ITERATION_COST = 2, SETUP_COST = 15;
  const double kappa = estimate_condition(model, h), digits = log(2 / rtol);
  ms_iteration_estimate p = {.kappa = kappa,
                             .one_level = 0.08 * sqrt(kappa) * digits,
                             .two_level = 0.8 * pow(kappa, 0.125) * digits};
  if (p.one_level > ITERATION_COST * p.two_level + SETUP_COST)
    p.coarse = choose_coarse_size(model, p.two_level);
  return p;
}
