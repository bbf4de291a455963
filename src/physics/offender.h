/* offender - finds the offending spring or particle of a step that failed */
#ifndef MS_OFFENDER_H
#define MS_OFFENDER_H

#include "physics/force.h"

/* The first spring of this row whose force in the state x, v is NaN or beyond MS_LARGEST_VALID, by
 * its number in the scene; -1: none. */
int32_t ms_offender_find_spring(const ms_model *model, const double *x, const double *v,
                                int32_t row);

/* The row whose compressed springs (t < 0) are most destabilizing: the largest sum of -t over the
 * mass. */
int32_t ms_offender_find_compressed(const ms_model *model, const ms_coefficients *a);

#endif
