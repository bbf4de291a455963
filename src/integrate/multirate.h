/* multirate - the models of a multirate method: one with the stiff springs of an island, one with
 * all other forces */
#ifndef MS_MULTIRATE_H
#define MS_MULTIRATE_H

#include "integrate/integrator.h"

typedef struct ms_multirate {
  ms_model soft;      /* all particles of the island, with the soft springs and all other forces */
  ms_model stiff;     /* the particles at stiff springs, with these springs only */
  int32_t *row;       /* stiff.rows.nfree: the index of each unknown in the island */
  int32_t inner;      /* steps of the stiff springs within one step of h */
  ms_stepper stepper; /* for the stiff springs, with steps of h/inner */
} ms_multirate;

/* Sets *split to NULL if no partition of the springs is cost-effective (stiffness_partition.h). */
msim_status ms_multirate_create(const ms_model *model, const msim_options *opt, double h,
                                ms_multirate **split, msim_error *err);
void ms_multirate_destroy(const ms_model *model, ms_multirate *split);

/* Copy the entries of particles at stiff springs from a vector of the island, and back. */
void ms_multirate_gather(const ms_multirate *split, ms_shape shape, const double *from, double *to);
void ms_multirate_scatter(const ms_multirate *split, ms_shape shape, const double *from,
                          double *to);

#endif
