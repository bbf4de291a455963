#include "physics/planes.h"

#include <float.h>

#include "base/vec3.h"
#include "physics/impacts.h"

static void reflect_velocity(const msim_plane *p, double v[3]) {
  const double vn = ms_dot3(p->normal, v), impulse = -(1 + p->restitution) * vn;
  if (!(vn < 0)) return;
  if (p->friction == 0) {
    ms_axpy3(impulse, p->normal, v);
    return;
  }
  ms_axpy3(-vn, p->normal, v);
  const double speed = ms_norm3(v);
  const double keep = speed > 0 ? fmax(0.0, 1 - p->friction * impulse / speed) : 0.0;
  for (int c = 0; c < 3; c++) v[c] = (vn + impulse) * p->normal[c] + keep * v[c];
}

static int reflect(const msim_plane *p, double depth, double x[3], double v[3]) {
  const double s = ms_distance(p, x);
  if (!(s < -depth)) return 0;
  ms_axpy3(-(1 + p->restitution) * s, p->normal, x);
  reflect_velocity(p, v);
  return 1;
}

/*------------------------------------- more planes than one -------------------------------------*/

/* What rounding leaves of the distance of a point that was put on the plane, from another point as
 * far from the origin as `reach` */
static double rounding_at(const msim_plane *p, const double x[3], double reach) {
  return 64 * DBL_EPSILON * (fabs(p->offset) + ms_norm3(x) + reach);
}

/* again: not the first pass, so that x may lie on planes but for rounding */
static int pass(const ms_scene *scene, int again, double x[3], double v[3]) {
  int reflected = 0;
  for (int32_t i = 0; i < scene->nplanes; i++) {
    const msim_plane *p = &scene->planes[i];
    reflected |= reflect(p, again ? rounding_at(p, x, 0) : 0, x, v);
  }
  return reflected;
}

/* The plane that x is farthest behind, by more than rounding; NULL: none. */
static const msim_plane *find_deepest(const ms_scene *scene, const double x[3], double reach) {
  const msim_plane *deepest = NULL;
  double most = 0;
  for (int32_t i = 0; i < scene->nplanes; i++) {
    const msim_plane *p = &scene->planes[i];
    const double depth = -ms_distance(p, x) - rounding_at(p, x, reach);
    if (depth > most) most = depth, deepest = p;
  }
  return deepest;
}

/* x becomes the point nearest to `from` in front of the planes of `on` and of one more. Those that
 * do not hold it there leave `on`. */
static void add_plane(const msim_plane *p, const double from[3], ms_touch *on, double x[3]) {
  double offset[MS_MOST_TOUCHED], J[MS_MOST_TOUCHED] = {0}, unused;
  on->plane[on->n++] = p;
  for (int i = 0; i < on->n; i++) offset[i] = on->plane[i]->offset;
  for (int c = 0; c < 3; c++) x[c] = from[c];
  ms_project(on, offset, x, J);
  *on = ms_touch_pushing(on, J, 0, &unused);
}

/* x becomes the nearest point behind no plane, and `on` the planes that hold it there, 3 at most:
 * the plane that x is farthest behind is added to them until there is none. x moves farther from
 * where it was each time, so that no set of planes comes twice. Ends, too, where the others leave
 * no room in front of that plane. */
static void go_to_nearest(const ms_scene *scene, double x[3], ms_touch *on) {
  enum { MOST_SETS = 200 };
  const double from[3] = {x[0], x[1], x[2]};
  on->n = 0;
  for (int set = 0; set < MOST_SETS; set++) {
    const msim_plane *deepest = find_deepest(scene, x, ms_norm3(from));
    if (!deepest || ms_touch_holds(on, deepest)) return;
    add_plane(deepest, from, on, x);
  }
}

/* Behind a plane after one pass: again. Each reflection takes x closer to all points behind no
 * plane; where they fill some space, and e = 1, the passes end (Motzkin and Schoenberg, Canad. J.
 * Math. 6 (1954) 393). Between parallel planes that is free flight: each reflection stands for a
 * bounce, at e < 1, too. Where passes do not end soon, as in a corner at e = 0, the particle takes
 * the nearest point, and the velocity of an impact there. */
static void settle(const ms_scene *scene, double x[3], double v[3]) {
  enum { MOST_PASSES = 64 };
  ms_touch on;
  for (int i = 1; i < MOST_PASSES; i++)
    if (!pass(scene, 1, x, v)) return;
  go_to_nearest(scene, x, &on);
  ms_bounce(&on, v);
}

msim_status ms_planes_check(const ms_scene *scene, msim_error *err) {
  const double ROOM = 1e-9; /* planes may touch: what lies between them is as good as nothing */
  const double *from = scene->x;
  double x[3] = {from[0], from[1], from[2]};
  ms_touch on;
  go_to_nearest(scene, x, &on);
  for (int32_t i = 0; i < scene->nplanes; i++) {
    const msim_plane *p = &scene->planes[i];
    if (-ms_distance(p, x) > ROOM * (fabs(p->offset) + ms_norm3(x) + ms_norm3(from)))
      return ms_fail(err, MSIM_ERR_ARG,
                     "the planes leave no room: every point is behind one of them");
  }
  return MSIM_OK;
}

int64_t ms_planes_reflect(const ms_model *model, double *x, double *v) {
  const ms_scene *scene = model->scene;
  const ms_rows *rows = &model->rows;
  int64_t reflected = 0;
  for (int32_t r = 0; r < rows->nfree; r++) {
    double xp[3], vp[3];
    ms_row_get(rows, x, r, xp);
    ms_row_get(rows, v, r, vp);
    if (!pass(scene, 0, xp, vp)) continue;
    if (scene->nplanes > 1) settle(scene, xp, vp);
    ms_row_put(rows, xp, r, x);
    ms_row_put(rows, vp, r, v);
    reflected++;
  }
  return reflected;
}
