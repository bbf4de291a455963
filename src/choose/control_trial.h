/* control_trial - try a method under error control, for integrator = auto
 *
 * A method with an error estimate is tried from the end of the pilot run (pilot_run.h), or from an
 * impact; without planes a few of its steps show how long the others will be.
 *
 * Where damping limits the steps, the estimate is mostly that of fast vibrations at the limit of
 * stability. Damping removes these errors within a few steps, so that they do not add up to the
 * tolerance: of a damped cloth the error of dop853 with tol = 1e-3 is 5e-10. So error control with
 * a larger, relaxed tolerance is a candidate, too. Its trial shows whether it keeps tol: its state
 * is compared with that of steps of half the length, after two such steps more of both, in which
 * the errors of fast vibrations decay, and the distance extrapolated to the end of the run. */
#ifndef MS_CONTROL_TRIAL_H
#define MS_CONTROL_TRIAL_H

#include "choose/pilot_run.h"

/* The limit that damping sets holds in every state; in most, error control takes steps so many
 * times as long. */
#define MS_LOOSE 2.5

/* The limit of stability that steps under error control may exceed MS_LOOSE times. For rk6 it is
 * that of ssprk104, which is about as stable where damping is strong: fixed steps of rk6 have to be
 * short, as some mode may be damped little. */
double ms_control_trial_stable_step(const ms_pilot_run *p, const ms_integrator *method);

/* The relaxed tolerance is 0.1, but no more than 50 tol and no less than 8 tol. It is a candidate
 * where damping limits the steps and no plane counts, if it is 0.1 at most (so with tol = 0.01,
 * however rounded), and if a step, of the trial, too, adds at most tol/4, as the errors of motion
 * that becomes rougher do not decay. Verified steps have the same limits (verification_setup.c). So
 * the run has 200 steps or more, 40 with 10 tol: in shorter ones the trial would cost more than it
 * saves. */
double ms_control_trial_relaxed_tol(double tol);
int ms_control_trial_may_relax(const ms_pilot_run *p, const ms_integrator *method);

/* 1: in a run so long that steps MS_LOOSE times the limit would add no more, methods are tried with
 * tol only if the relaxed tolerance does not keep it. */
int ms_control_trial_relaxes_first(const ms_pilot_run *p);

/* The number of steps that a trial of c makes, those that show its error included; with planes, of
 * its longest step */
double ms_control_trial_steps(const ms_pilot_run *p, const ms_candidate *c);

/* Run `trial`, under error control, from its present state to t, or until it has spent `most`
 * evaluations or made so many steps, of which the first does not count unless it is the only one:
 * the controller mostly rejects a few lengths before it. Of rkc the first sixteenth of the time is
 * left out. tol and scales are those of the whole run. Sets the step and its cost. */
msim_status ms_control_trial_run(ms_pilot_run *p, msim_sim *trial, double t, double most,
                                 double steps, ms_candidate *c, msim_error *err);

/* Try the candidate as long as it costs less than `least`, the cost of another one, would. Sets its
 * step and costs, and whether it is tried or rejected. */
msim_status ms_control_trial_make(ms_pilot_run *p, double least, ms_candidate *c, msim_error *err);

/* After a trial that cost more than the others are expected to, `least`: they may turn out more
 * expensive by far, above all where impacts determine errors, and beyond twice that the method is
 * tried again. */
void ms_control_trial_postpone(double least, ms_candidate *c);

#endif
