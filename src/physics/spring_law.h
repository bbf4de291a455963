/* spring_law - the law of springs: all forces, matrices, energies and reports are computed from
 * these expressions
 *
 * A spring of stiffness k (N/m), rest length L (m) and damping c (N s/m) pulls the particles at its
 * ends together. With d = x_j - x_i, l = |d|, u = d/l and v = v_j - v_i, the force on i is
 *   (f(l) + c u.v) u,  f = k (l - L),
 * the elastic energy is the integral of f from L, and the Jacobian of the force has f/l across the
 * spring and df/dl along it.
 *
 * These are the linear springs; those with another f(l) are in law.h.
 *
 * The expressions are macros, as operands are numbers of one spring (double) or of one spring per
 * lane (ms_lanes), for which C has the same operators. Their order of operations determines the
 * last bits of results. */
#ifndef MS_SPRING_LAW_H
#define MS_SPRING_LAW_H

#include "scene/laws.h"

/* The smallest normal double. A spring with l^2 below it has no direction. */
#define MS_MIN_LENGTH2 2.2250738585072014e-308

/* f (N): 0 at the rest length, without rounding error */
#define MS_SPRING_FORCE(k, rest, l) ((k) * ((l) - (rest)))

/* f/l, and df/dl - f/l, given L/l: the stiffness across the spring, and what that along it exceeds
 * it by. L/l at most 1 clamps the matrix: no stiffness is negative. */
#define MS_SPRING_STIFFNESS_ACROSS(k, ratio)     ((k) * (1 - (ratio)))
#define MS_SPRING_STIFFNESS_DIFFERENCE(k, ratio) ((k) * (ratio))

/* The elastic energy E (J) */
#define MS_SPRING_ENERGY(k, rest, l) (0.5 * (k) * ((l) - (rest)) * ((l) - (rest)))

/* E(l + a + b) - E(l) - f(l) a, where no terms cancel if a and b are small */
#define MS_SPRING_ENERGY_BEYOND(k, rest, l, a, b) \
  ((k) * (0.5 * ((a) + (b)) * ((a) + (b)) + ((l) - (rest)) * (b)))

/* c u.v (N), given u.v */
#define MS_DASHPOT_FORCE(damping, rate) ((damping) * (rate))

/* 1: the force is k d, whatever the direction. */
static inline int ms_spring_is_linear(const ms_scene *s, int32_t spring, double rest,
                                      double damping) {
  return rest == 0 && damping == 0 && !ms_scene_law(s, spring);
}

/* The same with the scene's own values */
static inline int ms_scene_is_linear(const ms_scene *s, int32_t spring) {
  return ms_spring_is_linear(s, spring, s->rest[spring], ms_scene_damping(s, spring));
}

#endif
