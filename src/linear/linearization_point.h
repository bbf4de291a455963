/* linearization_point - the data from which a factorization was computed. A resumed run computes it
 * again from them, to the bit. */
#ifndef MS_LINEARIZATION_POINT_H
#define MS_LINEARIZATION_POINT_H

#include "physics/force.h"

typedef struct ms_linearization_point {
  double *x; /* NULL: not recorded, as no factor is lagged, or as A does not depend on x */
  ms_constraint *constraint; /* nholds constrained unknowns; NULL where there can be none */
  double h;
  int32_t clamped, kind, nconstraints;
} ms_linearization_point;

/* Memory for a point of a matrix that depends on x. has_constraints: unknowns may be constrained */
msim_status ms_linearization_point_create(const ms_model *model, int has_constraints,
                                          ms_linearization_point *point, msim_error *err);
void ms_linearization_point_destroy(const ms_model *model, ms_linearization_point *point);

#endif
