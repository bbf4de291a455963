/* signed_distance - exact distances from the surfaces of colliders */
#ifndef MS_SIGNED_DISTANCE_H
#define MS_SIGNED_DISTANCE_H

#include "scene/colliders.h"

/* The distance of x from the surface of s (m), negative where particles must not be, and its
 * gradient, the unit normal that points to the side of the particles: x - distance * normal is the
 * point of the surface nearest to x. Where several points are nearest, as from the center of a
 * sphere, the normal is that of one of them. */
double ms_signed_distance(const ms_solid *s, const double x[3], double normal[3]);

/* A lower bound of the distances of the points x of a box, |x_c - middle_c| <= half_c; -INFINITY
 * where none is known, as inside solids with samples. */
double ms_signed_distance_bound(const ms_solid *s, const double middle[3], const double half[3]);

/* The velocity of the point x of the solid (m/s): that of its center + spin x (x - center) */
void ms_signed_distance_find_velocity(const ms_solid *s, const double x[3], double v[3]);

/* u.(dn/dx) u near the surface, n the normal (|u|^2/m): how fast n turns along u. 0 on flat faces;
 * of an edge that of one of its faces. */
double ms_signed_distance_bend(const ms_solid *s, const double x[3], const double u[3]);

/* Rounding tolerance of that distance, m */
double ms_signed_distance_tolerance(const ms_solid *s, const double x[3]);

#endif
