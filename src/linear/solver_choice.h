/* solver_choice - selects the linear solver: the one named, or by estimated cost (solver = auto) */
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

int ms_solver_choice_is_auto(const msim_options *opt);
/* 1: the linear solver, or its coarse space, is selected by h and the springs at its creation. */
int ms_solver_choice_depends_on_springs(const msim_options *opt);

#endif
