/* solver_choice - selects the linear solver: the one named, or for solver = auto by estimated cost
 * */
#ifndef MS_SOLVER_CHOICE_H
#define MS_SOLVER_CHOICE_H

#include "linear/linear.h"

typedef struct ms_solver_choice {
  ms_linear *linear;
  char reason[256]; /* why this one: text for `explain` */
} ms_solver_choice;

/* h: the step. The caller destroys choice->linear, also after an error; it may be NULL then.
 * MSIM_ERR_ARG: the solver named is not capable of indefinite = solve. */
msim_status ms_solver_choice_make(const ms_linear_system *system, const msim_options *opt, double h,
                                  ms_solver_choice *choice, msim_error *err);

#endif
