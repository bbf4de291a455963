/* law_breaking - finds the springs of an island that exceed a threshold of their law
 *
 * The test itself evaluates the law. Two bounds spare it in most steps:
 *   - a spring up to its limit of length exceeds no threshold;
 *   - if all springs are shorter than their limits by `slack` or more, none exceeds one before some
 *     particle is farther than slack/2 from where it was then.
 * Both leave room for rounding errors, and the test decides about all springs beyond their limits:
 * the bounds change no result. */
#ifndef MS_LAW_BREAKING_H
#define MS_LAW_BREAKING_H

#include "physics/law_springs.h"

/* A length (m) up to which a spring of this law does not break; below 0: none is known. */
double ms_law_breaking_limit(const ms_law *law, double k, double rest);

/* The number of springs that exceed a threshold of their law at x, and are not broken yet; ghosts
 * of x must be current (halo.h). `mark` writes MS_BREAKING for these to broken[], the flags of the
 * scene's springs, and returns the sum of their energies below that at rest, J, on several ranks
 * this rank's share. */
int32_t ms_law_breaking_count(const ms_model *model, const double *x);
double ms_law_breaking_mark(const ms_model *model, const double *x, uint8_t *broken);

#endif
