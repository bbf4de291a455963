/* friction - motion of a particle that slides along planes under Coulomb friction, in closed form
 *
 *   v' = a - F v/|v|,  x' = v,  a and F constant;  v = 0 stays so where |a| <= F
 *
 * With A = |a|, k = F/A, phi the angle between v and a, and u = tan(phi/2), decreasing from u0:
 *   |v| = c (u^(k-1) + u^(k+1)),  dt = -|v|/(A u) du,
 * so that t and x are sums of powers of u. F |v| + a.v changes at the constant rate A^2 - F^2: the
 * particle stops for good only if F > A, after exactly (F |v| + a.v)/(F^2 - A^2). */
#ifndef MS_FRICTION_H
#define MS_FRICTION_H

/* Advance v by t (s); dx: the displacement (nullable). v and a are parallel to the planes. a: of
 * all other forces (m/s^2); F >= 0: friction force over mass (m/s^2). */
void ms_friction_slide(const double a[3], double F, double t, double v[3], double dx[3]);

/* The time after which the particle has stopped for good (s); INFINITY: never. */
double ms_friction_stop(const double a[3], double F, const double v[3]);

#endif
