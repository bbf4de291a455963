#include "scene/scene_json_colliders.h"

#include <stdio.h>
#include <string.h>

#include "base/suggest.h"
#include "scene/scene_json_motions.h"

static const char *type_name(int32_t i, const void *data) {
  (void)data;
  const ms_collider_type *type = ms_colliders_get_type(MSIM_COLLIDER_SPHERE + i);
  return type ? type->name : NULL;
}

static msim_status read_type(const ms_json_reader *r, const char *path, ms_value object,
                             int32_t *type) {
  static const char *const must =
      "\"sphere\", \"capsule\", \"cylinder\", \"box\", "
      "\"heightfield\" or \"sdf\"";
  ms_value value;
  const char *known;
  if (!json_is_object(object.json)) return ms_json_refuse(r, ms_json_at(path), object, "an object");
  msim_status status = ms_json_require(r, path, object, ms_collider_type_key.key, must, &value);
  if (status) return status;
  const ms_key_path at = ms_json_member_path(path, ms_collider_type_key.key);
  const char *name = ms_value_text(value);
  if (!name) return ms_json_refuse(r, ms_json_at(at.text), value, must);
  for (int32_t i = 0; (known = type_name(i, NULL)) != NULL; i++) {
    *type = MSIM_COLLIDER_SPHERE + i;
    if (strcmp(known, name) == 0) return MSIM_OK;
  }
  char hinted[160];
  snprintf(hinted, sizeof hinted, "%s%s", must, ms_suggest_hint(name, type_name, NULL).text);
  return ms_json_refuse(r, ms_json_at(at.text), value, hinted);
}

static msim_status check_keys(const ms_json_reader *r, const char *path, ms_value object,
                              int32_t type) {
  const char *keys[MS_COLLIDER_MEMBERS + 6] = {ms_collider_type_key.key};
  int32_t n = 1;
  for (int32_t i = 0; i < MS_COLLIDER_MEMBERS; i++)
    if (ms_colliders_type_has(type, &ms_collider_members[i]))
      keys[n++] = ms_collider_members[i].key.key;
  if (ms_colliders_get_count_key(type)) {
    keys[n++] = ms_colliders_get_count_key(type)->key;
    keys[n++] = ms_colliders_get_values_key(type)->key;
  }
  keys[n++] = ms_collider_inside_key.key;
  keys[n] = ms_collider_motion_key.key;
  return ms_json_check_keys(r, path, object, keys);
}

/* Samples, if the type has any; the caller frees *values. */
static msim_status read_samples(const ms_json_reader *r, const char *path, ms_value object,
                                msim_collider *c, double **values) {
  const ms_scene_key *count = ms_colliders_get_count_key(c->type),
                     *key = ms_colliders_get_values_key(c->type);
  double n[3], all = 1;
  ms_value list;
  int32_t found;
  if (!count) return MSIM_OK;
  msim_status status = ms_json_read_numbers(r, path, object, count, n);
  if (!status) status = ms_json_require_key(r, path, object, key, &list);
  if (status) return status;
  for (int32_t i = 0; i < count->count; i++) c->n[i] = (int32_t)n[i], all *= n[i];
  const ms_key_path at = ms_json_member_path(path, key->key);
  status = ms_json_read_array_size(r, at.text, list, &found);
  if (status) return status;
  if (found != all)
    return ms_json_refuse(r, ms_json_at(at.text), list, "an array of as many numbers as n says");
  if (!MS_NEW(&r->alloc, *values, found)) return ms_json_fail_memory(r);
  c->values = *values;
  return ms_json_read_row(r, ms_json_at(at.text), list, MS_ANY, found, *values);
}

static msim_status read_collider(const ms_json_reader *r, const char *path, ms_value value) {
  msim_collider c = {.size = sizeof c, .restitution = 1};
  msim_status status = read_type(r, path, value, &c.type);
  if (!status) status = check_keys(r, path, value, c.type);
  for (int32_t i = 0; i < MS_COLLIDER_MEMBERS && !status; i++) {
    const ms_collider_member *m = &ms_collider_members[i];
    double *numbers = (double *)(void *)((char *)&c + m->offset);
    if (ms_colliders_type_has(c.type, m))
      status = ms_json_read_numbers(r, path, value, &m->key, numbers);
  }
  double *values = NULL;
  const ms_value inside = ms_value_member(value, ms_collider_inside_key.key);
  if (!status && inside.json)
    status =
        ms_json_read_flag(r, ms_json_at(ms_json_member_path(path, ms_collider_inside_key.key).text),
                          inside, &c.inside);
  if (!status) status = read_samples(r, path, value, &c, &values);
  if (!status)
    status = ms_json_forward_error(r, ms_json_member_path(path, "").text,
                                   msim_scene_add_collider(r->scene, &c, r->err));
  ms_memory_free(&r->alloc, values);
  if (status) return status;
  const ms_value motion = ms_value_member(value, ms_collider_motion_key.key);
  if (!motion.json) return MSIM_OK;
  return ms_json_read_collider_motion(r, ms_json_member_path(path, ms_collider_motion_key.key).text,
                                      motion, r->scene->data->ncolliders - 1);
}

msim_status ms_json_add_colliders(ms_json_reader *r, const char *path, ms_value colliders) {
  int32_t n;
  msim_status status = ms_json_read_array_size(r, path, colliders, &n);
  for (size_t i = 0; i < ms_value_size(colliders) && !status; i++)
    status = read_collider(r, ms_json_item_path(path, i).text, ms_value_item(colliders, i));
  return status;
}
