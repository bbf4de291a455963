/* sampled_distance - signed distances from height fields and from grids of signed distances, in the
 * coordinates q of the solid (colliders.h); n: the unit normal, to the outside
 *
 * Height field: the surface over each cell is two triangles, divided by the diagonal from (i, j) to
 * (i + 1, j + 1), so that the nearest point has a closed form; beyond the border it continues
 * horizontally, with the heights of the border. Below the surface, and near above it, the
 * distance is exact; where more than a cell is free above it, it is a lower bound, (q_2 - height)
 * cos of the steepest slope.
 *
 * Grid: f by trilinear interpolation. Inside the grid f/|grad f|, the distance to first order, with
 * |grad f| counted as 1/2 at least; outside, where there is no solid, the lower bound
 * sqrt(b^2 + f^2), with the distance b from the grid and f at the nearest point of it. */
#ifndef MS_SAMPLED_DISTANCE_H
#define MS_SAMPLED_DISTANCE_H

#include "scene/colliders.h"

double ms_sampled_distance_of_heights(const ms_solid *s, const double q[3], double n[3]);
double ms_sampled_distance_of_grid(const ms_solid *s, const double q[3], double n[3]);

#endif
