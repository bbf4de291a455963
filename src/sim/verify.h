/* verify - steps that integrator = auto has chosen, verified as they are made
 *
 * The choice (select.h) is by the beginning of a run; this looks at what comes later. A step is
 * verified before it is accepted, so that no state that was seen is ever taken back. MERCURIUS and
 * TRACE look for encounters within a step likewise (Rein et al., MNRAS 485 (2019) 5490; Lu,
 * Hernandez and Rein, MNRAS 533 (2024) 3708).
 *
 * Frequencies of springs are bounded in every state. So what fixed steps cannot follow is a spring
 * that turns, or larger motion. Both have signs that cost no evaluation: the largest angle by which
 * a spring turned, and
 *   D = x' - x - h/2 (v + v') - h^2/12 (a - a') = O(h^5)
 * of methods that carry the acceleration a. A step is verified, that is, made in two halves, too,
 * where a sign is three times as large as in steps verified before, where a spring turned by 45
 * degrees, and once in MS_VERIFY_INTERVAL steps. With planes near, each step is verified in which
 * particles stop, slip or turn on paths that may be too inaccurate, or at least one in 64 bounces;
 * of more particles some always do. Such steps may differ from their halves by tol/16. Reflection
 * at the ends of steps is of order 1: halves say nothing of it.
 *
 * The difference of whole and halves may be what makes tol at the end of the run if all steps have
 * it: that of steps at the choice, times tol over the error at the end foreseen from there; as
 * errors cancel and are foreseen with care, 50 times that, but tol/4 at most, as those of events do
 * not cancel. Where it is larger, the next step is verified, too. The halves take the step's place
 * as long as they are accurate enough themselves: their error is 2^p - 1 times less than what they
 * differ by, p the order, in steps without an event, unless that is more than tol/4. Else error
 * control makes this step and those to come, in as many parts as it takes, until one part is as
 * long as a step again; parts may add as much as under tol, or a 16th of that if it is more. So the
 * grid of steps, and of frames, stays.
 *
 * Steps in other variables than x and v cannot be halved: such methods take part only where
 * particles are many. Where nothing dissipates, energy is looked at now and then by any method: an
 * error above 10 tol is reported to options.warn. */
#ifndef MS_VERIFY_H
#define MS_VERIFY_H

#include "base/bytes.h"
#include "integrate/integrator.h"
#include "physics/scales.h"

enum { MS_VERIFY_INTERVAL = 80 };

enum { MS_EVENTS = 16 }; /* in a run: as many share tol */

/* A step */
typedef struct ms_measured {
  double error;   /* by which two halves differ from it, in the norm of errors */
  double sign[2]; /* D, in that norm; 1 - cos of the largest angle */
} ms_measured;

/* Of one island */
typedef struct ms_check {
  double sign[2]; /* the largest in steps verified: D, in the norm of errors; 1 - cos of an angle */
  int all;        /* the last step verified was found too inaccurate: the next one is, too */
  double h;       /* s: steps are made under error control, in parts of that; 0: they are not */
  double *x, *v;  /* a start to go back to; NULL: nothing is verified */
} ms_check;

/* Of the whole run */
typedef struct ms_verification {
  ms_scales scales; /* of the scene */
  double allowed;   /* error of a step; 0: steps are not verified */
  int only_events;  /* steps are verified for their events alone */
  double sign[2];   /* of steps at the choice */
  double energy;    /* J, where the method began */
  int warned;       /* of energy */
  int away;         /* planes do not count yet */
  int64_t due;      /* the step at which they are looked at next */
} ms_verification;

struct msim_sim;
struct ms_motion;

msim_status ms_verify_create(const struct msim_sim *sim, const ms_model *model, ms_check *check,
                             msim_error *err);
void ms_verify_destroy(const ms_model *model, ms_check *check);

/* A run by the method chosen begins in the present state. */
void ms_verify_start(struct msim_sim *sim);

/* A step by one island from x to x_next, verified. */
msim_status ms_verify_step(const struct msim_sim *sim, struct ms_motion *m, msim_error *err);

/* After a step: is energy what it was? */
void ms_verify_energy(struct msim_sim *sim);

/* One step of a sim in which methods are tried */
msim_status ms_verify_measure(struct msim_sim *sim, const ms_scales *scales, ms_measured *step,
                              msim_error *err);

/* Could a plane be met within some steps of h? And before a step: is that so the first time? */
int ms_verify_is_plane_close(const struct msim_sim *sim, double h);
int ms_verify_meets_planes(struct msim_sim *sim);

void ms_verification_history(ms_bytes *bytes, ms_verification *v);
void ms_check_history(ms_bytes *bytes, ms_check *check);

#endif
