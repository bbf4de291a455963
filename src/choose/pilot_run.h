/* pilot_run - pilot run: simulate the beginning of a run, and try methods there, for integrator =
 * auto
 *
 * Velocity Verlet, or verlet or rkc in damped scenes, makes the pilot run, the first eighth of the
 * run, but no more than 16384 steps, in parts of 1/64 of the run; where a plane could be met soon
 * after, up to there. If it meets no plane, planes do not count until one is close
 * (step_verification.h), and methods are tried from its end. Otherwise it ends with the part of the
 * first impact, and they are tried from the start of that: steps of h and twice as many of h/2 give
 * the error of h by Richardson extrapolation; it is assumed to grow linearly over the run. A start
 * at rest is not typical: the growth of errors in the second half of the pilot run is assumed to
 * occur once more, and twice unless damping is strong, or the motion has just begun and the order
 * is above 2. Verification detects larger growth. After a sixteenth of the run, errors of a hanging
 * cloth would be predicted 30 times too small. */
#ifndef MS_PILOT_RUN_H
#define MS_PILOT_RUN_H

#include "sim/sim.h"

/* A method to be tried */
typedef struct ms_trial {
  const ms_integrator *method;
  int32_t collision;
  int order;   /* of its error at the end of a run */
  double tol;  /* of error control; 0: steps are fixed */
  double h;    /* s; the first step under error control */
  double most; /* evaluations for steps of h, after which the trial ends; 0: any number */
} ms_trial;

/* A state, 3n each, in particle order */
typedef struct ms_pilot_state {
  double *x, *v;
} ms_pilot_state;

enum { MS_CONTROLLED_SIM = 2, MS_PILOT_SIMS };

typedef struct ms_pilot_run {
  const msim_sim *sim;
  double tol, span;
  ms_scales scales;
  ms_bounds bounds;
  int damped;                          /* forces depend on velocities */
  msim_state start;                    /* the start of the run */
  double *states;                      /* memory of the states below */
  ms_pilot_state scratch, end, middle; /* end and middle of the pilot run; or the state before and
                                          that after an impact */
  ms_pilot_state coarse_middle, coarse_end; /* of the longer steps in trials from the start */
  double duration, error_growth; /* s: length of the pilot run; factor by which errors may grow,
                                      >= 1 */
  double step_growth;            /* that by which errors of equal steps may grow, 1 to 4 */
  int has_just_begun;            /* 1: they grow more than 4.5-fold in half of the pilot run, as
                                    where the motion has just begun */
  int met_plane;                 /* the pilot run has met a plane */
  int planes_count;              /* planes count: the pilot run met one, or one is close */
  int mid_run;                   /* the run has begun before: new steps must divide its own */
  int few, many;                 /* one event determines the error, or none does */
  double remaining;              /* s: the run from shortly before the first impact on, or all of
                                      it */
  double single_error;           /* of floats at the end of the run (precision_choice.h) */
  double cost;                   /* cost of everything tried, in evaluations of all springs */
  msim_sim *sims[MS_PILOT_SIMS]; /* for trials of all methods, created when needed: with fixed
                                    steps by `collision`, or with error control */
} ms_pilot_run;

/* Prepare the pilot run from `start`. late: the run has begun before, and planes count. Call
 * ms_pilot_run_end always. */
msim_status ms_pilot_run_begin(const msim_sim *sim, double tol, int late, const msim_state *start,
                               ms_pilot_run *p, msim_error *err);
msim_status ms_pilot_run_make(ms_pilot_run *p, msim_error *err);
void ms_pilot_run_end(ms_pilot_run *p);

/* 1: forces depend on velocities, and damping, not frequencies, limits steps. */
int ms_pilot_run_is_limited_by_damping(const ms_pilot_run *p);

/* 0.9 of the longest stable step, s; INFINITY: any is stable. */
double ms_pilot_run_stable_step(const ms_pilot_run *p, const ms_integrator *method);

/* The longest step that is divided at impacts, s; INFINITY: any, or none. By the bounds of the
 * steps themselves, as longer ones are much less accurate. */
double ms_pilot_run_longest_to_locate(const ms_pilot_run *p, const ms_integrator *method);

/* The number of steps of h in a trial: with planes this many trials would make a whole run. */
#define MS_TRIALS_AT_PLANES 14.
double ms_pilot_run_trial_steps(const ms_pilot_run *p, double h);

/* The factor by which the error of such a method is assumed to grow until the end of the run, apart
 * from linear growth: twice as much with order 2. Without that 16 such runs in 400 random cloths,
 * ropes and solids exceeded tol, with it 6 do. Of orders above 2 it is that of steps if the motion
 * has just begun: trials show errors of fast vibrations, which do not grow as motion does. With its
 * square, as else, predicted errors were 7 times too large or more in 45 of 49 such runs. */
double ms_pilot_run_growth(const ms_pilot_run *p, int order);

/* The error at the end of the run with these fixed steps, in the norm of pilot_run.c; INFINITY:
 * such steps fail, or take too many evaluations. step_cost: the cost of a step, in evaluations. */
msim_status ms_pilot_run_try_method(ms_pilot_run *p, const ms_trial *of, double *error,
                                    double *step_cost, msim_error *err);

enum { MS_DECAY_STEPS = 2 };

/* The error at the end of the run of a trial of n steps that ms_pilot_run_start_late began, and
 * whose `end` is given: by 2 n fixed steps of the method over the same time, and MS_DECAY_STEPS
 * more from both ends, in which fast vibrations decay. INFINITY: such steps fail. Without planes */
msim_status ms_pilot_run_compare_end(ms_pilot_run *p, const ms_integrator *method,
                                     const msim_state *end, int64_t n, double *error,
                                     msim_error *err);

/* Measure a step from n states, as verification does: the end, the middle and the start of the
 * pilot run. */
enum { MS_MEASURED_STEPS = 3 };
msim_status ms_pilot_run_measure_steps(ms_pilot_run *p, const ms_trial *of, int n,
                                       ms_step_measurement *steps /* n */, msim_error *err);

/* Copy the state of a sim; its distance from such a copy, in the norm of errors. */
void ms_pilot_run_copy_state(const ms_pilot_run *p, msim_sim *sim, const ms_pilot_state *to);
double ms_pilot_run_find_distance(const ms_pilot_run *p, msim_sim *sim, const ms_pilot_state *from);

/* A sim for another trial, by a method under error control, or with tol = 0 in fixed steps of h */
msim_status ms_pilot_run_create_sim(const ms_pilot_run *p, const ms_integrator *method, double tol,
                                    double h, msim_sim **sim, msim_error *err);

/* Work of a sim so far, in evaluations of all springs; iterations and factorizations are
 * converted. */
#define MS_EVALUATIONS_PER_ITERATION 1.5
double ms_pilot_run_count_work(const msim_sim *sim);

/* The model of the largest island, to predict iterations. */
const ms_model *ms_pilot_run_model(const ms_pilot_run *p);

/* Set a sim to the start of the pilot run. */
msim_status ms_pilot_run_set_start(const ms_pilot_run *p, msim_sim *sim, msim_error *err);

/* Start a trial under error control from the end of the pilot run, or from the state after an
 * impact, or before it if the run has begun. *sim: borrowed until the next trial */
msim_status ms_pilot_run_start_late(ms_pilot_run *p, const ms_trial *of, msim_sim **sim,
                                    msim_error *err);

#endif
