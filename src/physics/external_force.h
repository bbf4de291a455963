/* external_force - the forces on particles that no spring exerts: gravity and drag
 *
 *   F = m g - b v,  dF/dx = 0,  dF/dv = -b I,  potential energy -m g.x
 *
 * All forces, matrices, bounds and energies take these terms from here. The constant force of each
 * particle is an array of the scene (ms_scene.force) and a vector of a model (ms_model.force). */
#ifndef MS_EXTERNAL_FORCE_H
#define MS_EXTERNAL_FORCE_H

#include "base/simd.h"
#include "base/vec3.h"
#include "scene/scene.h"

/* 1: F depends on velocities. */
static inline int ms_external_has_velocity(const ms_external *e) { return e->drag > 0; }

/* A component of F (N) for one particle; and for one particle per lane, its terms in x and then, if
 * there are any, those in v */
static inline double ms_external_force(const ms_external *e, int32_t axis, double mass, double x,
                                       double v) {
  (void)x;
  return mass * e->gravity[axis] - e->drag * v;
}

MS_INLINE ms_lanes ms_external_position_force(const ms_external *e, int32_t axis, ms_lanes mass,
                                              ms_lanes x) {
  (void)x;
  return mass * (ms_real)e->gravity[axis];
}

MS_INLINE ms_lanes ms_external_add_velocity_force(const ms_external *e, ms_lanes v, ms_lanes f) {
  return ms_simd_fma((ms_lanes){0} - (ms_real)e->drag, v, f);
}

/* -dF/dv (N s/m), and bounds on it for the particles of a scene */
static inline double ms_external_damping(const ms_external *e) { return e->drag; }

/* What a diagonal element of A = M - h D - h^2 J contains beside m and springs, kg */
static inline double ms_external_matrix(const ms_external *e, double h) { return h * e->drag; }

/* The potential energy of a particle, J */
static inline double ms_external_energy(const ms_external *e, double mass, const double x[3]) {
  return -(mass * ms_vec3_dot(e->gravity, x));
}

/* The sum of m g.x (J) over particles with sum m x = moment: minus their potential energy */
static inline double ms_external_work(const ms_external *e, const double moment[3]) {
  return ms_vec3_dot(e->gravity, moment);
}

/* |g|, m/s^2: the acceleration of a particle at rest */
static inline double ms_external_acceleration(const ms_external *e) {
  return ms_vec3_norm(e->gravity);
}

#endif
