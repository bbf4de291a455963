/* faces - appends triangles of particles, which viewers draw, to a scene */
#include <string.h>

#include "scene/scene.h"

static msim_status check_face(const ms_scene *s, int64_t i, const int32_t *corner,
                              msim_error *err) {
  for (int c = 0; c < 3; c++) {
    if (corner[c] < 0 || corner[c] >= ms_scene_count_ends(s))
      return ms_error_set(
          err, MSIM_ERR_ARG,
          "faces[%lld] refers to particle %d; there are %d particles, counted from 0", (long long)i,
          corner[c], ms_scene_count_ends(s));
    if (corner[c] == corner[(c + 1) % 3])
      return ms_error_set(err, MSIM_ERR_ARG,
                          "faces[%lld] has particle %d twice; it must have three different ones",
                          (long long)i, corner[c]);
  }
  return MSIM_OK;
}

static msim_status check_faces(const ms_scene *s, int32_t n, const int32_t *corners,
                               msim_error *err) {
  msim_status status = MSIM_OK;
  for (int32_t i = 0; i < n && !status; i++)
    status = check_face(s, i, corners + 3 * (size_t)i, err);
  return status;
}

msim_status ms_scene_begin_faces(msim_scene *scene, int32_t n, msim_error *err) {
  ms_scene *s = ms_scene_make_writable(scene, err);
  if (!s) return MSIM_ERR_MEMORY;
  const ms_array faces = {&s->faces, 3 * sizeof *s->faces};
  const int64_t total = (int64_t)s->nfaces + n,
                room = total > 0 ? total : 1; /* so that the array has an address */
  return ms_memory_reserve(&s->alloc, faces, s->nfaces, &s->face_capacity, room, err);
}

msim_status ms_scene_end_faces(ms_scene *s, int32_t n, msim_error *err) {
  const msim_status status = check_faces(s, n, s->faces + 3 * (size_t)s->nfaces, err);
  if (!status) s->nfaces += n;
  return status;
}

msim_status msim_scene_add_faces(msim_scene *scene, int32_t n, const int32_t *corners,
                                 msim_error *err) {
  if (!scene || (n > 0 && !corners))
    return ms_error_set(err, MSIM_ERR_ARG, "scene or corners is NULL");
  msim_status status = ms_scene_check_count(n, "faces", err);
  if (!status) status = check_faces(scene->data, n, corners, err);
  if (status || n == 0) return status ? status : ms_error_clear(err);
  status = ms_scene_begin_faces(scene, n, err);
  if (status) return status;
  ms_scene *s = scene->data;
  memcpy(s->faces + 3 * (size_t)s->nfaces, corners, 3 * (size_t)n * sizeof *corners);
  s->nfaces += n;
  return ms_error_clear(err);
}
