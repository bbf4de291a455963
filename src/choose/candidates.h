/* candidates - the methods among which integrator = auto chooses (method_choice.h): where they
 * compete, and what they cost before a trial and after it */
#ifndef MS_CANDIDATES_H
#define MS_CANDIDATES_H

#include "base/archive.h"
#include "choose/pilot_run.h"

enum {
  MS_LEAPFROG,
  MS_WITH_VELOCITIES,
  MS_LOCATED_IMPACTS,
  MS_TAKAHASHI_IMADA,
  MS_FOURTH,
  MS_STABILISED,
  MS_SIXTH,
  MS_EIGHTH,
  MS_ERROR_CONTROLLED,
  MS_STABILISED_CONTROLLED,
  MS_DAMPING_CONTROLLED,
  MS_LOW_ORDER_CONTROLLED,
  MS_ERROR_RELAXED,
  MS_DAMPING_RELAXED,
  MS_MULTIRATE,
  MS_IMPLICIT
};

/* Steps with impacts cost so many times as much where two half steps verify each one. */
#define MS_EVENT_COST 3.

int ms_candidate_is_controlled(int i);
int ms_candidate_is_relaxed(int i); /* with the relaxed tolerance (control_trial.h) */

/* Set it up with its longest step, if it competes here. */
void ms_candidate_init(const ms_pilot_run *p, int i, ms_candidate *c);

/* Set the longest step, which gives a lower bound on the cost. */
void ms_candidate_set_longest_step(const ms_pilot_run *p, int i, ms_candidate *c);

/* Set the evaluations of steps of c->h, and their cost: with floats about half of that with
 * doubles. */
void ms_candidate_set_cost(const ms_pilot_run *p, int i, ms_candidate *c);

/* 1: trials cost much, a fifth of a run each with fixed steps: planes count (pilot_run.h), and
 * particles are so many that no single impact decides whether a method keeps tol. */
int ms_candidate_trials_are_long(const ms_pilot_run *p);

/* The cost, and for an untried method 4 times that of its trial, with fixed steps m of them, 2 m
 * half steps and two conversions: most methods gain less than it seems. A long trial that only
 * confirms a step counts once. Error control is tried first, as it keeps tol wherever the motion
 * becomes rougher; but not if its trial is long and velocity Verlet needs but one evaluation. */
double ms_candidate_expected_cost(const ms_pilot_run *p, int i, const ms_candidate *c);

/* Reflection at the ends of steps is of order 1, and so are forces at the velocities of half a step
 * before; those at extrapolated ones are of order 3. */
int ms_candidate_order_of_errors(const ms_pilot_run *p, const ms_candidate *c);

/* Write candidate i to a checkpoint, or read it. */
void ms_candidate_archive(ms_archive *bytes, int i, ms_candidate *c);

#endif
