#include "contact/contact_log.h"

#include <string.h>

#include "base/vec3.h"

ms_contact_log *ms_contact_log_create(const ms_model *model) {
  const ms_scene *s = model->scene;
  const int64_t nfree = model->unknowns.nfree, most = (int64_t)s->nplanes + s->ncolliders;
  const int64_t wanted = nfree * (most < 3 ? most : 3) + 64;
  ms_contact_log *log;
  if (!MS_NEW(&s->alloc, log, 1)) return NULL;
  log->capacity = (int32_t)(wanted < INT32_MAX ? wanted : INT32_MAX);
  if (MS_NEW(&s->alloc, log->touch, log->capacity) && MS_NEW(&s->alloc, log->first, nfree)) {
    memset(log->first, -1, (size_t)nfree * sizeof *log->first);
    return log;
  }
  ms_contact_log_destroy(model, log);
  return NULL;
}

void ms_contact_log_destroy(const ms_model *model, ms_contact_log *log) {
  if (!log) return;
  MS_FREE(&model->scene->alloc, log->touch, log->first, log);
}

void ms_contact_log_clear(ms_contact_log *log, double h) {
  if (!log) return;
  for (int32_t i = 0; i < log->n; i++) log->first[log->touch[i].row] = -1;
  log->n = log->lost = 0, log->h = h;
}

static ms_touch *find_touch(const ms_contact_log *log, int32_t row, int32_t obstacle) {
  for (int32_t i = log->first[row]; i >= 0; i = log->touch[i].next)
    if (log->touch[i].obstacle == obstacle) return &log->touch[i];
  return NULL;
}

void ms_contact_log_add(ms_contact_log *log, int32_t row, int32_t obstacle, const double point[3],
                        const double normal[3], const double dv[3]) {
  ms_touch *touch = find_touch(log, row, obstacle);
  if (!touch) {
    if (log->n == log->capacity) {
      log->lost++;
      return;
    }
    touch = &log->touch[log->n];
    *touch = (ms_touch){.row = row, .obstacle = obstacle, .next = log->first[row]};
    memcpy(touch->point, point, sizeof touch->point);
    memcpy(touch->normal, normal, sizeof touch->normal);
    log->first[row] = log->n++;
  }
  ms_vec3_axpy(1, dv, touch->dv);
}

void ms_contact_log_stop(ms_contact_log *log, int32_t row, const double v[3]) {
  if (log->first[row] >= 0) ms_vec3_axpy(-1, v, log->touch[log->first[row]].dv);
}

void ms_contact_log_share(ms_contact_log *log, int32_t row, const ms_plane_set *on,
                          const int32_t *obstacle, const double x[3], const double dv[3]) {
  double to[MS_MAX_TOUCHED_PLANES] = {0}, J[MS_MAX_TOUCHED_PLANES] = {0}, along[3] = {0}, limit = 0;
  double rest[3] = {dv[0], dv[1], dv[2]};
  int first = 0;
  for (int i = 0; i < on->n; i++) to[i] = ms_vec3_dot(on->plane[i]->normal, dv);
  ms_impacts_project(on, to, along, J);
  ms_vec3_axpy(-1, along, rest);
  for (int i = 0; i < on->n; i++) limit += on->plane[i]->friction * J[i];
  while (first < on->n - 1 && !(J[first] > 0)) first++;
  for (int i = 0; i < on->n; i++) {
    const msim_plane *p = on->plane[i];
    const double share = limit > 0 ? p->friction * J[i] / limit : i == first;
    double own[3] = {0}, point[3] = {x[0], x[1], x[2]};
    if (!(J[i] > 0) && share == 0) continue;
    ms_vec3_axpy(J[i], p->normal, own), ms_vec3_axpy(share, rest, own);
    ms_vec3_axpy(-ms_impacts_distance(p, x), p->normal, point);
    ms_contact_log_add(log, row, obstacle[i], point, p->normal, own);
  }
}
