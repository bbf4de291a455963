/* advice - how long a step the method bears in this scene */
#ifndef MS_ADVICE_H
#define MS_ADVICE_H

#include "physics/bounds.h"

/* The share of the limit that is taken. At the limit itself the fastest motion grows, if slowly,
 * and just below its amplitude is uncertain: by 1/sqrt(1 - z^2/4) with Verlet, a factor of 2.3
 * here. */
#define MS_REACH 0.9

typedef struct ms_advice {
  ms_bounds bounds;
  double limit; /* of h, within these bounds */
  int known;    /* 0: nothing yet, 1: rough bounds, 2: sharp ones */
  int chosen;   /* opt.h was MSIM_H_AUTO, and is what came of it */
  int warned;   /* h is beyond it, and that was said */
} ms_advice;

/* Make bounds and limit as sharp as they get. */
msim_status ms_sim_advise(msim_sim *sim, msim_error *err);

/* Put 0.9 of the limit in the place of MSIM_H_AUTO; refused where there is none, or it is 0. Any
 * other h stays. */
msim_status ms_sim_settle_step(msim_sim *sim, double *h, msim_error *err);

/* Say so where h has become too long. Costs nothing where nobody listens; what memory is lacking
 * for is not said. */
void ms_sim_watch_step(msim_sim *sim);

#endif
