/* path_bounces - short or ending series of bounces on one surface, summed */
#ifndef MS_PATH_BOUNCES_H
#define MS_PATH_BOUNCES_H

#include "contact/path_progress.h"

/* Returns 1 if the bounces of a particle that leaves the plane with v under a are summed in a step
 * of h, and their height and the displacement by their friction are at most `reach` (m). */
int ms_path_bounces_are_summed(const msim_plane *plane, const double v[3], const double a[3],
                               double h, double reach);

/* The speed (m/s) below which a particle does not leave any of several planes that it touches: such
 * bounces are infinitely many and not summed, and their height is little more than rounding. 0 on
 * one plane. pull: |a|, m/s^2 */
double ms_path_bounces_find_rest_speed(const ms_collision_planes *planes,
                                       const ms_plane_set *touched, const double x[3], double pull,
                                       double reach);

/* After a bounce on one plane: sum the bounces that follow. With friction, whose mean force may end
 * the slide elsewhere than its impulses would, only those within p->bounce_reach. */
void ms_path_bounces_sum(ms_path_progress *k, const msim_plane *q);

#endif
