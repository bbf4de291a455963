#include <errno.h>
#include <jansson.h>
#include <stdlib.h>
#include <string.h>

#include "scene/options.h"
#include "scene/scene.h"

/*------------------------------------- values ---------------------------------------------------*/

static void write_number(ms_text *text, double value) {
  ms_print(text, "%s", ms_number_text(value).text);
}

/* An array of `count` numbers; if width > 1, an array of rows of `width` numbers. */
static void write_numbers(ms_text *text, int64_t count, int width, const double *numbers) {
  ms_print(text, "[");
  for (int64_t i = 0; i < count; i++) {
    const int first = i % width == 0, last = i % width == width - 1;
    ms_print(text, "%s%s%s%s", i ? "," : "", width > 1 && first ? "[" : "",
             ms_number_text(numbers[i]).text, width > 1 && last ? "]" : "");
  }
  ms_print(text, "]");
}

int ms_all_equal(int64_t count, const double *numbers) {
  int64_t i = 1;
  while (i < count && memcmp(numbers + i, numbers, sizeof *numbers) == 0) i++;
  return i >= count;
}

/* ,"key": one number if all have the same bits, else an array */
static void write_each(ms_text *text, const char *key, int64_t count, const double *numbers) {
  ms_print(text, ",\n    \"%s\": ", key);
  if (count > 0 && ms_all_equal(count, numbers)) write_number(text, numbers[0]);
  else write_numbers(text, count, 1, numbers);
}

static msim_status write_string(ms_text *text, const char *string, msim_error *err) {
  json_t *value = json_string(string);
  char *quoted = value ? json_dumps(value, JSON_ENCODE_ANY) : NULL;
  if (quoted) ms_print(text, "%s", quoted);
  free(quoted);
  json_decref(value);
  return quoted ? MSIM_OK : ms_fail_memory(err, "a scene file");
}

/*------------------------------------- sections -------------------------------------------------*/

int ms_all_zero(int64_t count, const double *numbers) {
  const double zero = 0;
  return count == 0 || (memcmp(numbers, &zero, sizeof zero) == 0 && ms_all_equal(count, numbers));
}

static void write_pinned(ms_text *text, const ms_scene *s) {
  int32_t count = 0;
  for (int32_t i = 0; i < s->nparticles; i++)
    if (s->pinned[i]) ms_print(text, "%s%d", count++ ? "," : ",\n    \"pinned\": [", i);
  if (count) ms_print(text, "]");
}

static void write_particles(ms_text *text, const ms_scene *s) {
  const int64_t n = s->nparticles;
  ms_print(text, ",\n  \"particles\": {\n    \"x\": ");
  write_numbers(text, 3 * n, 3, s->x);
  if (!ms_all_zero(3 * n, s->v)) {
    ms_print(text, ",\n    \"v\": ");
    write_numbers(text, 3 * n, 3, s->v);
  }
  write_each(text, "mass", n, s->mass);
  write_pinned(text, s);
  ms_print(text, "\n  }");
}

static void write_springs(ms_text *text, const ms_scene *s) {
  if (s->nsprings == 0) return;
  ms_print(text, ",\n  \"springs\": {\n    \"ij\": [");
  for (size_t e = 0; e < (size_t)s->nsprings; e++)
    ms_print(text, "%s[%d,%d]", e ? "," : "", s->ij[2 * e], s->ij[2 * e + 1]);
  ms_print(text, "]");
  write_each(text, "k", s->nsprings, s->k);
  write_each(text, "rest", s->nsprings, s->rest);
  if (!ms_all_zero(s->nsprings, s->damping)) write_each(text, "damping", s->nsprings, s->damping);
  ms_print(text, "\n  }");
}

static void write_planes(ms_text *text, const ms_scene *s) {
  if (s->nplanes == 0) return;
  ms_print(text, ",\n  \"planes\": [");
  for (int32_t i = 0; i < s->nplanes; i++) {
    const msim_plane *p = &s->planes[i];
    ms_print(text, "%s\n    {\"normal\": ", i ? "," : "");
    write_numbers(text, 3, 1, p->normal);
    ms_print(text, ", \"offset\": %s", ms_number_text(p->offset).text);
    ms_print(text, ", \"restitution\": %s", ms_number_text(p->restitution).text);
    ms_print(text, ", \"friction\": %s}", ms_number_text(p->friction).text);
  }
  ms_print(text, "\n  ]");
}

static msim_status write_run(ms_text *text, const ms_scene *s, msim_error *err) {
  if (s->nrun == 0) return MSIM_OK;
  ms_print(text, ",\n  \"run\": {");
  for (int32_t i = 0; i < s->nrun; i++) {
    const ms_run_entry *entry = &s->run[i];
    int number;
    const msim_option_entry *option = ms_option_find(entry->name, &number);
    ms_print(text, "%s\n    \"%s\": ", i ? "," : "", entry->name);
    msim_status status = MSIM_OK;
    if (number && !ms_option_is_word(option, entry->value)) ms_print(text, "%s", entry->value);
    else status = write_string(text, entry->value, err);
    if (status) return status;
  }
  ms_print(text, "\n  }");
  return MSIM_OK;
}

/*------------------------------------- the whole ------------------------------------------------*/

int ms_is_utf8(const char *text) {
  errno = 0; /* errno distinguishes the two reasons for which json_string() fails */
  json_t *value = json_string(text);
  const int result = value ? 1 : errno == ENOMEM ? -1 : 0;
  json_decref(value);
  return result;
}

msim_status ms_scene_check_file(const ms_scene *scene, msim_error *err) {
  if (scene->nparticles == 0)
    return ms_fail(err, MSIM_ERR_ARG, "the scene holds no particles; a scene file must hold some");
  const int is_utf8 = ms_is_utf8(scene->name);
  if (is_utf8 > 0) return MSIM_OK;
  if (is_utf8 < 0) return ms_fail_memory(err, "a scene file");
  return ms_fail(err, MSIM_ERR_ARG,
                 "the scene's name is not valid UTF-8; a scene file cannot hold it");
}

static msim_status write_scene(ms_text *text, const ms_scene *s, msim_error *err) {
  msim_status status = ms_scene_check_file(s, err);
  if (status) return status;
  ms_print(text, "{\n  \"msim\": 1,\n  \"name\": ");
  status = write_string(text, s->name, err);
  if (status) return status;
  ms_print(text, ",\n  \"gravity\": ");
  write_numbers(text, 3, 1, s->gravity);
  ms_print(text, ",\n  \"drag\": %s", ms_number_text(s->drag).text);
  write_particles(text, s);
  write_springs(text, s);
  write_planes(text, s);
  status = write_run(text, s, err);
  ms_print(text, "\n}\n");
  return status;
}

msim_status ms_scene_to_json(const ms_scene *scene, ms_text *text, msim_error *err) {
  msim_status status = MSIM_OK;
  if (scene->source) ms_print(text, "%s", scene->source);
  else status = write_scene(text, scene, err);
  if (status) return status;
  return text->failed ? ms_fail_memory(err, "a scene file") : ms_ok(err);
}
