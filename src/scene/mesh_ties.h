/* mesh_ties - which points of a lattice hold a vertex of the surface around them */
#ifndef MS_MESH_TIES_H
#define MS_MESH_TIES_H

#include "scene/mesh_inside.h"

enum { MS_MAX_TIES = 32 };

/* Find the points of the lattice to which vertex v is tied, the nearest first: those within 1.5
 * spacings, at least the 4 nearest, and more where these hold it in fewer than three directions.
 * They are of its part of the surface, or if that contains none of any part. points_of_part: the
 * number of points in each part; npoints: in all parts. Returns the number of ties, 0 only if no
 * point is inside. */
int32_t ms_mesh_find_ties(const ms_surface *s, const ms_inside *in, const int32_t *points_of_part,
                          int32_t npoints, int32_t v, int32_t points[MS_MAX_TIES]);

#endif
