/* fast_turns - for integrator = auto, where springs turn within few fixed steps
 *
 * A spring that swings through a short length turns by a large angle in a short time: an event that
 * fixed steps do not resolve. Verification (sim/step_verification.h) detects single ones. But where
 * springs turn by 8 degrees in a step already in the states of the pilot run, many follow; some
 * stay below what is detected, and their errors add up. Of random networks without planes in which
 * a disturbance grows less than 20-fold, 61 of 246 with 12 to 51 particles and 36 of 70 with 64 to
 * 123 missed tol with fixed steps. With error control instead 5 and 3 do, for 1.4 and 2.3 times the
 * evaluations. In nine of ten swinging ropes springs turn by less than 6 degrees, in cloths and
 * blocks by less than 4. */
#ifndef MS_FAST_TURNS_H
#define MS_FAST_TURNS_H

#include "choose/pilot_run.h"

/* 1: in the start, the middle or the end of the pilot run, a spring whose direction matters turns
 * by that much within h. */
int ms_fast_turns_are_there(const ms_pilot_run *p, double h);

#endif
