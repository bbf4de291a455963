#include "scene/scene_json_motions.h"

#include <string.h>

/* The arrays of a motion, which the caller frees */
typedef struct motion_arrays {
  int32_t n, nt;
  int32_t *particles;
  double *t, *x;
} motion_arrays;

static msim_status read_interpolation(const ms_json_reader *r, const char *path, ms_value value,
                                      int32_t *interpolation) {
  const char *const *words = ms_motion_interpolations;
  const char *word = value.json ? ms_value_text(value) : words[0];
  for (*interpolation = 0; *interpolation < 2; ++*interpolation)
    if (word && strcmp(word, words[*interpolation]) == 0) return MSIM_OK;
  return ms_json_refuse(r, ms_json_at(path), value, "\"linear\" or \"cubic\"");
}

static msim_status read_lengths(const ms_json_reader *r, const char *path, const ms_value values[],
                                motion_arrays *m) {
  const ms_key_path particles = ms_json_member_path(path, "particles"),
                    t = ms_json_member_path(path, "t");
  msim_status status = ms_json_read_array_size(r, particles.text, values[0], &m->n);
  if (!status) status = ms_json_read_array_size(r, t.text, values[1], &m->nt);
  if (status) return status;
  const size_t n = (size_t)m->n, nt = (size_t)m->nt;
  if (n && nt > INT32_MAX / (3 * n))
    return ms_json_refuse(r, ms_json_at(t.text), values[1], "shorter");
  return MS_NEW(&r->alloc, m->particles, n) && MS_NEW(&r->alloc, m->t, nt) &&
                 MS_NEW(&r->alloc, m->x, 3 * n * nt)
             ? MSIM_OK
             : ms_json_fail_memory(r);
}

static msim_status read_arrays(const ms_json_reader *r, const char *path, const ms_value values[],
                               motion_arrays *m) {
  const ms_key_path particles = ms_json_member_path(path, "particles"),
                    t = ms_json_member_path(path, "t"), x = ms_json_member_path(path, "x");
  const int32_t limit = r->scene->data->nparticles;
  int32_t nx;
  msim_status status = ms_json_read_row(r, ms_json_at(t.text), values[1], MS_ANY, m->nt, m->t);
  for (size_t i = 0; i < (size_t)m->n && !status; i++)
    status = ms_json_read_index(r, ms_json_at_item(particles.text, i), ms_value_item(values[0], i),
                                limit, m->particles + i);
  if (!status) status = ms_json_read_array_size(r, x.text, values[2], &nx);
  if (status) return status;
  if (nx != m->nt)
    return ms_json_refuse(r, ms_json_at(x.text), values[2], "an array with an element for each t");
  for (size_t k = 0; k < (size_t)nx && !status; k++)
    status = ms_json_read_rows(r, ms_json_item_path(x.text, k).text, ms_value_item(values[2], k),
                               m->n, m->x + 3 * k * (size_t)m->n);
  return status;
}

static msim_status read_motion(ms_json_reader *r, const char *path, ms_value value) {
  ms_value values[3];
  motion_arrays m = {0};
  int32_t interpolation = 0;
  msim_status status = ms_json_check_table(r, path, value, ms_motion_keys, MS_MOTION_KEYS);
  for (int i = 0; i < 3 && !status; i++)
    status = ms_json_require_key(r, path, value, &ms_motion_keys[i], &values[i]);
  if (!status)
    status = read_interpolation(r, ms_json_member_path(path, "interpolation").text,
                                ms_value_member(value, "interpolation"), &interpolation);
  if (!status) status = read_lengths(r, path, values, &m);
  if (!status) status = read_arrays(r, path, values, &m);
  const msim_motion motion = {.size = sizeof motion,
                              .n = m.n,
                              .particles = m.particles,
                              .nt = m.nt,
                              .t = m.t,
                              .x = m.x,
                              .interpolation = interpolation};
  if (!status)
    status = ms_json_forward_error(r, ms_json_member_path(path, "").text,
                                   msim_scene_add_motion(r->scene, &motion, r->err));
  MS_FREE(&r->alloc, m.particles, m.t, m.x);
  return status;
}

msim_status ms_json_read_motions(ms_json_reader *r, const char *path, ms_value motions) {
  int32_t n;
  msim_status status = ms_json_read_array_size(r, path, motions, &n);
  for (size_t i = 0; i < ms_value_size(motions) && !status; i++)
    status = read_motion(r, ms_json_item_path(path, i).text, ms_value_item(motions, i));
  return status;
}

/*------------------------------------- motions of colliders -------------------------------------*/

/* rotation: NULL without that key. *t, of 7 numbers for each time, is freed by the caller. */
static msim_status read_collider_arrays(const ms_json_reader *r, const char *path, ms_value motion,
                                        msim_collider_motion *m, double **t) {
  ms_value values[2];
  msim_status status = MSIM_OK;
  for (int i = 0; i < 2 && !status; i++)
    status = ms_json_require_key(r, path, motion, &ms_collider_motion_keys[i], &values[i]);
  if (status) return status;
  const ms_value rotation = ms_value_member(motion, "rotation");
  const ms_key_path at = ms_json_member_path(path, "t"), at_x = ms_json_member_path(path, "x"),
                    at_rotation = ms_json_member_path(path, "rotation");
  status = ms_json_read_array_size(r, at.text, values[0], &m->nt);
  if (status) return status;
  const size_t nt = (size_t)m->nt;
  if (!MS_NEW(&r->alloc, *t, 7 * nt)) return ms_json_fail_memory(r);
  m->t = *t, m->x = *t + nt, m->rotation = rotation.json ? *t + 4 * nt : NULL;
  status = ms_json_read_row(r, ms_json_at(at.text), values[0], MS_ANY, m->nt, *t);
  if (!status) status = ms_json_read_rows(r, at_x.text, values[1], m->nt, *t + nt);
  if (!status && rotation.json)
    status = ms_json_read_rows(r, at_rotation.text, rotation, m->nt, *t + 4 * nt);
  return status;
}

msim_status ms_json_read_collider_motion(const ms_json_reader *r, const char *path, ms_value motion,
                                         int32_t collider) {
  msim_collider_motion m = {.size = sizeof m, .collider = collider};
  double *t = NULL;
  msim_status status =
      ms_json_check_table(r, path, motion, ms_collider_motion_keys, MS_COLLIDER_MOTION_KEYS);
  if (!status)
    status = read_interpolation(r, ms_json_member_path(path, "interpolation").text,
                                ms_value_member(motion, "interpolation"), &m.interpolation);
  if (!status) status = read_collider_arrays(r, path, motion, &m, &t);
  if (!status)
    status = ms_json_forward_error(r, ms_json_member_path(path, "").text,
                                   msim_scene_set_collider_motion(r->scene, &m, r->err));
  ms_memory_free(&r->alloc, t);
  return status;
}
