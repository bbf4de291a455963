#include "physics/planes.h"

#include "base/vec3.h"

static void reflect_velocity(const msim_plane *p, double v[3]) {
  double vn = ms_dot3(p->normal, v);
  if (!(vn < 0)) return;
  double impulse = -(1 + p->restitution) * vn;
  if (p->friction == 0) {
    for (int c = 0; c < 3; c++) v[c] += impulse * p->normal[c];
    return;
  }
  double tangential[3];
  for (int c = 0; c < 3; c++) tangential[c] = v[c] - vn * p->normal[c];
  double speed = sqrt(ms_dot3(tangential, tangential));
  double keep = speed > 0 ? fmax(0.0, 1 - p->friction * impulse / speed) : 0.0;
  for (int c = 0; c < 3; c++) v[c] = (vn + impulse) * p->normal[c] + keep * tangential[c];
}

static int reflect(const msim_plane *p, double x[3], double v[3]) {
  double s = ms_dot3(p->normal, x) - p->offset;
  if (!(s < 0)) return 0;
  for (int c = 0; c < 3; c++) x[c] -= (1 + p->restitution) * s * p->normal[c];
  reflect_velocity(p, v);
  return 1;
}

int64_t ms_planes_reflect(const ms_model *model, double *x, double *v) {
  const ms_scene *scene = model->scene;
  const ms_rows *rows = &model->rows;
  int64_t reflected = 0;
  for (int32_t r = 0; r < rows->nfree; r++) {
    double xp[3], vp[3];
    ms_row_get(rows, x, r, xp);
    ms_row_get(rows, v, r, vp);
    int touched = 0;
    for (int32_t p = 0; p < scene->nplanes; p++) touched |= reflect(&scene->planes[p], xp, vp);
    if (!touched) continue;
    ms_row_put(rows, xp, r, x);
    ms_row_put(rows, vp, r, v);
    reflected++;
  }
  return reflected;
}

double ms_planes_depth(const ms_model *model, const double *x0, const double *x1, double *share) {
  const ms_scene *scene = model->scene;
  double sum = 0, from[3], to[3];
  *share = 1;
  for (int32_t r = 0; r < model->rows.nfree; r++) {
    ms_row_get(&model->rows, x0, r, from);
    ms_row_get(&model->rows, x1, r, to);
    for (int32_t p = 0; p < scene->nplanes; p++) {
      const msim_plane *plane = &scene->planes[p];
      const double end = ms_dot3(plane->normal, to) - plane->offset;
      if (!(end < 0)) continue;
      const double start = ms_dot3(plane->normal, from) - plane->offset;
      const double depth = fmin(0, start) - end;
      if (!(depth > 0)) continue;
      sum += model->mass[r] * depth * depth;
      *share = fmin(*share, fmax(0, start) / (fmax(0, start) - end));
    }
  }
  return sum;
}
