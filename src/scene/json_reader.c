#include "scene/json_reader.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/suggest.h"
#include "scene/options.h"

/*------------------------------------- messages -------------------------------------------------*/

/* A value of the file, shortened for a message. */
typedef struct excerpt {
  char text[48];
} excerpt;

/* The first characters of a text, without splitting a UTF-8 sequence. */
static excerpt make_excerpt(const char *text) {
  excerpt e;
  size_t n = strlen(text);
  const int whole = n < sizeof e.text;
  if (!whole)
    for (n = sizeof e.text - sizeof "..."; n > 0 && ((unsigned char)text[n] & 0xC0) == 0x80;) n--;
  memcpy(e.text, text, n);
  memcpy(e.text + n, "...", whole ? 0 : 3);
  e.text[whole ? n : n + 3] = '\0';
  return e;
}

/* A number as JSON; "%g" for values that JSON does not have, from an importer. */
static excerpt describe_number(ms_value value) {
  excerpt e;
  const double number = ms_value_number(value);
  json_t *json = ms_value_is_whole(value) ? json_integer(ms_value_whole(value)) : json_real(number);
  char *text = json_dumps(json, JSON_ENCODE_ANY | JSON_REAL_PRECISION(15));
  if (text) e = make_excerpt(text);
  else snprintf(e.text, sizeof e.text, "%g", number);
  free(text);
  json_decref(json);
  return e;
}

static excerpt describe_value(ms_value value) {
  excerpt e;
  if (ms_value_is_array(value)) {
    snprintf(e.text, sizeof e.text, "an array of %zu", ms_value_size(value));
    return e;
  }
  if (json_is_object(value.json)) return make_excerpt("an object");
  if (ms_value_is_number(value)) return describe_number(value);
  char *text = json_dumps(value.json, JSON_ENCODE_ANY);
  e = make_excerpt(text ? text : "a value");
  free(text);
  return e;
}

ms_key_path ms_json_member_path(const char *path, const char *key) {
  ms_key_path p;
  snprintf(p.text, sizeof p.text, "%s%s%s", path, *path ? "." : "", make_excerpt(key).text);
  return p;
}

ms_key_path ms_json_item_path(const char *path, size_t i) {
  ms_key_path p;
  snprintf(p.text, sizeof p.text, "%s[%zu]", path, i);
  return p;
}

msim_status ms_json_fail(const ms_json_reader *r, msim_status status, const char *format, ...) {
  msim_error inner;
  va_list args;
  va_start(args, format);
  ms_error_vset(&inner, status, format, args);
  va_end(args);
  return ms_error_set(r->err, status, "%s: %s", r->label, inner.text);
}

msim_status ms_json_refuse(const ms_json_reader *r, ms_json_location at, ms_value value,
                           const char *must) {
  char index[48] = "";
  if (at.j >= 0) snprintf(index, sizeof index, "[%lld][%lld]", (long long)at.i, (long long)at.j);
  else if (at.i >= 0) snprintf(index, sizeof index, "[%lld]", (long long)at.i);
  return ms_json_fail(r, MSIM_ERR_ARG, "%s%s is %s; it must be %s", *at.key ? at.key : "the scene",
                      index, describe_value(value).text, must);
}

/* "0.5" in place of 0.5 */
static const char *quoted_number_remedy(ms_value value) {
  const char *text = ms_value_text(value);
  if (!text || !*text || !strchr("+-.0123456789", *text)) return "";
  return strchr(text, ',') ? ", without quotes and with a decimal point" : ", without quotes";
}

msim_status ms_json_refuse_number(const ms_json_reader *r, ms_json_location at, ms_value value,
                                  const char *must) {
  char hinted[192];
  snprintf(hinted, sizeof hinted, "%s%s", must, quoted_number_remedy(value));
  return ms_json_refuse(r, at, value, hinted);
}

msim_status ms_json_fail_memory(const ms_json_reader *r) {
  return ms_json_fail(r, MSIM_ERR_MEMORY, "out of memory for the scene");
}

msim_status ms_json_forward_error(const ms_json_reader *r, const char *path, msim_status status) {
  if (status == MSIM_OK || !r->err) return status;
  return ms_json_fail(r, status, "%s%s", status == MSIM_ERR_ARG ? path : "", r->err->text);
}

/*------------------------------------- keys -----------------------------------------------------*/

static const char *key_at(int32_t i, const void *keys) { return ((const char *const *)keys)[i]; }

