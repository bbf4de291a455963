/* motion_setters - adds motions of pinned particles and of colliders to a scene, and returns them
 * */
#include <string.h>

#include "base/sized.h"
#include "scene/scene.h"

int ms_scene_has_motion(const ms_scene *s, int32_t particle) {
  for (int32_t m = 0; m < s->nmotions; m++)
    for (int32_t i = 0; i < s->motions[m].n; i++)
      if (s->motions[m].particles[i] == particle) return 1;
  return 0;
}

/* has_motion: a byte per particle of the scene, 1 where it has a motion */
static msim_status check_marked_particles(const ms_scene *s, const msim_motion *m,
                                          uint8_t *has_motion, msim_error *err) {
  for (int32_t i = 0; i < m->n; i++) {
    const int32_t p = m->particles[i];
    if (p < 0 || p >= s->nparticles)
      return ms_error_set(err, MSIM_ERR_ARG,
                          "particles[%d] is %d; there are %d particles, counted from 0", i, p,
                          s->nparticles);
    if (!s->pinned[p])
      return ms_error_set(err, MSIM_ERR_ARG,
                          "particles[%d] is particle %d, which is not pinned; pin it to move it", i,
                          p);
    if (has_motion[p])
      return ms_error_set(err, MSIM_ERR_ARG,
                          "particles[%d] is particle %d, which has a motion already", i, p);
    has_motion[p] = 1;
  }
  return MSIM_OK;
}

static msim_status check_particles(const ms_scene *s, const msim_motion *m, msim_error *err) {
  uint8_t *has_motion;
  if (!MS_NEW(&s->alloc, has_motion, s->nparticles)) return ms_error_set_memory(err, "a motion");
  for (int32_t k = 0; k < s->nmotions; k++)
    for (int32_t i = 0; i < s->motions[k].n; i++) has_motion[s->motions[k].particles[i]] = 1;
  const msim_status status = check_marked_particles(s, m, has_motion, err);
  ms_memory_free(&s->alloc, has_motion);
  return status;
}

static msim_status check_motion(const ms_scene *s, const msim_motion *m, msim_error *err) {
  msim_status status = ms_scene_check_count(m->n, "particles", err);
  if (status) return status;
  if (m->nt < 1)
    return ms_error_set(err, MSIM_ERR_ARG, "t has %d times; it must have at least 1", m->nt);
  if (!m->t || (m->n > 0 && (!m->particles || !m->x)))
    return ms_error_set(err, MSIM_ERR_ARG, "particles, t or x is NULL");
  status = ms_motion_check_times(m->nt, m->t, m->interpolation, err);
  if (!status) status = ms_scene_check_finite("x", 3 * (int64_t)m->n * m->nt, 3 * m->n, m->x, err);
  const ms_motion points = {
      .n = m->n, .nt = m->nt, .t = (double *)(uintptr_t)m->t, .x = (double *)(uintptr_t)m->x};
  if (!status) status = ms_motion_check_range("x", &points, err);
  return status ? status : check_particles(s, m, err);
}

msim_status msim_scene_add_motion(msim_scene *scene, const msim_motion *motion, msim_error *err) {
  if (!scene || !motion) return ms_error_set(err, MSIM_ERR_ARG, "scene or motion is NULL");
  msim_motion m;
  msim_status status =
      ms_sized_check(motion, sizeof m, MS_SIZE_THROUGH(msim_motion, x), "motion", "motion", err);
  if (status) return status;
  ms_sized_read(&m, sizeof m, motion);
  status = check_motion(scene->data, &m, err);
  if (status) return status;
  ms_scene *s = ms_scene_make_writable(scene, err);
  if (!s) return MSIM_ERR_MEMORY;
  status = ms_memory_reserve(&s->alloc, MS_ARRAY(s->motions), s->nmotions, &s->motion_capacity,
                             (int64_t)s->nmotions + 1, err);
  const ms_motion from = {m.n,
                          m.nt,
                          m.interpolation,
                          (int32_t *)(uintptr_t)m.particles,
                          (double *)(uintptr_t)m.t,
                          (double *)(uintptr_t)m.x};
  if (!status) status = ms_motion_copy(&s->alloc, &from, &s->motions[s->nmotions], err);
  if (status) return status;
  s->nmotions++;
  return ms_error_clear(err);
}

msim_status msim_scene_get_motion(const msim_scene *scene, int32_t i, msim_motion *motion) {
  if (!scene || !motion || i < 0 || i >= scene->data->nmotions) return MSIM_ERR_ARG;
  const ms_motion *m = &scene->data->motions[i];
  msim_motion full = {.n = m->n,
                      .particles = m->particles,
                      .nt = m->nt,
                      .t = m->t,
                      .x = m->x,
                      .interpolation = m->interpolation};
  return ms_sized_write(motion, &full, sizeof full);
}

