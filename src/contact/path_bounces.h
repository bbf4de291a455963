/* path_bounces - short or ending series of bounces on one surface, summed */
#ifndef MS_PATH_BOUNCES_H
#define MS_PATH_BOUNCES_H

#include "contact/path_progress.h"

/* Returns 1 if the bounces of a particle that leaves the plane with v under a are summed in a step
 * of h, and their height and the displacement by their friction are at most `jump` (m). */
int ms_path_bounces_are_summed(const msim_plane *plane, const double v[3], const double a[3],
                               double h, double jump);

/* After a bounce on one plane: sum the bounces that follow. */
void ms_path_bounces_sum(ms_path_progress *k, const msim_plane *q);

#endif
