/* culprit - which spring threw a particle out of the range of numbers */
#ifndef MS_CULPRIT_H
#define MS_CULPRIT_H

#include "physics/model.h"

/* The first spring of this row whose force in the state x, v is NaN or beyond MS_HUGE, as the scene
 * counts springs; -1: none is. */
int32_t ms_find_bad_spring(const ms_model *model, const double *x, const double *v, int32_t row);

#endif
