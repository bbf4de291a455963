/* overview - the advice with which msim_sim_explain begins: five lines that say what to do with the
 * run, by which method, at what cost, what limits its steps, and how large its files are */
#ifndef MS_OVERVIEW_H
#define MS_OVERVIEW_H

#include "sim/sim.h"

/* Append the lines; sim->config.step_limit has been computed. Errors: those of msim_sim_estimate
 * below 0; first steps that fail become advice. */
msim_status ms_overview_explain(msim_sim *sim, ms_text *out, msim_error *err);

#endif
