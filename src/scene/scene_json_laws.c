#include <stdio.h>
#include <string.h>

#include "base/suggest.h"
#include "scene/laws.h"
#include "scene/scene_json_laws.h"

/*------------------------------------- laws -----------------------------------------------------*/

/* The keys of a type besides `type` and thresholds, all required: a bit 1 << MS_KEY_... for each */
static const unsigned keys_of_kind[] = {
    [MSIM_LAW_DEAD_BAND] = 1 << MS_KEY_HALF_WIDTH,
    [MSIM_LAW_POLYNOMIAL] = 1 << MS_KEY_COEFFICIENTS | 1 << MS_KEY_LIMIT,
    [MSIM_LAW_TABLE] = 1 << MS_KEY_STRETCH | 1 << MS_KEY_LAW_FORCE};

static const char *type_name(int32_t i, const void *data) {
  (void)data;
  return i < MSIM_LAW_CALLBACK ? ms_laws_kind_name(i) : NULL;
}

static msim_status read_law_type(const ms_json_reader *r, const char *path, ms_value object,
                                 int32_t *kind) {
  if (!json_is_object(object.json)) return ms_json_refuse(r, ms_json_at(path), object, "an object");
  const ms_scene_key *key = &ms_law_keys[MS_KEY_LAW_TYPE];
  static const char *const must =
      "\"linear\", \"tension\", \"compression\", \"dead_band\", \"polynomial\" or \"table\"";
  ms_value value;
  const msim_status status = ms_json_require(r, path, object, key->key, must, &value);
  if (status) return status;
  const ms_key_path at = ms_json_member_path(path, key->key);
  const char *name = ms_value_text(value);
  if (!name) return ms_json_refuse(r, ms_json_at(at.text), value, must);
  for (*kind = 0; *kind < MSIM_LAW_CALLBACK; ++*kind)
    if (strcmp(ms_laws_kind_name(*kind), name) == 0) return MSIM_OK;
  if (strcmp(name, ms_laws_kind_name(MSIM_LAW_CALLBACK)) == 0)
    return ms_json_fail(r, MSIM_ERR_ARG,
                        "%s is \"callback\", a law that only a program can give to the scene",
                        at.text);
  char hinted[192];
  snprintf(hinted, sizeof hinted, "%s%s", must, ms_suggest_hint(name, type_name, NULL).text);
  return ms_json_refuse(r, ms_json_at(at.text), value, hinted);
}

static msim_status check_law_keys(const ms_json_reader *r, const char *path, ms_value value,
                                  int32_t kind) {
  const unsigned keys = keys_of_kind[kind] | 1 << MS_KEY_BREAK_STRAIN | 1 << MS_KEY_BREAK_FORCE;
  const char *names[MS_LAW_KEYS + 1] = {ms_law_keys[MS_KEY_LAW_TYPE].key};
  for (int32_t i = 1, n = 1; i < MS_LAW_KEYS; i++)
    if (keys >> i & 1) names[n++] = ms_law_keys[i].key;
  return ms_json_check_keys(r, path, value, names);
}

/* An array of numbers of the size *n, or of any size if *n is 0; the caller frees *numbers. */
static msim_status read_list(const ms_json_reader *r, const char *path, ms_value object,
                             const ms_scene_key *key, int32_t *n, double **numbers) {
  ms_value value;
  msim_status status = ms_json_require(r, path, object, key->key, "an array of numbers", &value);
  if (status) return status;
  const ms_key_path at = ms_json_member_path(path, key->key);
  if (*n == 0) status = ms_json_read_array_size(r, at.text, value, n);
  if (status) return status;
  if (!MS_NEW(&r->alloc, *numbers, *n)) return ms_json_fail_memory(r);
  return ms_json_read_row(r, ms_json_at(at.text), value, key->range, *n, *numbers);
}

