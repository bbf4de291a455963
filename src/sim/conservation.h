/* conservation - energy in a run whose method integrator = auto has chosen
 *
 * If nothing dissipates, energy is checked now and then: an error above 10 tol m U^2, with mass and
 * speed of the scene, is reported to options.warn. */
#ifndef MS_CONSERVATION_H
#define MS_CONSERVATION_H

#include "sim/sim.h"

/* The energy in the present state is that of the run. */
void ms_conservation_start(msim_sim *sim);

/* (E - E_0)/(m U^2), where energy is conserved or the method is multirate */
double ms_conservation_find_gain(msim_sim *sim);

/* Check the energy after a step, and report its error. */
void ms_conservation_check(msim_sim *sim);

#endif
