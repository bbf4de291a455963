/* verification_setup - which fixed steps of integrator = auto are verified, and how large their
 * errors may be (sim/step_verification.h) */
#ifndef MS_VERIFICATION_SETUP_H
#define MS_VERIFICATION_SETUP_H

#include "choose/pilot_run.h"

/* 1: steps of this candidate are verified. */
int ms_verification_setup_is_needed(const ms_pilot_run *p, const ms_candidate *c);

/* 1: that of steps with impacts alone, of many particles */
int ms_verification_setup_is_for_events(const ms_pilot_run *p, const ms_candidate *c);

/* Set the verification of a run by this candidate, whose steps `trial` makes. */
msim_status ms_verification_setup_measure(ms_pilot_run *p, const ms_candidate *c,
                                          const ms_trial *trial, ms_step_verification *v,
                                          msim_error *err);

#endif
