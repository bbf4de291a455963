/* implicit_trial - for integrator = auto, a trial of tr-bdf2
 *
 * No single step shows how long the steps of an implicit method may be: they become short once the
 * motion is rough, and cost up to 20 times what the first states predict. So tr-bdf2 has to make
 * the whole run for a fifth of the best cost. It is tried only where stability limits explicit
 * methods, and ten of its steps, as predicted, cost less than that. */
#ifndef MS_IMPLICIT_TRIAL_H
#define MS_IMPLICIT_TRIAL_H

#include "choose/pilot_run.h"

/* Try it; best: the best of the other methods. Sets the cost of c if it is that low, else
 * c->rejection. */
msim_status ms_implicit_trial_make(ms_pilot_run *p, const ms_candidate *best, ms_candidate *c,
                                   msim_error *err);

#endif
