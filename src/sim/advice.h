/* advice - the longest stable step of the method in this scene */
#ifndef MS_ADVICE_H
#define MS_ADVICE_H

#include "physics/bounds.h"

/* The fraction of the stability limit that h = auto takes. At the limit itself the fastest mode
 * grows, if slowly; just below it its amplitude is uncertain: with Verlet by the factor 1/sqrt(1 -
 * z^2/4), z = h omega, which is 2.3 here. */
#define MS_REACH 0.9

typedef struct ms_advice {
  ms_bounds bounds;
  double limit; /* s: the longest stable step within these bounds; 0: none is, INFINITY: any is */
  int known;    /* bounds are 0: not computed, 1: rough, 2: tight */
  int chosen;   /* 1: opt.h was MSIM_H_AUTO, and has been replaced */
  int warned;   /* 1: h exceeds the limit, and a warning said so */
} ms_advice;

/* Compute tight bounds, and the limit that follows from them. */
msim_status ms_sim_advise(msim_sim *sim, msim_error *err);

/* Replace h = MSIM_H_AUTO by 0.9 of the limit; MSIM_ERR_ARG if that is 0, infinite or unknown. */
msim_status ms_sim_settle_step(msim_sim *sim, double *h, msim_error *err);

/* Warn if h has become too long. Computes nothing without options.warn; ignores lack of memory. */
void ms_sim_watch_step(msim_sim *sim);

#endif
