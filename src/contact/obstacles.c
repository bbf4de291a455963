#include "contact/obstacles.h"

#include <math.h>

#include "base/vec3.h"
#include "physics/signed_distance.h"

/*------------------------------------- creation -------------------------------------------------*/

static int is_inside_out(const ms_solid *s, int32_t type) { return s->inside && s->type == type; }

/* The faces of a solid inside out along its axis i, as planes */
static void add_faces(const ms_solid *s, const msim_collider *c, int i, int32_t number,
                      ms_obstacles *o) {
  for (int side = -1; side <= 1; side += 2) {
    o->number[o->nplanes] = number;
    msim_plane *p = &o->plane[o->nplanes++];
    *p = (msim_plane){.restitution = c->restitution, .friction = c->friction};
    for (int k = 0; k < 3; k++) p->normal[k] = -side * s->axis[i][k];
    p->offset = ms_vec3_dot(p->normal, s->center) - s->half[i];
  }
}

static void add_planes(const ms_scene *scene, ms_obstacles *o) {
  for (int32_t i = 0; i < scene->nplanes; i++) {
    o->number[o->nplanes] = i;
    o->plane[o->nplanes++] = scene->planes[i];
  }
  for (int32_t i = 0; i < scene->ncolliders; i++) {
    const ms_solid *s = &scene->solids[i];
    for (int k = 0; k < 3; k++)
      if (is_inside_out(s, MSIM_COLLIDER_BOX) ||
          (k == 2 && is_inside_out(s, MSIM_COLLIDER_CYLINDER)))
        add_faces(s, &scene->colliders[i], k, scene->nplanes + i, o);
  }
}

static void add_solid(const ms_solid *s, const msim_collider *c, int32_t number, ms_obstacles *o) {
  if (is_inside_out(s, MSIM_COLLIDER_BOX)) return;
  o->plane[o->nplanes + o->nsolids] =
      (msim_plane){.restitution = c->restitution, .friction = c->friction};
  o->number[o->nplanes + o->nsolids] = number;
  ms_solid *own = &o->solid[o->nsolids++];
  *own = *s;
  if (is_inside_out(s, MSIM_COLLIDER_CYLINDER))
    own->type = MSIM_COLLIDER_CAPSULE, own->half[2] = INFINITY;
}

int ms_obstacles_create(const ms_scene *scene, ms_obstacles *o) {
  enum { FACES = 6 };
  const int32_t n = scene->ncolliders;
  *o = (ms_obstacles){0};
  if (n == 0) return 1;
  const int64_t most = scene->nplanes + (FACES + 1) * (int64_t)n;
  if (!MS_NEW(&scene->alloc, o->plane, most) || !MS_NEW(&scene->alloc, o->number, most) ||
      !MS_NEW(&scene->alloc, o->solid, n))
    return 0;
  add_planes(scene, o);
  for (int32_t i = 0; i < n; i++)
    add_solid(&scene->solids[i], &scene->colliders[i], scene->nplanes + i, o);
  return 1;
}

void ms_obstacles_destroy(const ms_scene *scene, ms_obstacles *o) {
  MS_FREE(&scene->alloc, o->plane, o->number, o->solid);
}

/*------------------------------------- tangent planes -------------------------------------------*/

void ms_obstacles_set_tangent(const ms_solid *solid, const double x[3], msim_plane *tangent) {
  const double s = ms_signed_distance(solid, x, tangent->normal);
  tangent->offset = ms_vec3_dot(tangent->normal, x) - s;
}

void ms_obstacles_touch(const ms_collision_planes *planes, const double x[3]) {
  for (int32_t i = 0; i < planes->nsolids; i++)
    ms_obstacles_set_tangent(&planes->solid[i], x, &planes->tangent[i]);
}

/* Newton's method; one iteration is sufficient for one solid, or with flat surfaces. */
void ms_obstacles_move_onto(const ms_collision_planes *planes, const ms_plane_set *touch,
                            double x[3]) {
  enum { MOST = 8 };
  for (int i = 0; i < MOST; i++) {
    const double before[3] = {x[0], x[1], x[2]};
    double moved[3];
    ms_impacts_move_onto(touch, x);
    ms_obstacles_touch(planes, x);
    for (int c = 0; c < 3; c++) moved[c] = x[c] - before[c];
    if (touch->n == 1 || ms_vec3_norm(moved) <= ms_impacts_distance_tolerance(planes, x)) return;
  }
}

void ms_obstacles_find_centripetal(const ms_collision_planes *planes, const ms_plane_set *on,
                                   const double x[3], const double v[3], double *least) {
  for (int i = 0; i < on->n; i++) {
    const ms_solid *solid = ms_obstacles_get_solid(planes, on->plane[i]);
    least[i] = solid ? -ms_signed_distance_bend(solid, x, v) : 0;
  }
}

int ms_obstacles_is_beyond_edge(const ms_solid *solid, const double x[3], const double dx[3],
                                double tolerance) {
  const double bend = ms_signed_distance_bend(solid, x, dx), R = solid->radius;
  const double away = bend > 0 ? bend / (1 + sqrt(1 + bend / R)) : 0;
  double y[3], unused[3];
  for (int c = 0; c < 3; c++) y[c] = x[c] + dx[c];
  return ms_signed_distance(solid, y, unused) - away > tolerance;
}

/*------------------------------------- impacts --------------------------------------------------*/

double ms_obstacles_time_to_plane(double s, double u, double g) {
  const double d = u * u - 2 * g * s;
  if (d < 0 || (u >= 0 && g >= 0)) return INFINITY;
  return u < 0 ? 2 * s / (sqrt(d) - u) : -(u + sqrt(d)) / g;
}

/* A lower bound of the time of impact on a solid inside out, from the distance s, with n.v = u,
 * |v| = V and |a| = A: the time in which a particle may move by s or, if that is longer, as long as
 * it moves by less than R/2 - s, the root of s + u t - B t^2/2. There the curvature is at most 2/R,
 * so that B = A + 2 (V + A t)^2/R. */
static double bound_time_inside(double R, double s, double u, double V, double A) {
  const double least = 2 * s / (V + sqrt(V * V + 2 * A * s)), room = R / 2 - s;
  if (!(room > 0)) return least;
  const double near = 2 * room / (V + sqrt(V * V + 2 * A * room)), fastest = V + A * near;
  const double B = A + 2 * fastest * fastest / R;
  return fmax(least, fmin(near, ms_obstacles_time_to_plane(s, u, -B)));
}

/* Outside, a convex solid lies behind its tangent plane. */
double ms_obstacles_time_to_solid(const ms_solid *solid, const double x[3], const double v[3],
                                  const double a[3], double from, double left, double tolerance) {
  enum { MOST = 200 };
  double t = from;
  for (int i = 0; i < MOST && t <= left; i++) {
    double at[3], w[3], n[3];
    for (int c = 0; c < 3; c++) w[c] = v[c] + t * a[c], at[c] = x[c] + t * (v[c] + 0.5 * t * a[c]);
    const double s = ms_signed_distance(solid, at, n), u = ms_vec3_dot(n, w);
    if (s <= tolerance) return t;
    t += solid->inside ? bound_time_inside(solid->radius, s, u, ms_vec3_norm(w), ms_vec3_norm(a))
                       : ms_obstacles_time_to_plane(s - tolerance / 2, u, ms_vec3_dot(n, a));
  }
  return INFINITY;
}
