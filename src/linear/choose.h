/* choose - which linear solver: the one asked for, or for `auto` by an estimate of the work */
#ifndef MS_CHOOSE_H
#define MS_CHOOSE_H

#include "linear/linear.h"

typedef struct ms_choice {
  ms_linear *linear;
  char reason[256]; /* why this one, for people */
} ms_choice;

/* h: the step. The linear solver is the caller's to destroy, after a failure too; NULL: none. */
msim_status ms_choose(const ms_system *system, const msim_options *opt, double h, ms_choice *choice,
                      msim_error *err);

#endif
