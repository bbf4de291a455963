/* split - the stiff springs of an island in a model of their own, and the others in another */
#ifndef MS_SPLIT_H
#define MS_SPLIT_H

#include "integrate/integrator.h"

typedef struct ms_split {
  ms_model soft;      /* the island's rows with the other springs, and whatever else acts */
  ms_model stiff;     /* the particles that stiff springs touch, and these springs alone */
  int32_t *row;       /* stiff.rows.nfree: the island's row of each */
  int32_t inner;      /* steps of the stiff springs in one of the others */
  ms_stepper stepper; /* of the stiff springs, with a step of h/inner */
} ms_split;

/* *split stays NULL where no cut of the springs pays: see cut.h. */
msim_status ms_split_create(const ms_model *model, const msim_options *opt, double h,
                            ms_split **split, msim_error *err);
void ms_split_destroy(const ms_model *model, ms_split *split);

/* x and v of the particles that stiff springs touch, from the island's rows, and back. */
void ms_split_take(const ms_split *split, ms_shape shape, const double *from, double *to);
void ms_split_put(const ms_split *split, ms_shape shape, const double *from, double *to);

#endif
