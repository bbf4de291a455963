#include "contact/reflection.h"

#include <float.h>

#include "base/vec3.h"
#include "contact/impacts.h"

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

static int reflect_at_plane(const msim_plane *p, double depth, double x[3], double v[3]) {
  const double s = ms_impacts_distance(p, x);
  if (!(s < -depth)) return 0;
  ms_vec3_axpy(-(1 + p->restitution) * s, p->normal, x);
  reflect_velocity(p, v);
  return 1;
}

/*------------------------------------- several planes -------------------------------------------*/

/* Rounding tolerance of the distance of a point that was moved onto the plane from a point at most
 * `reach` from the origin */
static double plane_distance_tolerance(const msim_plane *p, const double x[3], double reach) {
  return 64 * DBL_EPSILON * (fabs(p->offset) + ms_vec3_norm(x) + reach);
}

/* Reflect at all planes once. again: x may lie on planes up to rounding, from an earlier call. */
static int reflect_once(const ms_scene *scene, int again, double x[3], double v[3]) {
  int reflected = 0;
  for (int32_t i = 0; i < scene->nplanes; i++) {
    const msim_plane *p = &scene->planes[i];
    reflected |= reflect_at_plane(p, again ? plane_distance_tolerance(p, x, 0) : 0, x, v);
  }
  return reflected;
}

/* The plane that x is farthest behind, by more than the tolerance; NULL: none. */
static const msim_plane *find_deepest(const ms_scene *scene, const double x[3], double reach) {
  const msim_plane *deepest = NULL;
  double most = 0;
  for (int32_t i = 0; i < scene->nplanes; i++) {
    const msim_plane *p = &scene->planes[i];
    const double depth = -ms_impacts_distance(p, x) - plane_distance_tolerance(p, x, reach);
    if (depth > most) most = depth, deepest = p;
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

/* Move x to the nearest point in front of all planes; `on` are the planes that constrain it there,
 * 3 at most. An active-set method: the plane that x is farthest behind is added to `on` until there
 * is none. The distance from the initial x increases each time, so that no set recurs. Ends also if
 * the other planes leave no point in front of that plane. */
static void move_to_nearest(const ms_scene *scene, double x[3], ms_plane_set *on) {
  enum { MOST_SETS = 200 };
  const double from[3] = {x[0], x[1], x[2]};
  on->n = 0;
  for (int set = 0; set < MOST_SETS; set++) {
    const msim_plane *deepest = find_deepest(scene, x, ms_vec3_norm(from));
    if (!deepest || ms_impacts_contains_plane(on, deepest)) return;
    add_plane(deepest, from, on, x);
  }
}

/* Repeated reflection. Each one takes x closer to all points in front of all planes; if these have
 * a positive volume, and e = 1, the iteration ends (Motzkin and Schoenberg, Canad. J. Math. 6
 * (1954) 393). Between parallel planes it is free flight: each reflection is a bounce, also at
 * e < 1. If the iteration does not end soon, as in a corner at e = 0, the particle is moved to the
 * nearest point, and its velocity changed by an impact there. */
static void reflect_repeatedly(const ms_scene *scene, double x[3], double v[3]) {
  enum { MAX_REFLECTIONS = 64 };
  ms_plane_set on;
  for (int i = 1; i < MAX_REFLECTIONS; i++)
    if (!reflect_once(scene, 1, x, v)) return;
  move_to_nearest(scene, x, &on);
  ms_impacts_bounce(&on, v);
}

msim_status ms_reflection_check(const ms_scene *scene, msim_error *err) {
  const double ROOM = 1e-9; /* relative tolerance, for planes that coincide */
  const double *from = scene->x;
  double x[3] = {from[0], from[1], from[2]};
  ms_plane_set on;
  move_to_nearest(scene, x, &on);
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

int64_t ms_reflection_apply(const ms_model *model, double *x, double *v) {
  const ms_scene *scene = model->scene;
  const ms_unknowns *rows = &model->unknowns;
  int64_t reflected = 0;
  for (int32_t r = 0; r < rows->nfree; r++) {
    double xp[3], vp[3];
    ms_unknowns_get(rows, x, r, xp);
    ms_unknowns_get(rows, v, r, vp);
    if (!reflect_once(scene, 0, xp, vp)) continue;
    if (scene->nplanes > 1) reflect_repeatedly(scene, xp, vp);
    ms_unknowns_set(rows, xp, r, x);
    ms_unknowns_set(rows, vp, r, v);
    reflected++;
  }
  return reflected;
}
