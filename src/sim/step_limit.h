/* step_limit - the longest stable step of the method in this scene */
#ifndef MS_STEP_LIMIT_H
#define MS_STEP_LIMIT_H

#include "base/vector.h"
#include "physics/bounds.h"

/* The fraction of the stability limit that h = auto takes. At the limit itself the fastest mode
 * grows, if slowly; just below it its amplitude is uncertain: with Verlet by the factor 1/sqrt(1 -
 * z^2/4), z = h omega, which is 2.3 here. In 40,000 steps of velocity-verlet the energy of undamped
 * ropes changes by 0.008, 0.02, 0.06, 4.1 and 6.1 times their largest kinetic energy with fractions
 * of 0.5, 0.8, 0.9, 0.97 and 0.99 (the median of 59). */
#define MS_STABLE_FRACTION 0.9

typedef struct ms_step_limit {
  ms_bounds bounds;
  double limit;  /* s: the longest stable step within these bounds; 0: none is, INFINITY: any is */
  int tightness; /* bounds are 0: not computed, 1: rough, 2: tight */
  int from_auto; /* 1: opt.h was MSIM_H_AUTO, and has been replaced */
  int warned;    /* 1: h exceeds the limit, and a warning said so */
} ms_step_limit;

/* 1: the bound on frequencies exceeds the numbers of a state: no step is known to be stable. */
static inline int ms_step_limit_is_beyond_range(const ms_step_limit *a) {
  return a->bounds.omega > MS_LARGEST_VALID;
}

/* Compute tight bounds, and the limit that follows from them; collective, as are these. */
msim_status ms_step_limit_compute(msim_sim *sim, msim_error *err);

/* Replace h = MSIM_H_AUTO by 0.9 of the limit; MSIM_ERR_ARG if that is 0, infinite or unknown. */
msim_status ms_step_limit_resolve_auto(msim_sim *sim, double *h, msim_error *err);

/* Warn if h has become too long. Computes nothing without options.warn; ignores lack of memory. */
void ms_step_limit_warn(msim_sim *sim);

#endif
