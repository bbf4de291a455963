/* momentum - a correction that makes the answer of a solve conserve momentum
 *
 * On a connected component of the springs without pinned particles the translation 1 has
 * 1.A = 1.(M + h b): springs cancel. So y += 1 c,  c = 1.(b - (M + h b) y)/1.(M + h b) 1, leaves a
 * residual without a sum, whatever the solver left. It is the Galerkin correction by that mode: the
 * energy norm of the error does not grow. */
#ifndef MS_MOMENTUM_H
#define MS_MOMENTUM_H

#include "physics/force.h"

typedef struct ms_free_components {
  int32_t n;
  int32_t *of;  /* nfree: the component of each unknown row; -1: it hangs on pinned particles */
  double *sums; /* 4 for each component: of masses, then of residuals */
} ms_free_components;

msim_status ms_free_components_create(const ms_model *model, ms_free_components *components,
                                      msim_error *err);
void ms_free_components_destroy(const ms_model *model, ms_free_components *components);

/* Components with rows that are held are left as they are. */
void ms_balance_momentum(const ms_model *model, const ms_coefficients *a,
                         const ms_free_components *components, const double *b, double *y);

#endif
