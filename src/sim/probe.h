/* probe - what the run to come is like, found by flying through its beginning, and what methods
 * are worth there
 *
 * Velocity Verlet flies through the first eighth of the run. Where it meets no plane there, planes
 * do not count until one is close (verify.h). Else it flies again, to a 64th of the run before the
 * first impact. From there methods are tried: some steps of h beside twice as many of h/2 tell
 * the error of h by Richardson, taken to grow linearly over the run. A start at rest says little:
 * by how much motion has grown wilder in the second half of the flight, it is expected to grow once
 * more, and twice where nothing damps it. What is worse is found by verification. */
#ifndef MS_PROBE_H
#define MS_PROBE_H

#include "sim/sim.h"

/* A method in fixed steps */
typedef struct ms_trial {
  const ms_integrator *method;
  int32_t collision;
  int order; /* of its error at the end of a run */
} ms_trial;

typedef struct ms_probe {
  const msim_sim *sim;
  double tol, span;
  ms_scales scales;
  ms_bounds bounds;
  int damped;                      /* forces depend on velocities */
  const double *x0, *v0;           /* flat 3n: the start */
  double *states;                  /* the room for them */
  double *x, *v, *x_half, *v_half; /* where the flight came to; where its second part began */
  double flown, growth;            /* s; how much larger than here errors may be elsewhere, >= 1 */
  int met;                         /* a plane, on the way */
  int near;                        /* planes count: one was met in the first eighth, or is close */
  int late;                        /* the run has begun: it goes on, in steps that divide its own */
  int few, many;                   /* free particles: one event decides on the error, or does not */
  double wild;                     /* s: of the run, since about when a plane was met first */
  double price;                    /* of all that was tried, in evaluations of all springs */
  msim_sim *sims[2];               /* by collision, where it has been asked for */
} ms_probe;

/* Of a run that begins with x, v at t0; then the flight. late: the run
 * goes on, and planes count. Call
 * ms_probe_end in any case. */
msim_status ms_probe_begin(const msim_sim *sim, double tol, int late, double t0, const double *x,
                           const double *v, ms_probe *p, msim_error *err);
void ms_probe_end(ms_probe *p);

/* 0.9 of the longest stable step; INFINITY: any is stable. */
double ms_probe_reach(const ms_probe *p, const ms_integrator *method);

/* So many steps of h are tried. */
double ms_probe_steps(const ms_probe *p, double h);

/* The error at the end of the run by fixed steps of h, in the norm of integrate/control.h; INFINITY
 * where none can be made. price: what a step cost, in evaluations. */
msim_status ms_probe_error(ms_probe *p, const ms_trial *of, double h, double *error, double *price,
                           msim_error *err);

/* Steps of h from n states, as verified (verify.h): the end, the middle and the start of the
 * flight */
enum { MS_MEASURED = 3 };
msim_status ms_probe_measure_steps(ms_probe *p, const ms_trial *of, double h, int n,
                                   ms_measured *steps /* n */, msim_error *err);

/* As far as the flight again, in twice n steps of another sim: the error at the end of the run.
 * Only where there are no planes. */
msim_status ms_probe_fly_beside(ms_probe *p, msim_sim *other, int64_t n, double *error,
                                msim_error *err);

/* What a sim has done so far, in evaluations of all springs, as its iterations and factors
 * compare. */
#define MS_ITERATION 1.5
double ms_probe_work(const msim_sim *sim);

/* Of an island with the motion's springs, for predictions. */
const ms_model *ms_probe_model(const ms_probe *p);

/* Set a sim to the start, or to where the flight's second part began. */
msim_status ms_probe_start(const ms_probe *p, msim_sim *sim, msim_error *err);
msim_status ms_probe_start_half(const ms_probe *p, msim_sim *sim, msim_error *err);

#endif
