/* multirate_trial - for integrator = auto, a trial of respa: short steps for stiff springs alone
 *
 * Where few springs limit the steps of all other methods, the pilot run (pilot_run.h) may cost more
 * than a whole run by respa. So respa is tried first, without a pilot run, over the first sixteenth
 * of the run: steps of h, and twice as many of h/2, give the error of h. A resonance that begins
 * later ends its use (resonance.h). */
#ifndef MS_MULTIRATE_TRIAL_H
#define MS_MULTIRATE_TRIAL_H

#include "choose/pilot_run.h"

/* Try respa while its steps, by the springs that they evaluate, cost less than a quarter of
 * `least`, a lower bound on the cost of other methods. c->tried: it keeps tol at such a cost; else
 * c->rejection is set. */
msim_status ms_multirate_trial_make(ms_pilot_run *p, double least, ms_candidate *c,
                                    msim_error *err);

#endif
