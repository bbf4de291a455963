/* race - all that solves one system, in turn: whole steps, backends alone, reference programs */
#ifndef BENCH_RACE_H
#define BENCH_RACE_H

#include "probe.h"
#include "reference.h"
#include "system.h"
#include "timing.h"

enum { MOST_STEPS = 16, MOST_CONTESTANTS = 2 * MOST_STEPS + REFERENCE_VARIANTS + 1 };

typedef struct race {
  const moving *moving;
  linear_system system; /* n = 0: h and rtol alone */
  double warm;          /* s of steps that do not count, before each one that does */
  struct racing_step {
    const struct race *race;
    probe probe;
    const msim_backend *own[2]; /* the probe's table, NULL */
    msim_sim *sim;
  } steps[MOST_STEPS];
  struct racing_reference {
    reference *child;
    int variant;
  } references[REFERENCE_VARIANTS + 1];
  int series;   /* whole steps that follow each other from the state of `moving` on, in each sample;
                 0: one; set before they are entered */
  double until; /* on wall_seconds' clock: no series goes on after it */
  int nsteps, nreferences, count;
  contestant all[MOST_CONTESTANTS];
} race;

/* A race over the step of length h from a scene's state. with_system: references take part and
 * residuals are computed, which a large matrix is too large for. NULL: it failed, and why in err.
 */
race *race_new(const moving *m, double h, double rtol, int with_system, msim_error *err);
void race_free(race *r);

/* Enter one: the contestant, whose `failed` tells that it cannot run. */

/* A whole step by so many threads, option `solver` being the name. table: the backend behind it, to
 * be watched for race_add_bare; NULL: it is not, or built in. */
contestant *race_add_step(race *r, const char *solver, const msim_backend *table, int32_t threads);

/* What makes a contestant's steps; NULL: it is no whole step. */
const struct racing_step *race_step_of(const contestant *c);

/* Factor and solve of the step entered last, called again on the same values. */
contestant *race_add_bare(race *r);

/* A reference program that has taken r->system. */
contestant *race_add_reference(race *r, const char *measure, reference *child, int variant);

#endif
