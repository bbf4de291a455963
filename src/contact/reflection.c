#include "contact/reflection.h"

#include <float.h>

#include "base/vec3.h"
#include "contact/broad_phase.h"
#include "physics/signed_distance.h"

/* What particles of a model meet, and the work on the particle that is being reflected */
typedef struct obstacles {
  const ms_scene *scene;
  const ms_solid *solids; /* scene->ncolliders */
  ms_contact_log *log;    /* NULL: impulses are not recorded */
  int32_t row;            /* the particle */
  double work;            /* J/kg: of the impulses of moving colliders, over its mass */
} obstacles;

/* Record the change from `before` to v by the impulse of p, the plane of that number or the tangent
 * plane of a collider. x: the particle, or any point on its normal to p */
static void record_impulse(const obstacles *o, int32_t number, const msim_plane *p,
                           const double x[3], const double before[3], const double v[3]) {
  if (!o->log) return;
  double point[3] = {x[0], x[1], x[2]};
  const double dv[3] = {v[0] - before[0], v[1] - before[1], v[2] - before[2]};
  ms_vec3_axpy(-ms_impacts_distance(p, x), p->normal, point);
  ms_contact_log_add(o->log, o->row, number, point, p->normal, dv);
}

static void reflect_velocity(const msim_plane *p, double v[3]) {
  const double vn = ms_vec3_dot(p->normal, v), impulse = -(1 + p->restitution) * vn;
  if (!(vn < 0)) return;
  if (p->friction == 0) {
    ms_vec3_axpy(impulse, p->normal, v);
    return;
  }
  ms_vec3_axpy(-vn, p->normal, v);
  const double speed = ms_vec3_norm(v);
  const double keep = speed > 0 ? fmax(0.0, 1 - p->friction * impulse / speed) : 0.0;
  for (int c = 0; c < 3; c++) v[c] = (vn + impulse) * p->normal[c] + keep * v[c];
}

/* Reflect at a plane from which x has the distance s, < 0. */
static void reflect_behind(const msim_plane *p, double s, double x[3], double v[3]) {
  ms_vec3_axpy(-(1 + p->restitution) * s, p->normal, x);
  reflect_velocity(p, v);
}

/* At p, plane i; x may be behind it by `depth`. */
static int reflect_at_plane(const obstacles *o, int32_t i, const msim_plane *p, double depth,
                            double x[3], double v[3]) {
  const double s = ms_impacts_distance(p, x);
  if (!(s < -depth)) return 0;
  const double before[3] = {v[0], v[1], v[2]};
  reflect_behind(p, s, x, v);
  record_impulse(o, i, p, x, before, v);
  return 1;
}

/* The plane that touches collider i at its point nearest to x; returns the distance of x from both,
 * negative inside. */
static double find_tangent_plane(const obstacles *o, int32_t i, const double x[3], msim_plane *p) {
  const double s = ms_signed_distance(&o->solids[i], x, p->normal);
  p->offset = ms_vec3_dot(p->normal, x) - s;
  p->restitution = o->scene->colliders[i].restitution;
  p->friction = o->scene->colliders[i].friction;
  return s;
}

/* Reflect in the frame that moves with the point of the surface nearest to x, of the velocity u. */
static void reflect_at_moving(obstacles *o, const ms_solid *solid, const msim_plane *p, double s,
                              double x[3], double v[3]) {
  double u[3], nearest[3] = {x[0], x[1], x[2]};
  const double before[3] = {v[0], v[1], v[2]};
  ms_vec3_axpy(-s, p->normal, nearest);
  ms_signed_distance_find_velocity(solid, nearest, u);
  ms_vec3_axpy(-1, u, v);
  reflect_behind(p, s, x, v);
  ms_vec3_axpy(1, u, v);
  for (int c = 0; c < 3; c++) o->work += (v[c] - before[c]) * u[c];
}