static msim_status refuse_key(const ms_json_reader *r, const char *path, const char *key,
                              const char *const *keys) {
  char known[256] = "";
  size_t n = 0;
  for (int32_t i = 0; keys[i] && n < sizeof known; i++)
    n += (size_t)snprintf(known + n, sizeof known - n, "%s%s", i ? ", " : "", keys[i]);
  int is_number;
  const char *place =
      !*path && ms_options_find(key, &is_number) ? " here; it belongs into 'run'" : "";
  return ms_json_fail(r, MSIM_ERR_ARG, "%s is an unknown key%s%s; the keys are %s",
                      ms_json_member_path(path, key).text, place,
                      *place ? "" : ms_suggest_hint(key, key_at, keys).text, known);
}

msim_status ms_json_check_keys(const ms_json_reader *r, const char *path, ms_value value,
                               const char *const *keys) {
  if (!json_is_object(value.json)) return ms_json_refuse(r, ms_json_at(path), value, "an object");
  const char *key;
  json_t *member;
  json_object_foreach(value.json, key, member) {
    int32_t i = 0;
    while (keys[i] && strcmp(keys[i], key) != 0) i++;
    if (!keys[i]) return refuse_key(r, path, key, keys);
  }
  return MSIM_OK;
}

msim_status ms_json_require(const ms_json_reader *r, const char *path, ms_value object,
                            const char *key, const char *must, ms_value *value) {
  *value = ms_value_member(object, key);
  if (value->json) return MSIM_OK;
  return ms_json_fail(r, MSIM_ERR_ARG, "%s is missing; it must be %s",
                      ms_json_member_path(path, key).text, must);
}

msim_status ms_json_check_table(const ms_json_reader *r, const char *path, ms_value value,
                                const ms_scene_key *keys, int32_t n) {
  enum { MOST = 16 };
  const char *names[MOST + 1] = {NULL};
  for (int32_t i = 0; i < n && i < MOST; i++) names[i] = keys[i].key;
  return ms_json_check_keys(r, path, value, names);
}

msim_status ms_json_require_key(const ms_json_reader *r, const char *path, ms_value object,
                                const ms_scene_key *key, ms_value *value) {
  char must[96];
  if (key->form == MS_ROWS || key->form == MS_INDEX_ROWS)
    snprintf(must, sizeof must, "an array of arrays of %d %s", key->count,
             key->form == MS_ROWS ? "numbers" : "indices");
  else if (key->form == MS_NUMBER_EACH)
    snprintf(must, sizeof must, "%s for all %s, or an array", ms_range_text(key->range), path);
  else if (key->form == MS_NUMBERS && key->count > 1)
    snprintf(must, sizeof must, "an array of %d numbers", key->count);
  else snprintf(must, sizeof must, "%s", ms_range_text(key->range));
  return ms_json_require(r, path, object, key->key, must, value);
}

/*------------------------------------- values ---------------------------------------------------*/

msim_status ms_json_read_array_size(const ms_json_reader *r, const char *key, ms_value value,
                                    int32_t *n) {
  if (!ms_value_is_array(value)) return ms_json_refuse(r, ms_json_at(key), value, "an array");
  const size_t size = ms_value_size(value);
  if (size > INT32_MAX / 3)
    return ms_json_refuse(r, ms_json_at(key), value, "an array of at most 715827882");
  *n = (int32_t)size;
  return MSIM_OK;
}

msim_status ms_json_read_number(const ms_json_reader *r, ms_json_location at, ms_value value,
                                ms_range range, double *number) {
  *number = ms_value_number(value);
  const int kind =
      range >= MS_POSITIVE_INTEGER ? ms_value_is_whole(value) : ms_value_is_number(value);
  if (kind && ms_range_contains(range, *number)) return MSIM_OK;
  return ms_json_refuse_number(r, at, value, ms_range_text(range));
}

msim_status ms_json_read_flag(const ms_json_reader *r, ms_json_location at, ms_value value,
                              int32_t *flag) {
  const int imported = value.columns && ms_value_is_whole(value);
  *flag = imported ? ms_value_whole(value) != 0 : json_is_true(value.json);
  if (imported ? (ms_value_whole(value) | 1) == 1 : json_is_boolean(value.json)) return MSIM_OK;
  return ms_json_refuse(r, at, value, value.columns ? "0 or 1" : "true or false");
}

