/* iteration_estimate - estimates the iterations of conjugate gradients from the scene, before any
 * is made */
#ifndef MS_ITERATION_ESTIMATE_H
#define MS_ITERATION_ESTIMATE_H

#include "linear/linear.h"

/* By Gershgorin kappa(A) <= 1 + max_i 2 sum_j (h^2 k + h c)/m_i, in every state. The numbers of
 * iterations are fitted to folding cloths of 1e3 to 2.5e5 particles and to elastic lattices, k from
 * 1e3 to 1e5 N/m, h = 1/60 and 1/240 s: block Jacobi takes 0.08 sqrt(kappa) ln(2/rtol), with a
 * coarse space 0.8 kappa^(1/8) ln(2/rtol). Measured numbers are within 2.5 times these. Where the
 * mesh is small for its stiffness, the first is up to 20 times too high: iterations grow with the
 * diameter of the mesh at most. */
typedef struct ms_iteration_estimate {
  double kappa;
  double one_level, two_level; /* iterations */
  int32_t aggregate; /* unknowns in one of the coarse space; 0: that is not cost-effective */
} ms_iteration_estimate;

enum { MS_AGGREGATE = 64 }; /* if a coarse space is used in any case */

ms_iteration_estimate ms_iteration_estimate_compute(const ms_model *model, double h, double rtol);

#endif
