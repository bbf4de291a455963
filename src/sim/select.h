/* select - integrator = auto: of a few methods the cheapest that keeps tol in the scene
 *
 * Costs are counted, never timed, in evaluations of forces for a simulated second: the price of a
 * step over its length. A method's step is as long as stability and accuracy allow. At first all
 * are taken to be as cheap as stability allows; the cheapest is tried (probe.h), which mostly makes
 * it dearer, until the cheapest is one that has been tried. So what cannot win costs nothing. What
 * a trial costs is added to the cost of what has not been tried, fourfold, as few win as much as
 * they might: a run of a hundred steps takes a method that is easily found.
 *
 * tr-bdf2 and dop853 run under error control, too: dop853 over a part of the flight, which tells
 * its cost, and alone where particles are few, as one event decides on the error there. The others
 * take fixed steps: what control compares costs half as much again, and it adds up errors that
 * methods which keep energy within bounds make good again, up to a hundredfold. Their steps are
 * verified (verify.h). LSODA (Petzold, SIAM J. Sci. Stat. Comput. 4 (1983) 136) likewise compares
 * the steps that each method could take.
 *
 * Until a plane is close the choice is as without planes; then it is made anew.
 *
 * Where stability sets the steps, respa is tried if few springs do so, and tr-bdf2 makes the whole
 * run, at a fifth of the best cost, or is passed over. */
#ifndef MS_SELECT_H
#define MS_SELECT_H

#include "base/bytes.h"
#include "sim/verify.h"

enum { MS_CANDIDATES = 10 };

typedef struct ms_candidate {
  const ms_integrator *method;
  int32_t collision; /* impacts are located, or reflected at the ends of steps */
  int controlled;    /* not in fixed steps */
  double price;      /* of a step, in evaluations */
  double cost;       /* evaluations for a second, or the least that it may be; INFINITY: it cannot
                        take part */
  double h;          /* s: the step */
  double error;      /* at the end of the run; 0: it was not tried */
  int tried;         /* and found to be worth h */
  int why;           /* it was passed over; 0: it was not */
} ms_candidate;

typedef struct ms_selection {
  double tol;        /* asked for; 0: the method was named */
  int32_t collision; /* as asked for */
  double flown;      /* s: the beginning of the run that was looked at */
  double price;      /* of the whole choice, in evaluations */
  int32_t best;      /* of candidates */
  int damped;        /* which are those for forces that depend on velocities */
  int64_t parts;     /* of a step of the sim: so many steps of the method */
  int out_of_date;   /* what was built is for another method, or for other springs */
  ms_verification verification;
  ms_candidate candidates[MS_CANDIDATES];
} ms_selection;

/* Choose by what is ahead from x, v (flat 3n) at t0 on: a pure function of scene, options and that
 * state. late: the run goes on, and planes count. Sets the method, and tol or h, as if they had
 * been asked for; keeps what is where that fails. */
msim_status ms_sim_select(msim_sim *sim, int late, double t0, const double *x, const double *v,
                          msim_error *err);

/* All of it, and taken again. */
void ms_selection_history(ms_bytes *bytes, ms_selection *selection);

void ms_selection_explain(const ms_selection *selection, ms_text *out);

#endif
