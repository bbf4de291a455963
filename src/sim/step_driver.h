/* step_driver - make one step of a sim: with the planned length; in substeps if it fails as a
 * whole; or, under error control, with the length that keeps its error small enough */
#ifndef MS_STEP_DRIVER_H
#define MS_STEP_DRIVER_H

#include "sim/sim.h"

#define MS_DEFAULT_TOL 1e-6

/* Choose between fixed steps and error control, from the options and the method. MSIM_ERR_ARG: tol
 * together with `steps`, or with a method that has no error control. */
msim_status ms_step_driver_choose_control(msim_sim *sim, msim_error *err);

/* Make one step with all islands that are not at rest. If one of them fails the state stays. */
msim_status ms_step_driver_make_step(msim_sim *sim, msim_error *err);

/* Begin a run under error control, as it is planned. */
void ms_step_driver_start_control(msim_sim *sim);

/* Let msim_sim_state return the state at t, the end of the last step or a time inside it. */
void ms_step_driver_show_time(msim_sim *sim, double t);

/* Set the length of the next step to try (s). */
void ms_step_driver_set_step(msim_sim *sim, double h);

/* 1: the frame shown last, or the next one, lies inside the last step. */
int ms_step_driver_has_frame_inside(const msim_sim *sim);

/* If so, compute the dense output of that step, before its springs or contacts are forgotten. */
void ms_step_driver_prepare_dense_output(msim_sim *sim);

#endif