static int reflect_at_collider(obstacles *o, int32_t i, double depth, double x[3], double v[3]) {
  msim_plane p;
  const double s = find_tangent_plane(o, i, x, &p);
  if (!(s < -depth)) return 0;
  const double before[3] = {v[0], v[1], v[2]};
  if (o->scene->collider_motions[i].x.nt) reflect_at_moving(o, &o->solids[i], &p, s, x, v);
  else reflect_behind(&p, s, x, v);
  record_impulse(o, o->scene->nplanes + i, &p, x, before, v);
  return 1;
}

/*------------------------------------- several obstacles ----------------------------------------*/

/* Rounding tolerance of the distance of a point that was moved onto the plane from a point at most
 * `reach` from the origin */
static double plane_distance_tolerance(const msim_plane *p, const double x[3], double reach) {
  return 64 * DBL_EPSILON * (fabs(p->offset) + ms_vec3_norm(x) + reach);
}

/* Reflect at all planes and colliders once. again: x may lie on them up to rounding, from an
 * earlier call. */
static int reflect_once(obstacles *o, int again, double x[3], double v[3]) {
  const ms_scene *scene = o->scene;
  int reflected = 0;
  for (int32_t i = 0; i < scene->nplanes; i++) {
    const msim_plane *p = &scene->planes[i];
    reflected |= reflect_at_plane(o, i, p, again ? plane_distance_tolerance(p, x, 0) : 0, x, v);
  }
  for (int32_t i = 0; i < scene->ncolliders; i++) {
    const double tolerance = again ? ms_signed_distance_tolerance(&o->solids[i], x) : 0;
    reflected |= reflect_at_collider(o, i, tolerance, x, v);
  }
  return reflected;
}

/* The plane that x is farthest behind, by more than the tolerance: *most beyond that; NULL: none,
 * and *most = 0. */
static const msim_plane *find_deepest(const ms_scene *scene, const double x[3], double reach,
                                      double *most) {
  const msim_plane *deepest = NULL;
  *most = 0;
  for (int32_t i = 0; i < scene->nplanes; i++) {
    const msim_plane *p = &scene->planes[i];
    const double depth = -ms_impacts_distance(p, x) - plane_distance_tolerance(p, x, reach);
    if (depth > *most) *most = depth, deepest = p;
  }
  return deepest;
}

/* Move x to the point nearest to `from` in front of p and the planes of `on`; then `on` are those
 * of these planes that constrain it there. */
static void add_plane(const msim_plane *p, const double from[3], ms_plane_set *on, double x[3]) {
  double offset[MS_MAX_TOUCHED_PLANES], J[MS_MAX_TOUCHED_PLANES] = {0}, unused;
  on->plane[on->n++] = p;
  for (int i = 0; i < on->n; i++) offset[i] = on->plane[i]->offset;
  for (int c = 0; c < 3; c++) x[c] = from[c];
  ms_impacts_project(on, offset, x, J);
  *on = ms_impacts_select_pushing(on, J, 0, &unused);
}

enum { MOST_SETS = 200 };

/* As find_deepest() among the colliders, if one is deeper than *depth: its tangent plane, in *p. */
static const msim_plane *find_deeper_collider(const obstacles *o, const double x[3], double depth,
                                              msim_plane *p, int32_t *collider) {
  const msim_plane *deepest = NULL;
  for (int32_t i = 0; i < o->scene->ncolliders; i++) {
    msim_plane tangent;
    const double tolerance = ms_signed_distance_tolerance(&o->solids[i], x);
    const double below = -find_tangent_plane(o, i, x, &tangent) - tolerance;
    if (below > depth) depth = below, *p = tangent, *collider = i, deepest = p;
  }
  return deepest;
}

/* Tangent planes of colliders, and which colliders they are */
typedef struct tangent_planes {
  msim_plane plane[MOST_SETS];
  int32_t collider[MOST_SETS];
} tangent_planes;

