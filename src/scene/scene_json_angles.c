#include "scene/scene_json_angles.h"

static msim_status add_listed_angles(const ms_json_reader *r, ms_value section, ms_value corners,
                                     ms_value k, int32_t n, double *room /* 5n */) {
  double *at_rest = room + n, *at_damping = at_rest + n;
  int32_t *ijk = (int32_t *)(at_damping + n);
  const ms_scene_key *keys = ms_angle_keys;
  const ms_value rest = ms_value_member(section, keys[MS_KEY_ANGLE_REST].key);
  const ms_value damping = ms_value_member(section, keys[MS_KEY_ANGLE_DAMPING].key);
  msim_status status =
      ms_json_read_index_rows(r, "angles.ijk", corners, keys[MS_KEY_IJK].count, n, ijk);
  if (!status) status = ms_json_read_each(r, "angles.k", k, keys[MS_KEY_ANGLE_K].range, n, room);
  if (!status && rest.json)
    status = ms_json_read_each(r, "angles.rest", rest, keys[MS_KEY_ANGLE_REST].range, n, at_rest);
  if (!status && damping.json)
    status = ms_json_read_each(r, "angles.damping", damping, keys[MS_KEY_ANGLE_DAMPING].range, n,
                               at_damping);
  if (status) return status;
  return ms_json_forward_error(
      r, "",
      msim_scene_add_angles(r->scene, n, ijk, room, rest.json ? at_rest : NULL, at_damping,
                            r->err));
}

msim_status ms_json_read_angles(ms_json_reader *r, const char *path, ms_value section) {
  ms_value corners = {NULL}, k = {NULL};
  int32_t n = 0;
  msim_status status = ms_json_check_table(r, path, section, ms_angle_keys, MS_ANGLE_KEYS);
  if (!status) status = ms_json_require_key(r, path, section, &ms_angle_keys[MS_KEY_IJK], &corners);
  if (!status) status = ms_json_require_key(r, path, section, &ms_angle_keys[MS_KEY_ANGLE_K], &k);
  if (!status) status = ms_json_read_array_size(r, "angles.ijk", corners, &n);
  if (status) return status;
  double *room = ms_memory_allocate(&r->alloc, (size_t)n, 5 * sizeof *room);
  if (!room) return ms_json_fail_memory(r);
  status = add_listed_angles(r, section, corners, k, n, room);
  ms_memory_free(&r->alloc, room);
  return status;
}
