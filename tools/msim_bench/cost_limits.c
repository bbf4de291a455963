#include "cost_limits.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Flops of LU without pivoting, for n unknowns in a fill-reducing order: about 800 n^1.5 on a
 * surface, 80 n^2 in a solid; fitted to AMD orderings of these scenes. */
static double predict_flops(const moving_scene *m) {
  const double n = m->unknowns;
  return m->kind->solid ? 80 * n * n : 800 * n * sqrt(n);
}

/* Iterations of conjugate gradients with block Jacobi: 1/2 sqrt(kappa) ln(2/rtol), where
 * kappa <= 1 + 2 g h^2 k/m for g springs at each particle, by Gershgorin. Folded cloth needs a
 * tenth to half of it. */
static double predict_iterations(const moving_scene *m, double h, double rtol) {
  const msim_scene_view *view = &m->view;
  const double springs = 2.0 * view->nsprings / view->nparticles;
  const double kappa = 1 + 2 * springs * h * h * m->k / view->mass[0];
  return 0.5 * sqrt(kappa) * log(2 / rtol);
}

const char *reason_to_skip(const char *solver, const moving_scene *m, double h, double rtol,
                           const cost_limits *t, char text[static 128]) {
  if (strcmp(solver, "auto") == 0 || strcmp(solver, "pcg") == 0) return NULL;
  const double flops = predict_flops(m);
  if (strcmp(solver, "cholmod") == 0) {
    snprintf(text, 128, "about %.1g flops predicted", flops);
    return t->dense > 0 && flops > t->dense ? text : NULL;
  }
  if (strcmp(solver, "klu") == 0) {
    snprintf(text, 128, "about %.1g flops predicted, without dense kernels", flops);
    return flops > t->flops ? text : NULL;
  }
  const int restarts = strstr(solver, "gmr") != NULL;
  const int pairs = strstr(solver, "bcgs") || strstr(solver, "tfqmr"); /* 2 per iteration */
  const double products = (pairs ? 2 : 1) * predict_iterations(m, h, rtol);
  snprintf(text, 128, "up to %.1g products A x predicted%s", products,
           restarts ? ", with restarts" : "");
  return products > (restarts ? t->restarted : t->products) ? text : NULL;
}
