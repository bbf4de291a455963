/* path_impact - the next impact of a particle on its path */
#ifndef MS_PATH_IMPACT_H
#define MS_PATH_IMPACT_H

#include "contact/path_progress.h"

/* The first plane that the parabola from x with v and a meets within `left`; NULL: none. */
const msim_plane *ms_path_impact_find(const ms_path_progress *k, const double v[3],
                                      const double a[3], double left, double *when);

/* The first impact while a particle slides with v and the acceleration `bend` in its frame */
const msim_plane *ms_path_impact_find_in_frame(const ms_path_progress *k, const double bend[3],
                                               double left, double *when);

#endif
