/* predict - how many iterations conjugate gradients will need, from the scene alone */
#ifndef MS_PREDICT_H
#define MS_PREDICT_H

#include "physics/model.h"

/* By Gershgorin kappa(A) <= 1 + max_i 2 sum_j (h^2 k + h c)/m_i, in every state. Counts are fitted
 * to folding cloths of 1e3 to 2.5e5 particles and to jellies, k from 1e3 to 1e5 N/m, h = 1/60 and
 * 1/240 s: block Jacobi needs 0.08 sqrt(kappa) ln(2/rtol), beside a coarse space 0.8 kappa^(1/8)
 * ln(2/rtol). Measured counts are within 2.5 times that, and the first is too high, up to 20 times,
 * where the mesh is small for its stiffness: iterations grow with its diameter at most. */
typedef struct ms_prediction {
  double kappa;
  double one_level, two_level; /* iterations */
  int32_t aggregate;           /* rows in an aggregate; 0: the coarse space does not pay */
} ms_prediction;

ms_prediction ms_predict(const ms_model *model, double h, double rtol);

#endif
