/* resonance - leave respa where a resonance adds energy, for integrator = auto
 *
 * respa is unstable where its step is near a multiple of half the period of a stiff vibration
 * (Biesiadecki and Skeel, J. Comput. Phys. 109 (1993) 318). Frequencies change as springs turn and
 * stretch: no trial at the start of a run shows every resonance. Unstable vibrations gain energy
 * exponentially, and nothing else in a scene does: where the energy exceeds that of the start by
 * tol m U^2, the run continues by velocity Verlet, whose stable steps divide those of respa. */
#ifndef MS_RESONANCE_H
#define MS_RESONANCE_H

#include "sim/sim.h"

/* 1: the run is by respa, which auto chose. */
int ms_resonance_may_occur(const msim_sim *sim);

/* Before a step; 1: the energy has grown too much. */
int ms_resonance_is_there(msim_sim *sim);

/* Continue by velocity Verlet; on failure nothing changes. */
msim_status ms_resonance_leave(msim_sim *sim, msim_error *err);

#endif
