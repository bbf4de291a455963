/* select - integrator = auto: of a few methods the cheapest that keeps tol in the scene
 *
 * Costs are counted, never timed, in evaluations of forces for a simulated second: the price of a
 * step over its length. A method's step is as long as stability and accuracy allow, and accuracy is
 * found by steps tried from a few states of the run's beginning, which velocity Verlet flies
 * through first, as a start at rest says little. The dearest state counts. An implicit method makes
 * the whole run instead, at a fifth of the best cost, or is passed over.
 *
 * Mostly the method runs under error control, which sees to it that tol is kept in states that were
 * not tried. It takes fixed steps where stability alone sets them, at MS_MARGIN times less error
 * than tol allows in all states tried: then there is nothing to control, and steps made of two
 * halves and a whole one cost 1.5 times as much. Shorter fixed steps, with that margin, would cost
 * as much as those under control. Nothing is fixed where there are planes. */
#ifndef MS_SELECT_H
#define MS_SELECT_H

#include "base/bytes.h"
#include "integrate/integrator.h"

#define MS_MARGIN 4.0

enum { MS_CANDIDATES = 5 };

typedef struct ms_candidate {
  const ms_integrator *method;
  double price; /* of a step, in evaluations; with the whole step that control compares with */
  double cost;  /* evaluations for a second; INFINITY: it cannot take part */
  double h;     /* s: the step, the shortest where states differ */
  int held;     /* by stability, not by accuracy */
  int fixed;    /* without control */
  int why;      /* it was passed over, where its cost is not known; 0: it is */
} ms_candidate;

typedef struct ms_selection {
  double tol;      /* asked for; 0: the method was named */
  double flown;    /* s: the beginning of the run that the states are from */
  double price;    /* of the whole choice, in evaluations */
  int32_t best;    /* of candidates */
  int out_of_date; /* what was built is for another method, or for other springs */
  ms_candidate candidates[MS_CANDIDATES];
} ms_selection;

/* Choose by what is ahead from x, v (flat 3n) at t0 on: a pure function of scene, options and that
 * state. Sets the method, and tol or h, as if they had been asked for; keeps what is where that
 * fails. */
msim_status ms_sim_select(msim_sim *sim, double t0, const double *x, const double *v,
                          msim_error *err);

/* All of it, and taken again. */
void ms_selection_history(ms_bytes *bytes, ms_selection *selection);

void ms_selection_explain(const ms_selection *selection, ms_text *out);

#endif
