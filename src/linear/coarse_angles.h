/* coarse_angles - what angular springs add to the pattern and the values of the coarse matrix */
#ifndef MS_COARSE_ANGLES_H
#define MS_COARSE_ANGLES_H

#include "linear/coarse.h"

/* List the aggregates that angular springs connect with aggregate k, as list_links() of coarse.c
 * does. */
int32_t *ms_coarse_angles_list_links(const ms_model *model, const ms_aggregates *aggregates,
                                     int32_t k, int32_t *mark, int32_t *next);

/* chol.value += the part of P^T A P of the angular springs at the unknowns of one aggregate: block
 * (r, c) of the corners of each to the block of their aggregates */
void ms_coarse_angles_assemble(ms_coarse *coarse, const ms_coarse_matrix *a, int32_t aggregate);

#endif
