/* culprit - finds the offending spring or particle of a step that failed */
#ifndef MS_CULPRIT_H
#define MS_CULPRIT_H

#include "physics/force.h"

/* The first spring of this row whose force in the state x, v is NaN or beyond MS_HUGE, by its
 * number in the scene; -1: none. */
int32_t ms_find_bad_spring(const ms_model *model, const double *x, const double *v, int32_t row);

/* The row whose compressed springs (t < 0) are most destabilizing: the largest sum of -t over the
 * mass. */
int32_t ms_find_most_compressed(const ms_model *model, const ms_coefficients *a);

#endif
