/* island_step - make one step of one island: whole, in substeps, or as error control makes it */
#ifndef MS_ISLAND_STEP_H
#define MS_ISLAND_STEP_H

#include "sim/sim.h"

/* How many times the number of substeps is doubled if a step fails. */
int32_t ms_island_step_count_retries(const msim_sim *sim);

/* n substeps of h/n by that method and one island, one after the other, from x to x_next. */
msim_status ms_island_step_make_substeps(const msim_sim *sim, const ms_integrator *method,
                                         ms_stepper *s, int64_t n, msim_error *err);

/* A step of s->h by one island as error control makes it: it does not end at its first impact, but
 * returns that in s->impact. m->error: its error, over what c allows. */
msim_status ms_island_step_make_controlled(const msim_sim *sim, const ms_integrator *method,
                                           struct ms_island_sim *m, const ms_control *c,
                                           msim_error *err);

/* By how much dense output at an impact in the step just made amplifies the error of the step: at
 * least 1; U/|n.v| of the first impact of this island, U the speed of errors (physics/norm.h); more
 * beyond the limit of stability. INFINITY: it does not show the state of the island there. */
double ms_island_step_find_amplification(const struct ms_island_sim *m);

/* The error of particles on paths of their own (impact_location.h) in the step, over what an event
 * may add. */
double ms_island_step_find_path_error(const struct ms_island_sim *m);

/* 1: shorter steps may succeed after a failure with this status. */
int ms_island_step_may_retry(msim_status status);

#endif
