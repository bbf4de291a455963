/* rank_bodies - the connected components of the unknowns of all ranks */
#ifndef MS_RANK_BODIES_H
#define MS_RANK_BODIES_H

#include "physics/model.h"

/* of: out, nfree: the component of each unknown; *n: the number of components of all ranks.
 * Collective, with the same status on all ranks */
msim_status ms_rank_bodies_number(const ms_model *model, int32_t *of, int32_t *n, msim_error *err);

#endif
