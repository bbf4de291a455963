/* start_check - warns of particles that start where they must not be */
#ifndef MS_START_CHECK_H
#define MS_START_CHECK_H

#include "sim/sim.h"

/* Warn, once, if free particles of the scene start behind a plane or in a collider, by more than a
 * relative 1e-9. The first step moves them out of it. */
void ms_start_check_warn(const msim_sim *sim);

#endif
