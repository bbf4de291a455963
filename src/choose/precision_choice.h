/* precision_choice - precision = auto: which candidates of integrator = auto compute with floats
 *
 * In single precision forces are those at positions rounded to floats (physics/single.h). With u =
 * 2^-24 and R the largest distance from the origin of positions, the force of a spring is off by
 * some k u R, and that of a dashpot by c u U. These errors change once a coordinate has moved by
 * its rounding, and at the latest with the next step: after tau = 1/w + u R/U, w the largest
 * frequency.
 * So velocities make a random walk, and after the time T
 *   |dv| = u sqrt(tau T/2) A,  A^2 = sum_e (k_e R + c_e U)^2 (1/m_i + 1/m_j)/m,
 *   |dx| <= u sqrt(tau T/2) w R,
 * as vibrations of frequency w have dx = dv/w. Relative errors u of k, m and h change phases by at
 * most u w T. In the norm of errors, with the extent L and the speed U of the scene:
 *   E = u (w T + sqrt(tau T/2) sqrt(((w R/L)^2 + (A/U)^2)/2)).
 * Errors measured were 0.01 to 0.7 of that, unless the motion amplifies them, as it then amplifies
 * the errors of steps, too: E has to be below tol/4.
 *
 * The error of a step is u A h/(sqrt(2) U) <= E h sqrt(2 w/T). Where steps are verified (sim/
 * step_verification.h), it has to be below a quarter of the difference that is allowed there; once
 * a verified step needs substeps, the run continues with doubles. Error control compares states in
 * double precision, and so does the growth of errors (sim/error_growth.h): floats are for fixed
 * steps in scenes in which that growth is not measured. */
#ifndef MS_PRECISION_CHOICE_H
#define MS_PRECISION_CHOICE_H

#include "choose/pilot_run.h"

/* E of a run from the start of the pilot run; INFINITY: floats are not possible here, or doubles
 * were requested */
double ms_precision_choice_estimate_error(const ms_pilot_run *p);

/* 1: this method can make its steps with floats. */
int ms_precision_choice_takes(const ms_candidate *c);

/* 1: it does, as they keep tol; and as they are no obstacle to this verification. */
int ms_precision_choice_allows(const ms_pilot_run *p, const ms_candidate *c);
int ms_precision_choice_is_verifiable(const ms_pilot_run *p, const ms_candidate *c,
                                      const ms_step_verification *v);

/* The line of msim_sim_explain */
void ms_precision_choice_explain(const msim_sim *sim, ms_text *out);

#endif
