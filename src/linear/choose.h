/* choose - selects the linear solver: the one named, or for solver = auto by estimated cost */
#ifndef MS_CHOOSE_H
#define MS_CHOOSE_H

#include "linear/linear.h"

typedef struct ms_choice {
  ms_linear *linear;
  char reason[256]; /* why this one: text for `explain` */
} ms_choice;

/* h: the step. The caller destroys choice->linear, also after an error; it may be NULL then.
 * MSIM_ERR_ARG: the solver named is not capable of indefinite = solve. */
msim_status ms_choose(const ms_system *system, const msim_options *opt, double h, ms_choice *choice,
                      msim_error *err);

#endif