/* Remove column i of the points. */
static void remove_particle(ms_motion *m, int32_t i) {
  const size_t n = (size_t)m->n, at = (size_t)i;
  for (size_t k = 0, to = 0; k < n * (size_t)m->nt; k++)
    if (k % n != at) memmove(m->x + 3 * to++, m->x + 3 * k, 3 * sizeof *m->x);
  memmove(m->particles + at, m->particles + at + 1, (n - at - 1) * sizeof *m->particles);
  m->n--;
}

void ms_scene_remove_motion(ms_scene *scene, int32_t particle) {
  for (int32_t k = 0; k < scene->nmotions; k++) {
    ms_motion *m = &scene->motions[k];
    for (int32_t i = 0; i < m->n; i++)
      if (m->particles[i] == particle) remove_particle(m, i);
    if (m->n > 0) continue;
    ms_motion_free(&scene->alloc, m);
    memmove(m, m + 1, (size_t)(scene->nmotions - k - 1) * sizeof *m);
    scene->nmotions--, k--;
  }
}

/*------------------------------------- motions of colliders -------------------------------------*/

static ms_motion borrow_points(const msim_collider_motion *m, const double *points) {
  return (ms_motion){.n = 1,
                     .nt = points ? m->nt : 0,
                     .interpolation = m->interpolation,
                     .t = (double *)(uintptr_t)m->t,
                     .x = (double *)(uintptr_t)points};
}

static msim_status check_collider_motion(const ms_scene *s, const msim_collider_motion *m,
                                         msim_error *err) {
  if (m->collider < 0 || m->collider >= s->ncolliders)
    return ms_error_set(err, MSIM_ERR_ARG, "collider is %d; there are %d colliders, counted from 0",
                        m->collider, s->ncolliders);
  if (m->nt < 1)
    return ms_error_set(err, MSIM_ERR_ARG, "t has %d times; it must have at least 1", m->nt);
  if (!m->t || !m->x) return ms_error_set(err, MSIM_ERR_ARG, "t or x is NULL");
  const int64_t n = 3 * (int64_t)m->nt;
  msim_status status = ms_motion_check_times(m->nt, m->t, m->interpolation, err);
  if (!status) status = ms_scene_check_finite("x", n, 3, m->x, err);
  if (!status && m->rotation) status = ms_scene_check_finite("rotation", n, 3, m->rotation, err);
  const ms_motion x = borrow_points(m, m->x), rotation = borrow_points(m, m->rotation);
  if (!status) status = ms_motion_check_range("x", &x, err);
  return status ? status : ms_motion_check_range("rotation", &rotation, err);
}

msim_status msim_scene_set_collider_motion(msim_scene *scene, const msim_collider_motion *motion,
                                           msim_error *err) {
  msim_collider_motion m;
  ms_collider_motion own;
  if (!scene || !motion) return ms_error_set(err, MSIM_ERR_ARG, "scene or motion is NULL");
  msim_status status = ms_sized_check(motion, sizeof m, MS_SIZE_THROUGH(msim_collider_motion, x),
                                      "motion", "motion", err);
  if (status) return status;
  ms_sized_read(&m, sizeof m, motion);
  status = check_collider_motion(scene->data, &m, err);
  if (status) return status;
  ms_scene *s = ms_scene_make_writable(scene, err);
  if (!s) return MSIM_ERR_MEMORY;
  const ms_collider_motion from = {borrow_points(&m, m.x), borrow_points(&m, m.rotation)};
  status = ms_collider_motion_copy(&s->alloc, &from, &own, err);
  if (status) return status;
  ms_collider_motion_free(&s->alloc, &s->collider_motions[m.collider]);
  s->collider_motions[m.collider] = own;
  return ms_error_clear(err);
}

msim_status msim_scene_get_collider_motion(const msim_scene *scene, int32_t collider,
                                           msim_collider_motion *motion) {
  if (!scene || !motion || collider < 0 || collider >= scene->data->ncolliders) return MSIM_ERR_ARG;
  const ms_collider_motion *m = &scene->data->collider_motions[collider];
  msim_collider_motion full = {.collider = collider,
                               .nt = m->x.nt,
                               .t = m->x.t,
                               .x = m->x.x,
                               .rotation = m->rotation.x,
                               .interpolation = m->x.interpolation};
  return ms_sized_write(motion, &full, sizeof full);
}
