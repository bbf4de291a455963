#include "contact/impact_time.h"

#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "contact/moving_obstacles.h"
#include "physics/signed_distance.h"

double ms_impact_time_to_plane(double s, double u, double g) {
  const double d = u * u - 2 * g * s;
  if (d < 0 || (u >= 0 && g >= 0)) return INFINITY;
  return u < 0 ? 2 * s / (sqrt(d) - u) : -(u + sqrt(d)) / g;
}

/*------------------------------------- relative motion ------------------------------------------*/

/* A solid at a time, and the motion of the particle relative to it */
typedef struct encounter {
  const ms_solid *solid;
  ms_solid room;
  double s, n[3];    /* distance and normal */
  double x[3], v[3]; /* of the particle */
  double w[3];       /* m/s: velocity relative to the point of the solid at x */
} encounter;

static void meet(const ms_parabola *f, int32_t i, double t, encounter *e) {
  double u[3];
  const ms_instant at = {.t = f->t + t, .before = t > 0}; /* a motion may change at the start */
  e->solid = ms_moving_obstacles_get(f->planes, i, at, &e->room);
  for (int c = 0; c < 3; c++) {
    e->w[c] = e->v[c] = f->v[c] + t * f->a[c];
    e->x[c] = f->x[c] + t * (f->v[c] + 0.5 * t * f->a[c]);
  }
  e->s = ms_signed_distance(e->solid, e->x, e->n);
  if (!f->planes->moving) return;
  ms_signed_distance_find_velocity(e->solid, e->x, u);
  ms_vec3_axpy(-1, u, e->w);
}

/* A bound on the acceleration relative to a solid, in coordinates that rotate with it, over a time:
 * |a - c''| + (W' + W^2) r + 2 W |w|, with bounds W and W' on its angular velocity and
 * acceleration, and those on r and w that follow */
static double bound_acceleration(const ms_parabola *f, int32_t i, const encounter *e, double time) {
  const double size = ms_vec3_norm(f->a);
  if (!f->planes->moving) return size;
  const ms_solid_bounds *b = &f->planes->moving->bounds[i];
  const double A = size + b->acceleration;
  if (b->spin == 0) return A;
  double r[3], V[3];
  for (int c = 0; c < 3; c++) {
    r[c] = e->x[c] - e->solid->center[c];
    V[c] = e->v[c] - e->solid->velocity[c];
  }
  const double fastest = ms_vec3_norm(V) + time * A;
  const double far = ms_vec3_norm(r) + time * fastest, spin = b->spin;
  return A + (b->spin_rate + spin * spin) * far + 2 * spin * (fastest + spin * far);
}

/* A lower bound of n.a relative to a convex solid until `left`, n the normal now: exact where it
 * does not rotate, as its acceleration is linear in time. */
static double bound_normal_acceleration(const ms_parabola *f, int32_t i, const encounter *e,
                                        double t, double left) {
  const double g = ms_vec3_dot(e->n, f->a);
  if (!f->planes->moving) return g;
  if (f->planes->moving->bounds[i].spin > 0) return -bound_acceleration(f, i, e, left - t);
  ms_solid room;
  const ms_solid *last =
      ms_moving_obstacles_get(f->planes, i, (ms_instant){.t = f->t + left, .before = 1}, &room);
  return g - fmax(ms_vec3_dot(e->n, e->solid->acceleration), ms_vec3_dot(e->n, last->acceleration));
}

/*------------------------------------- lower bounds ---------------------------------------------*/

/* Iterations: a bound on the acceleration of a solid holds for its whole motion, and where that is
 * violent anywhere, all lower bounds are small. */
enum { MOST_BOUNDS = 100000 };

/* A lower bound of the time of impact on a solid inside out, from the distance s, with n.v = u,
 * |v| = V and |a| = A: the time in which a particle may move by s or, if that is longer, as long as
 * it moves by less than R/2 - s, the root of s + u t - B t^2/2. There the curvature is at most 2/R,
 * so that B = A + 2 (V + A t)^2/R. */
static double bound_time_inside(double R, double s, double u, double V, double A) {
  const double least = 2 * s / (V + sqrt(V * V + 2 * A * s)), room = R / 2 - s;
  if (!(room > 0)) return least;
  const double near = 2 * room / (V + sqrt(V * V + 2 * A * room)), fastest = V + A * near;
  const double B = A + 2 * fastest * fastest / R;
  return fmax(least, fmin(near, ms_impact_time_to_plane(s, u, -B)));
}

