/* impacts - contact of one particle with planes: touched planes, impacts, constraint forces
 *
 * All planes that a particle touches act at once, by impulses or forces J_i >= 0 along their
 * normals that change its velocity or acceleration least: the solution is unique and does not
 * depend on the order of the planes (Moreau 1988). n_i, mu_i, e_i: normal, friction, restitution of
 * plane i. */
#ifndef MS_IMPACTS_H
#define MS_IMPACTS_H

#include "msim/msim.h"
#include "scene/colliders.h"

/* At most 3 normals in space are linearly independent; a corner may have more planes. */
enum { MS_MAX_TOUCHED_PLANES = 6, MS_MAX_INDEPENDENT_PLANES = 3 };

/* A set of planes: those that a particle touches, or some of them. */
typedef struct ms_plane_set {
  int n;
  const msim_plane *plane[MS_MAX_TOUCHED_PLANES];
} ms_plane_set;

static inline int ms_impacts_contains_plane(const ms_plane_set *touch, const msim_plane *plane) {
  for (int i = 0; i < touch->n; i++)
    if (touch->plane[i] == plane) return 1;
  return 0;
}

/* s = n.x - d, d the offset: negative behind the plane */
double ms_impacts_distance(const msim_plane *p, const double x[3]);

typedef struct ms_collision_planes {
  int32_t n;
  const msim_plane *plane;
  double scene_size; /* m: the size of the scene, a lower bound of |x| in rounding tolerances */
  double contact_distance; /* m: a particle nearer to a plane touches it */
  int32_t nsolids;         /* the last planes are tangent to these, near one point (obstacles.h) */
  const ms_solid *solid;
  msim_plane *tangent;          /* the same planes */
  struct ms_obstacles *moving;  /* NULL: all solids are at rest */
  const struct ms_scene *scene; /* with the motions of solids */
} ms_collision_planes;

/* Rounding tolerances of a distance at x, merge included, and of a speed. */
double ms_impacts_distance_tolerance(const ms_collision_planes *planes, const double x[3]);
double ms_impacts_speed_tolerance(const double v[3]);

/* The first MS_MAX_TOUCHED_PLANES planes that x touches or lies behind: s <=
 * ms_impacts_distance_tolerance. */
ms_plane_set ms_impacts_find_touched(const ms_collision_planes *planes, const double x[3]);

/* The planes with n_i.v < limit */
ms_plane_set ms_impacts_select_approached(const ms_plane_set *touch, const double v[3],
                                          double limit);

/* The planes with J_i > tolerance; *friction_limit: their friction limit, sum mu_i J_i. */
ms_plane_set ms_impacts_select_pushing(const ms_plane_set *touch, const double *J, double tolerance,
                                       double *friction_limit);

/* Project u to the nearest vector with n_i.u >= least_i for all planes: u += sum J_i n_i, J_i >= 0.
 * J: one for each plane, 0 if it does not act. */
void ms_impacts_project(const ms_plane_set *touch, const double *least, double u[3], double *J);

/* Velocity after an impact: n_i.v' >= -e_i n_i.v for the planes that v approaches or slides along,
 * n_i.v <= 0; the part v_t of v' parallel to those with J_i > 0 is scaled by max(0, 1 - sum mu_i
 * J_i/|v_t|). Repeated until v' approaches no plane. Returns 1 if there was an impact. */
int ms_impacts_bounce(const ms_plane_set *touch, double v[3]);

/* u += sum J_i n_i so that n_i.u = to_i for the first three planes; returns 0, and u stays, if they
 * are linearly dependent. */
int ms_impacts_set_normal_components(const ms_plane_set *touch, const double *to, double u[3],
                                     double *J);

/* Move x onto all planes of `touch`, at most 3 independent ones: x += sum c_i n_i. */
void ms_impacts_move_onto(const ms_plane_set *touch, double x[3]);
/* The same, to these distances from them. */
void ms_impacts_move_to_distance(const ms_plane_set *touch, const double *distance, double x[3]);

/* Remove the components of u along the normals: u += sum J_i n_i so that n_i.u = 0. Returns the
 * friction limit, sum mu_i max(0, J_i). least: the smallest J_i (nullable). At most 3 independent
 * planes. */
double ms_impacts_remove_normal(const ms_plane_set *touch, double u[3], double *least);

/* Project an acceleration a to n_i.a >= 0 for all planes. Returns the planes with a normal force
 * over mass J_i > tolerance; *friction_limit: their friction limit over mass, sum mu_i J_i. */
ms_plane_set ms_impacts_remove_pressing(const ms_plane_set *touch, double tolerance, double a[3],
                                        double *friction_limit);
/* The same to n_i.a >= least_i. */
ms_plane_set ms_impacts_raise_pressing(const ms_plane_set *touch, const double *least,
                                       double tolerance, double a[3], double *friction_limit);

#endif
