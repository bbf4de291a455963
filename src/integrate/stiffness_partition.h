/* stiffness_partition - the partition of the springs by stiffness for a multirate method (respa.c):
 * soft springs take the step h, stiff ones shorter steps */
#ifndef MS_STIFFNESS_PARTITION_H
#define MS_STIFFNESS_PARTITION_H

#include "physics/bounds.h"

/* The stiffness class of a spring is floor(log2 w^2), w^2 = k (1/m_i + 1/m_j), where w is the
 * frequency of the spring alone. Springs of class `stiffness_class` and above are stiff. */
typedef struct ms_stiffness_partition {
  int stiffness_class;
  int32_t nstiff; /* 0: no partition is cost-effective */
  int32_t inner;  /* steps of the stiff springs within one step of the soft ones */
} ms_stiffness_partition;

/* The partition for which a step of h evaluates fewest springs, soft + (inner + 1) stiff, among
 * those where the soft springs alone are stable with h, and the stiff ones alone with h/inner at
 * half the limit of Verlet, by the bounds of bounds.h. None if all springs are stable with h, or if
 * velocity Verlet at its limit evaluates fewer. class_of: springs.n, out: the classes. */
msim_status ms_stiffness_partition_choose(const ms_model *model, double h, int *class_of,
                                          ms_stiffness_partition *partition, msim_error *err);

#endif
