/* impacts - one particle at half spaces: which it touches, how it bounces, what holds it
 *
 * Planes that are touched together act together, by impulses or forces J_i >= 0 along their normals
 * that are as small as can be: one problem with one solution, whatever the order of the planes
 * (Moreau 1988). */
#ifndef MS_IMPACTS_H
#define MS_IMPACTS_H

#include "msim/msim.h"

/* In space three normals are independent at most; a tip may have more. */
enum { MS_MOST_TOUCHED = 6, MS_MOST_HOLDING = 3 };

typedef struct ms_touch {
  int n;
  const msim_plane *plane[MS_MOST_TOUCHED];
} ms_touch;

static inline int ms_touch_holds(const ms_touch *touch, const msim_plane *plane) {
  for (int i = 0; i < touch->n; i++)
    if (touch->plane[i] == plane) return 1;
  return 0;
}

/* s = n.x - d */
double ms_distance(const msim_plane *p, const double x[3]);

typedef struct ms_walls {
  int32_t n;
  const msim_plane *plane;
  double reach; /* the size of the scene, by which coordinates near 0 are rounded too */
  double merge; /* m: what is nearer to a plane touches it */
} ms_walls;

/* A distance or a speed that may be rounding. */
double ms_distance_noise(const ms_walls *walls, const double x[3]);
double ms_speed_noise(const double v[3]);

/* The planes that x touches or lies outside of, in their order: s <= noise. */
ms_touch ms_touched(const ms_walls *walls, const double x[3]);

/* Those with n_i.v < limit */
ms_touch ms_touch_approached(const ms_touch *touch, const double v[3], double limit);

/* Those with impulses or forces J_i > noise; *pull: sum mu_i J_i over them. */
ms_touch ms_touch_pushing(const ms_touch *touch, const double *J, double noise, double *pull);

/* The vector nearest to u with n_i.u >= least_i for all planes, in place of u: u += sum J_i n_i.
 * J: one for each plane, 0 where it need not act. */
void ms_project(const ms_touch *touch, const double *least, double u[3], double *J);

/* Velocity after an impact: each plane that v runs into sends it back, n_i.v' = -e_i n_i.v, and the
 * part of v' along all of them is scaled by max(0, 1 - sum mu_i J_i/|v_t|). Until v' runs into
 * none. Returns 1 if there was an impact. */
int ms_bounce(const ms_touch *touch, double v[3]);

/* u += sum J_i n_i with n_i.u = to_i for the first three planes; 0: they are not independent, and u
 * stays. */
int ms_meet(const ms_touch *touch, const double *to, double u[3], double *J);

/* On all planes of `touch`: x += sum c_i n_i. 3 independent ones at most. */
void ms_put_on(const ms_touch *touch, double x[3]);
/* ... at those distances from them */
void ms_put_at(const ms_touch *touch, const double *distance, double x[3]);

/* u without its components along the normals: u' = u + sum J_i n_i with n_i.u' = 0. Returns
 * sum mu_i max(0, J_i): how hard friction can pull where u is an acceleration. least: the smallest
 * J_i (nullable). 3 independent planes at most. */
double ms_keep_along(const ms_touch *touch, double u[3], double *least);

/* The planes that a presses on by more than `noise`; in place of a: what all of them leave of it;
 * *pull: sum of mu N/m. */
ms_touch ms_touch_pressed(const ms_touch *touch, double noise, double a[3], double *pull);

#endif