/* Outside, a convex solid lies behind its tangent plane. */
static double bound_time(const ms_parabola *f, int32_t i, const encounter *e, double t, double left,
                         double tolerance) {
  const double u = ms_vec3_dot(e->n, e->w);
  if (e->solid->inside)
    return bound_time_inside(e->solid->radius, e->s, u, ms_vec3_norm(e->w),
                             bound_acceleration(f, i, e, left - t));
  return ms_impact_time_to_plane(e->s - tolerance / 2, u,
                                 bound_normal_acceleration(f, i, e, t, left));
}

/*------------------------------------- samples --------------------------------------------------*/

/* The time at which the distance reaches the tolerance, by bisection: it is larger at `low`, but
 * not at `high`. */
static double bisect(const ms_parabola *f, int32_t i, double low, double high, double tolerance) {
  enum { MOST = 60 };
  for (int k = 0; k < MOST; k++) {
    const double middle = 0.5 * (low + high);
    encounter e;
    if (!(middle > low && middle < high)) break;
    meet(f, i, middle, &e);
    if (e.s > tolerance) low = middle;
    else high = middle;
    if (fabs(e.s) <= tolerance) break;
  }
  return high;
}

/* The particle may move by a lower bound of its distance, or by a share of a cell. */
static double find_on_samples(const ms_parabola *f, int32_t i, double from, double left,
                              double tolerance) {
  double t = from, before = from;
  for (int k = 0; k < MOST_BOUNDS; k++) {
    encounter e;
    meet(f, i, t, &e);
    if (e.s <= tolerance) return t > from ? bisect(f, i, before, t, tolerance) : t;
    if (t >= left) return INFINITY;
    const double share = ms_obstacles_find_cell(e.solid) / MS_IMPACT_TIME_SHARES,
                 displacement = fmax(ms_obstacles_bound_distance(e.solid, e.s), share),
                 V = ms_vec3_norm(e.w), A = bound_acceleration(f, i, &e, left - t);
    before = t;
    t = fmin(left, t + 2 * displacement / (V + sqrt(V * V + 2 * A * displacement)));
  }
  return t;
}

double ms_impact_time_find(const ms_parabola *f, int32_t i, double from, double left,
                           double tolerance) {
  double t = from;
  if (t > left) return INFINITY;
  if (f->planes->solid[i].samples) return find_on_samples(f, i, from, left, tolerance);
  for (int k = 0; k < MOST_BOUNDS && t <= left; k++) {
    encounter e;
    meet(f, i, t, &e);
    if (e.s <= tolerance) return t;
    t += bound_time(f, i, &e, t, left, tolerance);
  }
  return INFINITY;
}

int ms_impact_time_is_inside(const ms_parabola *f, int32_t i, double when, double tolerance) {
  encounter e;
  meet(f, i, when, &e);
  return e.s < -tolerance;
}

int ms_impact_time_may_touch(const ms_parabola *f, double h) {
  const ms_collision_planes *planes = f->planes;
  const double tolerance = ms_impacts_distance_tolerance(planes, f->x);
  for (const msim_plane *q = planes->plane; q < planes->plane + planes->n - planes->nsolids; q++) {
    const double s = ms_impacts_distance(q, f->x), u = h * ms_vec3_dot(q->normal, f->v);
    const double end = s + u + 0.5 * h * h * ms_vec3_dot(q->normal, f->a);
    if (fmin(fmin(s, s + u / 2), end) <= tolerance) return 1;
  }
  if (!planes->nsolids) return 0;
  const double displacement = h * (ms_vec3_norm(f->v) + 0.5 * h * ms_vec3_norm(f->a));
  for (int32_t i = 0; i < planes->nsolids; i++) {
    const ms_solid *solid = &planes->solid[i];
    double unused[3];
    const double moved = ms_moving_obstacles_bound_displacement(planes, i, f->x, displacement, h),
                 distance = ms_signed_distance(solid, f->x, unused);
    if (ms_obstacles_bound_distance(solid, distance) <= displacement + moved + tolerance) return 1;
  }
  return 0;
}
