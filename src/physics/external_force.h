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

/* A component of F (N) for one particle */
static inline double ms_external_force(const ms_external *e, int32_t axis, double mass, double x,
                                       double v) {
  (void)x;
  return mass * e->gravity[axis] - e->drag * v;
}

/* The same for one particle per lane: g along the axes of the unknowns, and -b */
typedef struct ms_external_lanes {
  ms_lanes gravity[3], minus_drag;
  int has_velocity;
} ms_external_lanes;

MS_INLINE ms_external_lanes ms_external_spread(int dims, const ms_external *e,
                                               const int32_t axis[3]) {
  const ms_lanes zero = {0};
  ms_external_lanes of = {.minus_drag = zero - (ms_real)e->drag,
                          .has_velocity = ms_external_has_velocity(e)};
  for (int c = 0; c < dims; c++) of.gravity[c] = zero + (ms_real)e->gravity[axis[c]];
  return of;
}

/* The terms in x; and, if there are any, those in v */
MS_INLINE ms_lanes ms_external_position_force(const ms_external_lanes *e, int c, ms_lanes mass,
                                              ms_lanes x) {
  (void)x;
  return mass * e->gravity[c];
}

MS_INLINE ms_lanes ms_external_add_velocity_force(const ms_external_lanes *e, ms_lanes v,
                                                  ms_lanes f) {
  return ms_simd_fma(e->minus_drag, v, f);
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
