/* momentum - corrects the solution y of a system A y = b such that it conserves momentum
 *
 * On a connected component of the springs without pinned particles the translation 1 satisfies
 * 1.A = 1.W, W = M + h drag, because the forces of springs cancel. Therefore
 *     y += 1 c,  c = 1.(b - W y)/(1.W 1)
 * leaves a residual whose sum over the component is 0. This is the Galerkin correction by the mode
 * 1, which does not increase the energy norm of the error. */
#ifndef MS_MOMENTUM_H
#define MS_MOMENTUM_H

#include "physics/force.h"

typedef struct ms_momentum_components {
  int32_t n;
  int32_t *of;  /* nfree: the component of each unknown; -1: it is connected to pinned particles;
                   NULL: all are */
  double *sums; /* 4 per component: 1.W 1, then 1.(b - W y) */
} ms_momentum_components;

/* -1: the unknown is connected to pinned particles */
static inline int32_t ms_momentum_find_component(const ms_momentum_components *f, int32_t row) {
  return f->of ? f->of[row] : -1;
}

msim_status ms_momentum_create_components(const ms_model *model, ms_momentum_components *components,
                                          msim_error *err);
void ms_momentum_destroy_components(const ms_model *model, ms_momentum_components *components);

/* Correct y. Components with constrained unknowns are left unchanged, and all if a force function
 * has blocks in the matrix. */
void ms_momentum_balance(const ms_model *model, const ms_coefficients *a,
                         const ms_momentum_components *components, const double *b, double *y);

#endif
