#include "contact/obstacles.h"

#include <math.h>

#include "base/vec3.h"
#include "contact/moving_obstacles.h"
#include "physics/signed_distance.h"

/*------------------------------------- creation -------------------------------------------------*/

static int is_inside_out(const ms_solid *s, int32_t type) { return s->inside && s->type == type; }

static int has_plane_faces(const ms_solid *s, int axis) {
  return is_inside_out(s, MSIM_COLLIDER_BOX) ||
         (axis == 2 && is_inside_out(s, MSIM_COLLIDER_CYLINDER));
}

static int moves(const ms_scene *scene, int32_t i) { return scene->collider_motions[i].x.nt > 0; }

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
    for (int k = 0; k < 3 && !moves(scene, i); k++)
      if (has_plane_faces(s, k)) add_faces(s, &scene->colliders[i], k, scene->nplanes + i, o);
  }
}

static ms_solid *append_solid(const ms_scene *scene, int32_t i, ms_obstacles *o) {
  const msim_collider *c = &scene->colliders[i];
  o->plane[o->nplanes + o->nsolids] =
      (msim_plane){.restitution = c->restitution, .friction = c->friction};
  o->number[o->nplanes + o->nsolids] = scene->nplanes + i;
  o->solid[o->nsolids] = scene->solids[i];
  return &o->solid[o->nsolids++];
}

/* The faces along axis k of a solid inside out that moves, as half-spaces */
static void add_half_spaces(const ms_scene *scene, int32_t i, int k, ms_obstacles *o) {
  for (int side = -1; side <= 1; side += 2) {
    o->face[o->nsolids] = side * (k + 1);
    ms_solid *own = append_solid(scene, i, o);
    own->type = MS_SOLID_HALF_SPACE, own->inside = 0;
    own->half[2] = scene->solids[i].half[k];
  }
}

static void add_solid(const ms_scene *scene, int32_t i, ms_obstacles *o) {
  const ms_solid *s = &scene->solids[i];
  for (int k = 0; k < 3 && moves(scene, i); k++)
    if (has_plane_faces(s, k)) add_half_spaces(scene, i, k, o);
  if (is_inside_out(s, MSIM_COLLIDER_BOX)) return;
  ms_solid *own = append_solid(scene, i, o);
  if (is_inside_out(s, MSIM_COLLIDER_CYLINDER))
    own->type = MSIM_COLLIDER_CAPSULE, own->half[2] = INFINITY;
}

/* The angular velocity is at most |w'|, the angular acceleration |w''| + |w'|^2/2: the matrix that
 * takes w' to the angular velocity is an average of rotations by the vectors s w, 0 < s < 1. */
static void set_bounds(const ms_scene *scene, ms_obstacles *o) {
  for (int32_t i = 0; i < o->nsolids; i++) {
    const ms_collider_motion *m =
        &scene->collider_motions[o->number[o->nplanes + i] - scene->nplanes];
    if (!m->x.nt) continue;
    const ms_motion_bounds x = ms_motion_find_bounds(&m->x),
                           w = ms_motion_find_bounds(&m->rotation);
    o->bounds[i] = (ms_solid_bounds){.speed = x.speed,
                                     .acceleration = x.acceleration,
                                     .spin = w.speed,
                                     .spin_rate = w.acceleration + w.speed * w.speed / 2};
    o->moves = 1;
  }
}

int ms_obstacles_create(const ms_scene *scene, ms_obstacles *o) {
  enum { FACES = 6 };
  const int32_t n = scene->ncolliders;
  *o = (ms_obstacles){0};
  if (n == 0) return 1;
  const int64_t most = scene->nplanes + (FACES + 1) * (int64_t)n;
  if (!MS_NEW(&scene->alloc, o->plane, most) || !MS_NEW(&scene->alloc, o->number, most) ||
      !MS_NEW(&scene->alloc, o->solid, most) || !MS_NEW(&scene->alloc, o->face, most) ||
      !MS_NEW(&scene->alloc, o->bounds, most))
    return 0;
  o->now.t = NAN;
  add_planes(scene, o);
  for (int32_t i = 0; i < n; i++) add_solid(scene, i, o);
  set_bounds(scene, o);
  return 1;
}

void ms_obstacles_destroy(const ms_scene *scene, ms_obstacles *o) {
  MS_FREE(&scene->alloc, o->plane, o->number, o->solid, o->face, o->bounds);
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

double ms_obstacles_find_cell(const ms_solid *solid) {
  const ms_samples *m = solid->samples;
  if (!m) return INFINITY;
  const double cell = fmin(m->spacing[0], m->spacing[1]);
  return solid->type == MSIM_COLLIDER_SDF ? fmin(cell, m->spacing[2]) : cell;
}

double ms_obstacles_bound_distance(const ms_solid *solid, double s) {
  return solid->type == MSIM_COLLIDER_SDF && s > 0 ? s / 4 : s;
}

static int has_samples(const ms_collision_planes *planes, const ms_plane_set *touch) {
  for (int i = 0; i < touch->n; i++) {
    const ms_solid *solid = ms_obstacles_get_solid(planes, touch->plane[i]);
    if (solid && solid->samples) return 1;
  }
  return 0;
}

/* Newton's method; one iteration is sufficient for one solid whose distance is exact. */
void ms_obstacles_move_onto(const ms_collision_planes *planes, const ms_plane_set *touch,
                            double x[3]) {
  enum { MOST = 8 };
  const int is_exact = touch->n == 1 && !has_samples(planes, touch);
  for (int i = 0; i < MOST; i++) {
    const double before[3] = {x[0], x[1], x[2]};
    double moved[3];
    ms_impacts_move_onto(touch, x);
    ms_obstacles_touch(planes, x);
    for (int c = 0; c < 3; c++) moved[c] = x[c] - before[c];
    if (is_exact || ms_vec3_norm(moved) <= ms_impacts_distance_tolerance(planes, x)) return;
  }
}

void ms_obstacles_find_centripetal(const ms_collision_planes *planes, const ms_plane_set *on,
                                   const double x[3], const double v[3], double *least) {
  for (int i = 0; i < on->n; i++) {
    const ms_solid *solid = ms_obstacles_get_solid(planes, on->plane[i]);
    least[i] = !solid ? 0
               : planes->moving
                   ? ms_moving_obstacles_find_normal_acceleration(solid, on->plane[i]->normal, x, v)
                   : -ms_signed_distance_bend(solid, x, v);
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
