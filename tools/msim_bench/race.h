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
  linear_system system;
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
  int nsteps, nreferences, count;
  contestant all[MOST_CONTESTANTS];
} race;

/* A race over the step of length h from a scene's state; NULL: it failed, and why in err. */
race *race_new(const moving *m, double h, double rtol, msim_error *err);
void race_free(race *r);

/* Enter one: the contestant, whose `failed` tells that it cannot run. */

/* A whole step, option `solver` being the name; table: the backend behind it, NULL if built in. */
contestant *race_add_step(race *r, const char *solver, const msim_backend *table);

/* Factor and solve of the step entered last, called again on the same values. */
contestant *race_add_bare(race *r);

/* A reference program that has taken r->system. */
contestant *race_add_reference(race *r, const char *measure, reference *child, int variant);

#endif