/* Move x to the nearest point in front of all planes; `on` are the planes that constrain it there,
 * 3 at most. An active-set method: the plane that x is farthest behind is added to `on` until there
 * is none. The distance from the initial x increases each time, so that no set recurs. Ends also if
 * the other planes leave no point in front of that plane. Of colliders tangent planes are added,
 * stored in `tangents` (NULL: colliders do not count), as in Kelley's cutting-plane method (J. SIAM
 * 8 (1960) 703). They exclude points that a solid's outside contains, so that the result may be
 * far, or none. */
static void move_to_nearest(const obstacles *o, double x[3], ms_plane_set *on,
                            tangent_planes *tangents) {
  const double from[3] = {x[0], x[1], x[2]}, reach = ms_vec3_norm(from);
  on->n = 0;
  for (int set = 0; set < MOST_SETS; set++) {
    double depth;
    const msim_plane *deepest = find_deepest(o->scene, x, reach, &depth);
    const msim_plane *deeper = tangents ? find_deeper_collider(o, x, depth, &tangents->plane[set],
                                                               &tangents->collider[set])
                                        : NULL;
    if (deeper) deepest = deeper;
    if (!deepest || ms_impacts_contains_plane(on, deepest)) return;
    add_plane(deepest, from, on, x);
  }
}

/* 1: x is in a collider or behind a plane, by more than rounding. */
static int is_obstructed(const obstacles *o, const double x[3]) {
  double depth;
  msim_plane unused;
  int32_t which;
  const msim_plane *plane = find_deepest(o->scene, x, ms_vec3_norm(x), &depth);
  return plane || find_deeper_collider(o, x, depth, &unused, &which);
}

/* Return to `from`, at rest, unless x is in free space and not farther away than `end`. A collider
 * that has moved over `from` takes the particle along. */
static void return_if_stuck(obstacles *o, const double from[3], const double end[3], double x[3],
                            double v[3]) {
  double displacement[3], moved[3];
  for (int c = 0; c < 3; c++) displacement[c] = end[c] - from[c], moved[c] = x[c] - from[c];
  const int is_near = ms_vec3_norm(moved) <= ms_vec3_norm(displacement);
  if ((is_near || is_obstructed(o, from)) && !is_obstructed(o, x)) return;
  if (o->log) ms_contact_log_stop(o->log, o->row, v);
  for (int c = 0; c < 3; c++) x[c] = from[c], v[c] = 0;
  o->work = 0;
}

/* The collider of which p is a tangent plane; -1: p is a plane. */
static int32_t find_collider(const tangent_planes *tangents, const msim_plane *p) {
  for (int i = 0; i < MOST_SETS; i++)
    if (p == &tangents->plane[i]) return tangents->collider[i];
  return -1;
}

static void record_impulses(const obstacles *o, const ms_plane_set *on,
                            const tangent_planes *tangents, const double x[3],
                            const double before[3], const double v[3]) {
  const double dv[3] = {v[0] - before[0], v[1] - before[1], v[2] - before[2]};
  int32_t number[MS_MAX_TOUCHED_PLANES];
  if (!o->log || on->n == 0) return;
  for (int i = 0; i < on->n; i++) {
    const int32_t collider = find_collider(tangents, on->plane[i]);
    number[i] =
        collider < 0 ? (int32_t)(on->plane[i] - o->scene->planes) : o->scene->nplanes + collider;
  }
  ms_contact_log_share(o->log, o->row, on, number, x, dv);
}

/* An impact at x with planes that move: in a frame whose velocity u has the normal components
 * n_i.u of theirs; with one plane, its velocity. Planes that are linearly dependent count as at
 * rest. */