static msim_status refuse_length(const ms_json_reader *r, ms_json_location at, ms_value value,
                                 const char *before, int32_t n, const char *items) {
  char must[128];
  snprintf(must, sizeof must, "%san array of %d%s", before, n, items);
  return ms_json_refuse_number(r, at, value, must);
}

static int has_length(ms_value value, int32_t n) {
  return ms_value_is_array(value) && ms_value_size(value) == (size_t)n;
}

msim_status ms_json_read_row(const ms_json_reader *r, ms_json_location at, ms_value value,
                             ms_range range, int32_t n, double *numbers) {
  if (!has_length(value, n)) return refuse_length(r, at, value, "", n, " numbers");
  msim_status status = MSIM_OK;
  for (int32_t c = 0; c < n && !status; c++) {
    ms_json_location item =
        at.i < 0 ? (ms_json_location){at.key, c, -1} : (ms_json_location){at.key, at.i, c};
    status = ms_json_read_number(r, item, ms_value_item(value, (size_t)c), range, numbers + c);
  }
  return status;
}

msim_status ms_json_read_numbers(const ms_json_reader *r, const char *path, ms_value object,
                                 const ms_scene_key *key, double *numbers) {
  ms_value value = ms_value_member(object, key->key);
  if (!value.json && key->preset) return MSIM_OK;
  const msim_status status = ms_json_require_key(r, path, object, key, &value);
  if (status) return status;
  const ms_key_path at = ms_json_member_path(path, key->key);
  return key->count == 1
             ? ms_json_read_number(r, ms_json_at(at.text), value, key->range, numbers)
             : ms_json_read_row(r, ms_json_at(at.text), value, key->range, key->count, numbers);
}

msim_status ms_json_read_rows(const ms_json_reader *r, const char *key, ms_value value, int32_t n,
                              double *numbers) {
  if (!has_length(value, n)) return refuse_length(r, ms_json_at(key), value, "", n, " arrays of 3");
  msim_status status = MSIM_OK;
  for (size_t i = 0; i < (size_t)n && !status; i++)
    status = ms_json_read_row(r, ms_json_at_item(key, i), ms_value_item(value, i), MS_ANY, 3,
                              numbers + 3 * i);
  return status;
}

msim_status ms_json_read_each(const ms_json_reader *r, const char *key, ms_value value,
                              ms_range range, int32_t n, double *numbers) {
  if (has_length(value, n)) return ms_json_read_row(r, ms_json_at(key), value, range, n, numbers);
  if (!ms_value_is_number(value)) {
    char before[64];
    snprintf(before, sizeof before, "%s for all %.*s, or ", ms_range_text(range),
             (int)strcspn(key, "."), key);
    return refuse_length(r, ms_json_at(key), value, before, n, "");
  }
  double number;
  msim_status status = ms_json_read_number(r, ms_json_at(key), value, range, &number);
  for (int32_t i = 0; i < n && !status; i++) numbers[i] = number;
  return status;
}

msim_status ms_json_read_index(const ms_json_reader *r, ms_json_location at, ms_value value,
                               int32_t n, int32_t *index) {
  const int64_t number = ms_value_whole(value);
  *index = (int32_t)number;
  if (ms_value_is_whole(value) && number >= 0 && number < n) return MSIM_OK;
  char must[128] = "removed, because there are no particles";
  if (n)
    snprintf(
        must, sizeof must, "a whole number from 0 to %d%s", n - 1,
        json_is_boolean(value.json) ? ": list the indices of particles, not a flag for each" : "");
  return ms_json_refuse(r, at, value, must);
}

msim_status ms_json_read_index_rows(const ms_json_reader *r, const char *key, ms_value rows,
                                    int32_t width, int32_t n, int32_t *to) {
  const int32_t limit = ms_scene_count_ends(r->scene->data);
  msim_status status = MSIM_OK;
  for (size_t e = 0; e < (size_t)n && !status; e++) {
    const ms_value row = ms_value_item(rows, e);
    if (!ms_value_is_array(row) || ms_value_size(row) != (size_t)width)
      return ms_json_refuse(r, ms_json_at_item(key, e), row,
                            width == 2 ? "an array of 2 indices" : "an array of 3 indices");
    for (size_t c = 0; c < (size_t)width && !status; c++) {
      const ms_json_location at = {key, (int64_t)e, (int64_t)c};
      status = ms_json_read_index(r, at, ms_value_item(row, c), limit, to++);
    }
  }
  return status;
}