static msim_status read_number(const ms_json_reader *r, const char *path, ms_value object,
                               const ms_scene_key *key, double *number) {
  ms_value value;
  const msim_status status = ms_json_require_key(r, path, object, key, &value);
  return status ? status : ms_json_read_numbers(r, path, object, key, number);
}

static msim_status read_law_members(const ms_json_reader *r, const char *path, ms_value value,
                                    msim_law *law, double *lists[2]) {
  const ms_scene_key *keys = ms_law_keys;
  msim_status status = MSIM_OK;
  if (law->kind == MSIM_LAW_DEAD_BAND)
    return read_number(r, path, value, &keys[MS_KEY_HALF_WIDTH], &law->half_width);
  if (law->kind == MSIM_LAW_POLYNOMIAL) {
    status = read_number(r, path, value, &keys[MS_KEY_LIMIT], &law->limit);
    if (!status) status = read_list(r, path, value, &keys[MS_KEY_COEFFICIENTS], &law->n, &lists[0]);
    law->coefficients = lists[0];
  } else if (law->kind == MSIM_LAW_TABLE) {
    status = read_list(r, path, value, &keys[MS_KEY_STRETCH], &law->n, &lists[0]);
    if (!status) status = read_list(r, path, value, &keys[MS_KEY_LAW_FORCE], &law->n, &lists[1]);
    law->stretch = lists[0], law->force = lists[1];
  }
  return status;
}

static msim_status read_thresholds(const ms_json_reader *r, const char *path, ms_value value,
                                   msim_law *law) {
  const ms_scene_key *keys = ms_law_keys;
  const msim_status status =
      ms_json_read_numbers(r, path, value, &keys[MS_KEY_BREAK_STRAIN], &law->break_strain);
  return status
             ? status
             : ms_json_read_numbers(r, path, value, &keys[MS_KEY_BREAK_FORCE], &law->break_force);
}

/* A linear law without thresholds at the head of the list is law 0, which every scene has. */
static msim_status read_law(const ms_json_reader *r, const char *path, size_t i, ms_value value) {
  msim_law law = {.size = sizeof law};
  double *lists[2] = {NULL, NULL};
  msim_status status = read_law_type(r, path, value, &law.kind);
  if (!status) status = check_law_keys(r, path, value, law.kind);
  if (!status) status = read_thresholds(r, path, value, &law);
  if (status || (law.kind == MSIM_LAW_LINEAR && i == 0 && !law.break_strain && !law.break_force))
    return status;
  status = read_law_members(r, path, value, &law, lists);
  if (!status)
    status = ms_json_forward_error(r, ms_json_member_path(path, "").text,
                                   msim_scene_add_law(r->scene, &law, NULL, r->err));
  MS_FREE(&r->alloc, lists[0], lists[1]);
  return status;
}

msim_status ms_json_read_laws(ms_json_reader *r, const char *path, ms_value laws) {
  int32_t n;
  msim_status status = ms_json_read_array_size(r, path, laws, &n);
  for (size_t i = 0; i < ms_value_size(laws) && !status; i++)
    status = read_law(r, ms_json_item_path(path, i).text, i, ms_value_item(laws, i));
  return status;
}

/*------------------------------------- laws of springs ------------------------------------------*/

msim_status ms_json_read_spring_laws(const ms_json_reader *r, ms_value value, int32_t first,
                                     int32_t n, double *scratch) {
  const int32_t nlaws = r->scene->data->nlaws;
  msim_status status =
      ms_json_read_each(r, "springs.law", value, ms_spring_keys[MS_KEY_LAW].range, n, scratch);
  for (int32_t e = 0; e < n && !status; e++) {
    const int32_t spring = first + e;
    if (scratch[e] > nlaws)
      return ms_json_fail(r, MSIM_ERR_ARG,
                          "springs.law is %.0f for spring %d; `laws` has laws 0 (linear) to %d",
                          scratch[e], e, nlaws);
    status = ms_json_forward_error(
        r, "springs.", msim_scene_set_law(r->scene, 1, &spring, (int32_t)scratch[e], r->err));
  }
  return status;
}
