/* race - times all that solves one linear system, in turn: whole steps, backends alone, reference
 * programs */
#ifndef BENCH_RACE_H
#define BENCH_RACE_H

#include "probe.h"
#include "reference.h"
#include "system.h"
#include "timing.h"

enum { MOST_STEPS = 16, MOST_CONTESTANTS = 2 * MOST_STEPS + REFERENCE_VARIANTS + 1 };

typedef struct race {
  const moving *moving;
  linear_system system; /* n = 0: only h and rtol are set */
  double warm;          /* s of untimed steps before each timed one */
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
  int series;   /* consecutive steps from the state of `moving` on, in each sample; 0: one; to be
                   set before race_add_step */
  double until; /* on wall_seconds' clock: when a series is aborted */
  int nsteps, nreferences, count;
  contestant all[MOST_CONTESTANTS];
} race;

/* Prepares a comparison on the step of length h from a scene's state. with_system: 1 if reference
 * programs take part and residuals are computed; not for the largest scenes. Returns NULL on
 * failure and sets err. */
race *race_new(const moving *m, double h, double rtol, int with_system, msim_error *err);
void race_free(race *r);

/* Each function adds a candidate; its `failed` is set if it cannot run. */

/* Adds a whole step with option `solver`. table: its backend, which a probe then forwards to for
 * race_add_bare; NULL: no probe. */
contestant *race_add_step(race *r, const char *solver, const msim_backend *table, int32_t threads);

/* The data of a whole step; NULL for other candidates. */
const struct racing_step *race_step_of(const contestant *c);

/* Adds factor and solve of the step that was added last, repeated. */
contestant *race_add_bare(race *r);

/* Adds a reference program, to which r->system was sent. */
contestant *race_add_reference(race *r, const char *measure, reference *child, int variant);

#endif
