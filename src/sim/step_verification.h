/* step_verification - check the fixed steps of integrator = auto while they are made
 *
 * The choice (method_choice.h) is based on the beginning of a run; verification detects what comes
 * later. A step is verified before it is accepted, so that a state that was shown is never taken
 * back. MERCURIUS and TRACE check steps for encounters in a similar way (Rein et al., MNRAS 485
 * (2019) 5490; Lu, Hernandez and Rein, MNRAS 533 (2024) 3708).
 *
 * Frequencies of springs are bounded in every state. So what fixed steps cannot resolve is a spring
 * that turns fast, or larger motion. Both have indicators that cost no evaluation: the largest
 * angle by which a spring turned, and
 *   D = x' - x - h/2 (v + v') - h^2/12 (a - a') = O(h^5)
 * of methods that carry the acceleration a. rkc has its error estimate in place of D, for one
 * evaluation in 16 or more: its long steps may become unstable, as motion across springs is not
 * damped. To verify a step is to compare it with two half steps. That is done where an indicator is
 * three times as large as in steps verified before, where a spring turned by 45 degrees, and once
 * in MS_VERIFICATION_INTERVAL steps. With planes near, it is done for each step in which particles
 * stop, slip or turn on individual paths that may be too inaccurate, or at least one in 64 bounces
 * (in large scenes a few always do); such steps may differ from two half steps by tol/16. Impacts
 * of many particles on the paths of velocity Verlet have errors of its order 2, as its trial
 * predicts: nothing is verified. Reflection at the ends of steps is of order 1: half steps do not
 * show its error.
 *
 * The allowed difference of whole and half steps leads to tol at the end of the run if all steps
 * have it: the difference at the choice, times tol over the error predicted there; as errors cancel
 * and are predicted pessimistically, 50 times that, but tol/4 at most, as errors of events do not
 * cancel. Without impacts, steps within it are kept: half steps now and then, more accurate as
 * each is, let errors of symplectic methods grow (12-fold in a swinging chain). Where the
 * difference is larger, the next step is verified, too, and the half steps replace the step if they
 * are accurate enough: without an event their error is 1/(2^p - 1) of the difference, p the
 * order, which may be larger by that, up to tol/4. Otherwise error control makes this step and the
 * following ones in substeps, until a substep is as long as a step again; substeps may add the
 * error that tol allows, or 1/16 of the allowed difference if that is more. They are those of
 * dop853: of order 2 they were up to 100 times as many. Only those of rkc are of rkc, too, as
 * damping may require far more of dop853. So the grid of steps, and of frames, stays.
 *
 * Errors of steps that stay below what is allowed may still add up to more than tol. Under methods
 * of order 2 the differences of verified steps are added up, each for the steps since the one
 * before. Once their sum exceeds that which leads to tol, an island makes its steps in two parts,
 * beyond twice that in four.
 *
 * Where error control is chosen for a run that has begun, it makes all of its steps in substeps.
 *
 * Steps with floats (choose/precision_choice.h) have no D, as their rounding is larger, and no
 * substeps under error control: if half steps are not accurate enough, these replace the step all
 * the same, and the run continues with doubles.
 *
 * Steps in other variables than x and v cannot be halved: such methods are candidates only where
 * particles are many. If nothing dissipates, energy shows larger errors (conservation.h). */
#ifndef MS_STEP_VERIFICATION_H
#define MS_STEP_VERIFICATION_H

#include "base/archive.h"
#include "integrate/integrator.h"
#include "physics/scales.h"

enum { MS_VERIFICATION_INTERVAL = 80 };

enum { MS_EVENTS_PER_RUN = 16 }; /* events in a run: so many share tol */

/* A measured step */
typedef struct ms_step_measurement {
  double error;        /* difference from two half steps, in the norm of errors */
  double indicator[2]; /* indicators: D, or the estimate; 1 - cos of the largest angle */
} ms_step_measurement;

/* Verification of one island */
typedef struct ms_island_verification {
  double indicator[2]; /* the largest indicators in steps verified */
  int verify_next; /* 1: the last step verified was too inaccurate: the next one is verified, too */
  int needs_doubles; /* 1: a step with floats was too inaccurate for its half steps to suffice */
  double error_sum;  /* sum of the differences of all steps from half steps, by those verified */
  int64_t verified;  /* the last step that was verified */
  double substep;    /* s: length of substeps under error control; 0: steps are whole */
  double *x, *v;     /* copy of the state at the start of a step; NULL: nothing is verified */
} ms_island_verification;

/* Verification of the whole run */
typedef struct ms_step_verification {
  ms_scales scales; /* of the scene */
  double allowed;   /* difference from half steps that is allowed; 0: steps are not verified. Not 0
                       where a method with error control makes all steps in substeps */
  double error_sum; /* of an island that leads to tol at the end of the run; 0: any is allowed */
  int only_events;  /* 1: steps are verified for their events alone */
  double indicator[2];      /* indicators of steps at the choice */
  double energy;            /* J, at the start of the run with this method */
  int warned;               /* 1: the error of energy was reported */
  int planes_far;           /* 1: planes are too far away to count yet */
  int64_t next_plane_check; /* the step at which their distance is checked next */
} ms_step_verification;

struct msim_sim;
struct ms_island_sim;

/* The number of work vectors that substeps need; 0: no steps are verified */
int32_t ms_step_verification_work(const struct msim_sim *sim);

msim_status ms_step_verification_create(const struct msim_sim *sim, const ms_model *model,
                                        ms_island_verification *check, msim_error *err);
void ms_step_verification_destroy(const ms_model *model, ms_island_verification *check);

/* Start the verification of a run in the present state, or of new islands in the present run. */
void ms_step_verification_start(struct msim_sim *sim);
void ms_step_verification_start_islands(struct msim_sim *sim);

/* 1: the run must continue with doubles. */
int ms_step_verification_needs_doubles(const struct msim_sim *sim);

/* One step of an island from x to x_next, verified. */
msim_status ms_step_verification_make_step(const struct msim_sim *sim, struct ms_island_sim *m,
                                           msim_error *err);

/* Measure one step of a sim that tries a method. */
msim_status ms_step_verification_measure(struct msim_sim *sim, const ms_scales *scales,
                                         ms_step_measurement *step, msim_error *err);

/* 1: a plane could be met within a step of h. Before a step: 1 where that is so for the first
 * time */
int ms_step_verification_is_plane_close(const struct msim_sim *sim, double h);
int ms_step_verification_planes_due(struct msim_sim *sim);

void ms_step_verification_archive(ms_archive *bytes, ms_step_verification *v);
void ms_step_verification_archive_island(ms_archive *bytes, ms_island_verification *check);

#endif
