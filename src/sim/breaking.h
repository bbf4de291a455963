/* breaking - springs whose law has a threshold break at the end of the step in which they exceed it
 *
 * A broken spring exerts no force: its k, damping and law count as 0. Particles, springs and
 * islands keep their numbers and matrices their patterns. The plan of the run goes on, with its
 * times and frames; as in a run that starts in this state, nothing is left of the steps before:
 * stages, factorizations, scales of errors. */
#ifndef MS_BREAKING_H
#define MS_BREAKING_H

#include "sim/sim.h"

/* MSIM_ERR_ARG where springs break and the method does not support that; otherwise give the sim a
 * scene of its own, whose springs can break. For a new sim. */
msim_status ms_breaking_prepare(msim_sim *sim, msim_error *err);

/* After a step: break the springs that exceed a threshold. MSIM_UNSTABLE: the energy monitor
 * refuses the state, and none breaks. */
msim_status ms_breaking_follow(msim_sim *sim, msim_error *err);

/* Mark n springs of the scene as broken, and start from the present state. */
void ms_breaking_break(msim_sim *sim, int32_t n, const int32_t *springs);

/* Record that solvers are chosen for the springs that are broken now. */
void ms_breaking_set_before(ms_scene *scene);

#endif
