/* method_choice - integrator = auto: of a few methods choose the least expensive one that keeps tol
 *
 * Costs are counted, never timed, in force evaluations per simulated second: the evaluations of a
 * step over its length, which is as long as stability and accuracy allow. The cost that follows
 * from stability is a lower bound. The least expensive method is tried (pilot_run.h), which mostly
 * raises its cost, and that of methods alike, until the least expensive one has been tried: methods
 * that cannot win are never tried. An untried method also costs four times its trial, as few turn
 * out as inexpensive as their bound: a run of a hundred steps gets a method that is easily found.
 *
 * tr-bdf2, dop853 and methods for damping run under error control, too. dop853 does so over a part
 * of the pilot run (of at most 6 steps unless planes count), which yields its cost, and is the only
 * candidate where particles are few, as one event determines the error there. Where damping is
 * strong, rk6 does so in its place, and ssprk104, whose stages cost less: bounds on damping are
 * loose. There both do so with a larger tolerance, too (control_trial.h), and with tol only if that
 * does not suffice. Of order 2, ssprk102 does so if tol is 0.03 or more, and rkc if it is 1e-4 or
 * more and damping is so strong that steps may have many stages. With a tol of 0.1 or more one of
 * these two is chosen without a pilot run or trials. The others take fixed steps: step
 * doubling costs half as much again, and control adds up errors that cancel, up to a hundredfold,
 * in methods that keep energy within bounds. Fixed steps are verified (step_verification.h), but
 * dop853 takes their place where springs turn fast (fast_turns.h). LSODA (Petzold, SIAM J. Sci.
 * Stat. Comput. 4 (1983) 136) likewise compares the steps that each method could take.
 *
 * Until a plane is close the choice is as without planes; then it is made anew. Frames are bound to
 * the steps with which the run began: error control then chooses substeps of these.
 *
 * respa is tried first, where few springs limit the steps of all others (multirate_trial.h). Where
 * stability limits the step of the best of the others, tr-bdf2 makes the whole run: it is rejected
 * unless that takes at most a fifth of the lowest cost so far. */
#ifndef MS_METHOD_CHOICE_H
#define MS_METHOD_CHOICE_H

#include "sim/sim.h"

/* Choose a method for the run from `start` on: a pure function of scene, options and that state.
 * late: the run has begun before, and planes count. Sets the method, and tol or h, as if they had
 * been requested; on failure nothing changes. */
msim_status ms_method_choice_make(msim_sim *sim, int late, const msim_state *start,
                                  msim_error *err);

/* Write all of it to a checkpoint, or read it. */
void ms_method_choice_archive(ms_archive *bytes, ms_method_choice *choice);

void ms_method_choice_explain(const ms_method_choice *choice, ms_text *out);

#endif
