/* drive - how a sim makes one step: of the length that is planned; in parts, where it cannot be
 * made whole; or, under error control, of the length that keeps its error small enough */
#ifndef MS_DRIVE_H
#define MS_DRIVE_H

#include "sim/sim.h"

#define MS_DEFAULT_TOL 1e-6

/* Fixed steps or error control, from the options and the method; refuses what cannot be. */
msim_status ms_drive_choose(msim_sim *sim, msim_error *err);

/* Times that the parts of a step are halved where it cannot be made. */
int32_t ms_drive_retries(const msim_sim *sim);

/* All islands that are not at rest make a step, or none: where one fails, the state stays. */
msim_status ms_drive_step(msim_sim *sim, msim_error *err);

/* n steps of h/n by one island, one after the other, from x to x_next. */
msim_status ms_drive_parts(const msim_sim *sim, ms_stepper *s, int64_t n, msim_error *err);

/* A step of s->h by one island as error control makes it: not cut at its first impact, but that is
 * told. m->error: its error, of what c allows. */
msim_status ms_drive_controlled(const msim_sim *sim, struct ms_motion *m, const ms_control *c,
                                msim_error *err);

/* The error of the paths that particles took in the step just made, over what an event may add. */
double ms_drive_path_error(const struct ms_motion *m);

/* Shorter steps may help where one failed like this. */
int ms_drive_may_help(msim_status status);

/* Begin a run under error control as it is planned. */
void ms_drive_start(msim_sim *sim);

/* Who looks at the state is to see that of t, at the end of the last step or within it. */
void ms_drive_show(msim_sim *sim, double t);

/* Take the scales of errors from the present state, for a run of `span` (s). */
void ms_drive_measure(msim_sim *sim, double span);

/* The next step to try has this length (s). */
void ms_drive_use_step(msim_sim *sim, double h);

#endif
