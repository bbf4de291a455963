/* obstacles - colliders as obstacles of one particle: tangent planes, impacts, curvature
 *
 * A solid acts on a particle as the plane that touches it at the point nearest to the particle, so
 * that impacts, friction and simultaneous contact are those of planes (impacts.h). Solids inside
 * out with flat faces become planes: a box six of them, a cylinder two, and its curved side is a
 * capsule of infinite length; where they move, half-spaces in place of planes. So each solid that
 * remains is convex, or its inside is convex and its surface has a tangent plane everywhere, or it
 * has samples: particles move along its facets, or cells, in parts shorter than these. */
#ifndef MS_OBSTACLES_H
#define MS_OBSTACLES_H

#include "base/memory.h"
#include "contact/impacts.h"
#include "scene/scene.h"

/* Bounds on the motion of a solid, over all times: those of its center, and on its angular velocity
 * (1/s) and acceleration (1/s^2) */
typedef struct ms_solid_bounds {
  double speed, acceleration, spin, spin_rate;
} ms_solid_bounds;

/* The obstacles of a scene with colliders */
typedef struct ms_obstacles {
  int32_t nplanes, nsolids; /* planes: those of the scene and faces of solids inside out */
  msim_plane *plane;        /* nplanes, and nsolids tangent planes */
  ms_solid *solid;          /* nsolids; those that move at the instant `now` (moving_obstacles.h) */
  int32_t *number; /* of each plane: that of the plane of the scene, or its planes + the collider */
  int32_t *face; /* nsolids: 0, or -+(k + 1) of the half-space beyond the lower or upper face along
                      axis k of a collider */
  ms_solid_bounds *bounds; /* nsolids */
  int moves;               /* 1: a solid moves */
  ms_instant now;
} ms_obstacles;

/* After failure, 0, destroy frees what was allocated. */
int ms_obstacles_create(const ms_scene *scene, ms_obstacles *o);
void ms_obstacles_destroy(const ms_scene *scene, ms_obstacles *o);

/* Sets the tangent planes to those at the points nearest to x. */
void ms_obstacles_touch(const ms_collision_planes *planes, const double x[3]);

/* Sets normal and offset of the plane that touches the solid at the point nearest to x. */
void ms_obstacles_set_tangent(const ms_solid *solid, const double x[3], msim_plane *tangent);

/* The solid to which a plane of `planes` is tangent, or NULL */
static inline const ms_solid *ms_obstacles_get_solid(const ms_collision_planes *planes,
                                                     const msim_plane *plane) {
  const int64_t i = plane - planes->plane - (planes->n - planes->nsolids);
  return i >= 0 && i < planes->nsolids ? &planes->solid[i] : NULL;
}

/* The smallest spacing of the samples of a solid (m); INFINITY: it has none */
double ms_obstacles_find_cell(const ms_solid *solid);

/* A lower bound of the distance from a solid, whose signed distance is s: between samples of a grid
 * distances may change by more than the gradient says, which is counted as 4 times at most. */
double ms_obstacles_bound_distance(const ms_solid *solid, double s);

/* Moves x onto all planes of `touch` and the surfaces to which they are tangent, and updates the
 * tangent planes. */
void ms_obstacles_move_onto(const ms_collision_planes *planes, const ms_plane_set *touch,
                            double x[3]);

/* Normal accelerations of a particle that moves along the surfaces at v: s = 0, differentiated
 * twice, is n.a = -v.(dn/dx) v. least: one for each plane of `on`; 0 for those of flat surfaces. */
void ms_obstacles_find_centripetal(const ms_collision_planes *planes, const ms_plane_set *on,
                                   const double x[3], const double v[3], double *least);

/* 1: dx along its tangent plane leads from x beyond an edge of the solid: farther from it than its
 * surface curves away, R (sqrt(1 + b/R) - 1), b = dx.(dn/dx) dx, by more than the tolerance. Inside
 * out solids have no edges. */
int ms_obstacles_is_beyond_edge(const ms_solid *solid, const double x[3], const double dx[3],
                                double tolerance);

#endif