static void bounce(obstacles *o, const ms_plane_set *on, const tangent_planes *tangents,
                   const double x[3], double v[3]) {
  double u[3] = {0}, to[MS_MAX_TOUCHED_PLANES], J[MS_MAX_INDEPENDENT_PLANES];
  const double before[3] = {v[0], v[1], v[2]};
  for (int i = 0; i < on->n; i++) {
    const int32_t collider = find_collider(tangents, on->plane[i]);
    double of[3] = {0};
    if (collider >= 0) ms_signed_distance_find_velocity(&o->solids[collider], x, of);
    to[i] = ms_vec3_dot(on->plane[i]->normal, of);
    if (on->n == 1) ms_vec3_axpy(1, of, u);
  }
  if (on->n > 1) ms_impacts_set_normal_components(on, to, u, J);
  ms_vec3_axpy(-1, u, v);
  ms_impacts_bounce(on, v);
  ms_vec3_axpy(1, u, v);
  for (int c = 0; c < 3; c++) o->work += (v[c] - before[c]) * u[c];
  record_impulses(o, on, tangents, x, before, v);
}

/* Repeated reflection. Each one takes x closer to all points in front of all planes; if these have
 * a positive volume, and e = 1, the iteration ends (Motzkin and Schoenberg, Canad. J. Math. 6
 * (1954) 393). Between parallel planes it is free flight: each reflection is a bounce, also at
 * e < 1. If the iteration does not end soon, as in a corner at e = 0, the particle is moved to the
 * nearest point, and its velocity changed by an impact there. from, end: positions before and
 * after the step. */
static void reflect_repeatedly(obstacles *o, const double from[3], const double end[3], double x[3],
                               double v[3]) {
  enum { MAX_REFLECTIONS = 64 };
  ms_plane_set on;
  tangent_planes tangents;
  for (int i = 1; i < MAX_REFLECTIONS; i++)
    if (!reflect_once(o, 1, x, v)) return;
  move_to_nearest(o, x, &on, &tangents);
  bounce(o, &on, &tangents, x, v);
  if (o->scene->ncolliders) return_if_stuck(o, from, end, x, v);
}

msim_status ms_reflection_check(const ms_scene *scene, msim_error *err) {
  const double ROOM = 1e-9; /* relative tolerance, for planes that coincide */
  const double *from = scene->x;
  double x[3] = {from[0], from[1], from[2]};
  ms_plane_set on;
  move_to_nearest(&(obstacles){.scene = scene}, x, &on, NULL);
  for (int32_t i = 0; i < scene->nplanes; i++) {
    const msim_plane *p = &scene->planes[i];
    if (-ms_impacts_distance(p, x) >
        ROOM * (fabs(p->offset) + ms_vec3_norm(x) + ms_vec3_norm(from)))
      return ms_error_set(err, MSIM_ERR_ARG,
                          "the planes leave no room: each point of space is behind at least one of "
                          "them; move or remove a plane, or reverse its normal");
  }
  return MSIM_OK;
}

int64_t ms_reflection_apply(const ms_model *model, const ms_solid *solids, const double *from,
                            ms_contact_log *log, double *x, double *v, double *work) {
  const ms_scene *scene = model->scene;
  const ms_unknowns *rows = &model->unknowns;
  obstacles o = {.scene = scene, .solids = solids, .log = log};
  const ms_collision_planes planes = {.n = scene->nplanes + scene->ncolliders,
                                      .plane = scene->planes,
                                      .nsolids = scene->ncolliders,
                                      .solid = solids};
  ms_broad_phase near = {.model = model, .planes = &planes, .x = x};
  int64_t reflected = 0;
  for (int32_t r = ms_broad_phase_next(&near, 0); r < rows->nfree;
       r = ms_broad_phase_next(&near, r + 1)) {
    double xp[3], vp[3];
    o.row = r;
    ms_unknowns_get(rows, x, r, xp);
    ms_unknowns_get(rows, v, r, vp);
    if (!reflect_once(&o, 0, xp, vp)) continue;
    if (scene->nplanes > 1 || scene->ncolliders) {
      double start[3], end[3];
      ms_unknowns_get(rows, from, r, start);
      ms_unknowns_get(rows, x, r, end);
      reflect_repeatedly(&o, start, end, xp, vp);
    }
    ms_unknowns_set(rows, xp, r, x);
    ms_unknowns_set(rows, vp, r, v);
    *work += model->mass[r] * o.work;
    o.work = 0;
    reflected++;
  }
  return reflected;
}
