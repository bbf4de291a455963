/* solver_comparison - times all that solves one linear system, in turn: whole steps, backends
 * alone, reference programs */
#ifndef BENCH_SOLVER_COMPARISON_H
#define BENCH_SOLVER_COMPARISON_H

#include "backend_proxy.h"
#include "cases.h"
#include "../bench_reference/reference_program.h"
#include "linear_system.h"
#include "timing.h"

enum { MOST_STEPS = 16, MAX_CANDIDATES = 2 * MOST_STEPS + REFERENCE_VARIANTS + 1 };

typedef struct solver_comparison {
  const moving_scene *moving;
  linear_system system; /* n = 0: only h and rtol are set */
  double warm;          /* s of untimed steps before each timed one */
  struct timed_step {
    const struct solver_comparison *comparison;
    backend_proxy proxy;
    const msim_backend *backends[2]; /* the proxy's table, NULL */
    msim_sim *sim;
  } steps[MOST_STEPS];
  struct timed_reference {
    reference_program *child;
    int variant;
  } references[REFERENCE_VARIANTS + 1];
  int series;   /* consecutive steps from the state of `moving` on, in each sample */
  double until; /* on the clock of clock_seconds: when a series is aborted */
  int nsteps, nreferences, count;
  timing_candidate all[MAX_CANDIDATES];
} solver_comparison;

/* Prepares a comparison on the step of length h from a scene's state. with_system: 1 if reference
 * programs take part and residuals are computed; not for the largest scenes. Returns NULL on
 * failure and sets err. */
solver_comparison *solver_comparison_create(const moving_scene *m, double h, double rtol,
                                            int with_system, msim_error *err);
void solver_comparison_free(solver_comparison *r);

/* Each function adds a candidate; its `failed` is set if it cannot run. */

/* Adds a whole step with option `solver`. table: its backend, which a proxy then forwards to for
 * solver_comparison_add_backend; NULL: no proxy. */
timing_candidate *solver_comparison_add_step(solver_comparison *r, const char *solver,
                                             const msim_backend *table, int32_t threads);

/* The data of a whole step; NULL for other candidates. */
const struct timed_step *solver_comparison_step(const timing_candidate *c);

/* Adds factor and solve of the step that was added last, repeated. */
timing_candidate *solver_comparison_add_backend(solver_comparison *r);

/* Sends r->system to a reference program; as reference_program_send_system. */
int solver_comparison_send(const solver_comparison *r, reference_program *child);

/* Adds a reference program, to which r->system was sent. */
timing_candidate *solver_comparison_add_reference(solver_comparison *r, const char *measure,
                                                  reference_program *child, int variant);

/* Prints the results of all candidates and writes a row for each. failures: writes those without a
 * result only, as rows of this measure; NULL: all, as rows of their own. */
void solver_comparison_report(report *out, const solver_comparison *r, const char *failures);

#endif
