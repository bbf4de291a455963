#include <errno.h>
#include <jansson.h>
#include <stdlib.h>
#include <string.h>

#include "scene/laws.h"
#include "scene/options.h"

/*------------------------------------- values ---------------------------------------------------*/

static void write_number(ms_text *text, double value) {
  ms_text_append(text, "%s", ms_text_format_double(value).text);
}

/* An array of `count` numbers; if width > 1, an array of rows of `width` numbers. */
static void write_numbers(ms_text *text, int64_t count, int width, const double *numbers) {
  ms_text_append(text, "[");
  for (int64_t i = 0; i < count; i++) {
    const int first = i % width == 0, last = i % width == width - 1;
    ms_text_append(text, "%s%s%s%s", i ? "," : "", width > 1 && first ? "[" : "",
                   ms_text_format_double(numbers[i]).text, width > 1 && last ? "]" : "");
  }
  ms_text_append(text, "]");
}

int ms_scene_all_equal(int64_t count, const double *numbers) {
  int64_t i = 1;
  while (i < count && memcmp(numbers + i, numbers, sizeof *numbers) == 0) i++;
  return i >= count;
}

/* ,"key": one number if all have the same bits, else an array */
static void write_each(ms_text *text, const char *key, int64_t count, const double *numbers) {
  ms_text_append(text, ",\n    \"%s\": ", key);
  if (count > 0 && ms_scene_all_equal(count, numbers)) write_number(text, numbers[0]);
  else write_numbers(text, count, 1, numbers);
}

static msim_status write_string(ms_text *text, const char *string, msim_error *err) {
  json_t *value = json_string(string);
  char *quoted = value ? json_dumps(value, JSON_ENCODE_ANY) : NULL;
  if (quoted) ms_text_append(text, "%s", quoted);
  free(quoted);
  json_decref(value);
  return quoted ? MSIM_OK : ms_error_set_memory(err, "a scene file");
}

/*------------------------------------- sections -------------------------------------------------*/

int ms_scene_all_zero(int64_t count, const double *numbers) {
  const double zero = 0;
  return count == 0 ||
         (memcmp(numbers, &zero, sizeof zero) == 0 && ms_scene_all_equal(count, numbers));
}

static void write_pinned(ms_text *text, const ms_scene *s) {
  int32_t count = 0;
  for (int32_t i = 0; i < s->nparticles; i++)
    if (s->pinned[i]) ms_text_append(text, "%s%d", count++ ? "," : ",\n    \"pinned\": [", i);
  if (count) ms_text_append(text, "]");
}

static void write_json_particles(ms_text *text, const ms_scene *s) {
  const int64_t n = s->nparticles;
  ms_text_append(text, ",\n  \"particles\": {\n    \"x\": ");
  write_numbers(text, 3 * n, 3, s->x);
  if (!ms_scene_all_zero(3 * n, s->v)) {
    ms_text_append(text, ",\n    \"v\": ");
    write_numbers(text, 3 * n, 3, s->v);
  }
  write_each(text, "mass", n, s->mass);
  write_pinned(text, s);
  if (s->force) {
    ms_text_append(text, ",\n    \"force\": ");
    write_numbers(text, 3 * n, 3, s->force);
  }
  ms_text_append(text, "\n  }");
}

/* An array of rows of `width` indices */
static void write_index_rows(ms_text *text, int32_t count, int width, const int32_t *index) {
  const size_t n = (size_t)count * (size_t)width, last = (size_t)width - 1;
  ms_text_append(text, "[");
  for (size_t i = 0; i < n; i++)
    ms_text_append(text, "%s%s%d%s", i ? "," : "", i % (size_t)width ? "" : "[", index[i],
                   i % (size_t)width == last ? "]" : "");
  ms_text_append(text, "]");
}

static void write_spring_laws(ms_text *text, const ms_scene *s) {
  ms_text_append(text, ",\n    \"law\": [");
  for (int32_t e = 0; e < s->nsprings; e++) ms_text_append(text, "%s%d", e ? "," : "", s->law[e]);
  ms_text_append(text, "]");
}

static void write_list(ms_text *text, ms_scene_key key, int32_t n, const double *numbers) {
  if (!numbers) return;
  ms_text_append(text, ", \"%s\": ", key.key);
  write_numbers(text, n, 1, numbers);
}

static void write_member(ms_text *text, ms_scene_key key, double number) {
  ms_text_append(text, ", \"%s\": %s", key.key, ms_text_format_double(number).text);
}

static void write_law(ms_text *text, const msim_law *law) {
  const ms_scene_key *keys = ms_law_keys;
  ms_text_append(text, ",\n    {\"type\": \"%s\"", ms_laws_kind_name(law->kind));
  if (law->kind == MSIM_LAW_DEAD_BAND) write_member(text, keys[MS_KEY_HALF_WIDTH], law->half_width);
  write_list(text, keys[MS_KEY_COEFFICIENTS], law->n, law->coefficients);
  if (law->kind == MSIM_LAW_POLYNOMIAL) write_member(text, keys[MS_KEY_LIMIT], law->limit);
  write_list(text, keys[MS_KEY_STRETCH], law->n, law->stretch);
  write_list(text, keys[MS_KEY_LAW_FORCE], law->n, law->force);
  if (law->break_strain > 0) write_member(text, keys[MS_KEY_BREAK_STRAIN], law->break_strain);
  if (law->break_force > 0) write_member(text, keys[MS_KEY_BREAK_FORCE], law->break_force);
  ms_text_append(text, "}");
}

/* With law 0 first, so that numbers are positions in the list */
static void write_json_laws(ms_text *text, const ms_scene *s) {
  if (s->nlaws == 0) return;
  ms_text_append(text, ",\n  \"laws\": [\n    {\"type\": \"linear\"}");
  for (int32_t i = 0; i < s->nlaws; i++) write_law(text, &s->laws[i].given);
  ms_text_append(text, "\n  ]");
}

static void write_json_springs(ms_text *text, const ms_scene *s) {
  if (s->nsprings == 0) return;
  ms_text_append(text, ",\n  \"springs\": {\n    \"ij\": ");
  write_index_rows(text, s->nsprings, 2, s->ij);
  write_each(text, "k", s->nsprings, s->k);
  write_each(text, "rest", s->nsprings, s->rest);
  if (!ms_scene_all_zero(s->nsprings, s->damping))
    write_each(text, "damping", s->nsprings, s->damping);
  if (s->law) write_spring_laws(text, s);
  ms_text_append(text, "\n  }");
}

static void write_json_angles(ms_text *text, const ms_scene *s) {
  const ms_scene_angles *g = &s->angles;
  if (g->n == 0) return;
  ms_text_append(text, ",\n  \"angles\": {\n    \"ijk\": ");
  write_index_rows(text, g->n, 3, g->ijk);
  write_each(text, "k", g->n, g->k);
  write_each(text, "rest", g->n, g->rest);
  if (!ms_scene_all_zero(g->n, g->damping)) write_each(text, "damping", g->n, g->damping);
  ms_text_append(text, "\n  }");
}

static void write_json_faces(ms_text *text, const ms_scene *s) {
  if (s->nfaces == 0) return;
  ms_text_append(text, ",\n  \"faces\": ");
  write_index_rows(text, s->nfaces, 3, s->faces);
}

static void write_json_planes(ms_text *text, const ms_scene *s) {
  if (s->nplanes == 0) return;
  ms_text_append(text, ",\n  \"planes\": [");
  for (int32_t i = 0; i < s->nplanes; i++) {
    const msim_plane *p = &s->planes[i];
    ms_text_append(text, "%s\n    {\"normal\": ", i ? "," : "");
    write_numbers(text, 3, 1, p->normal);
    ms_text_append(text, ", \"offset\": %s", ms_text_format_double(p->offset).text);
    ms_text_append(text, ", \"restitution\": %s", ms_text_format_double(p->restitution).text);
    ms_text_append(text, ", \"friction\": %s}", ms_text_format_double(p->friction).text);
  }
  ms_text_append(text, "\n  ]");
}

static void write_interpolation(ms_text *text, int32_t interpolation) {
  ms_text_append(text, ", \"interpolation\": \"%s\"}", ms_motion_interpolations[interpolation]);
}

static void write_collider_motion(ms_text *text, const ms_collider_motion *m) {
  if (m->x.nt == 0) return;
  ms_text_append(text, ", \"motion\": {\"t\": ");
  write_numbers(text, m->x.nt, 1, m->x.t);
  ms_text_append(text, ", \"x\": ");
  write_numbers(text, 3 * (int64_t)m->x.nt, 3, m->x.x);
  if (m->rotation.nt) {
    ms_text_append(text, ", \"rotation\": ");
    write_numbers(text, 3 * (int64_t)m->rotation.nt, 3, m->rotation.x);
  }
  write_interpolation(text, m->x.interpolation);
}

static void write_samples(ms_text *text, const msim_collider *c) {
  const ms_scene_key *count = ms_colliders_get_count_key(c->type);
  if (!count) return;
  ms_text_append(text, ", \"%s\": [%d,%d", count->key, c->n[0], c->n[1]);
  if (count->count == 3) ms_text_append(text, ",%d", c->n[2]);
  ms_text_append(text, "], \"%s\": ", ms_colliders_get_values_key(c->type)->key);
  write_numbers(text, (int64_t)ms_colliders_count_values(c), 1, c->values);
}

static void write_json_collider(ms_text *text, const msim_collider *c,
                                const ms_collider_motion *motion) {
  ms_text_append(text, "{\"type\": \"%s\"", ms_colliders_get_type(c->type)->name);
  for (int i = 0; i < MS_COLLIDER_MEMBERS; i++) {
    const ms_collider_member *m = &ms_collider_members[i];
    if (!ms_colliders_type_has(c->type, m)) continue;
    ms_text_append(text, ", \"%s\": ", m->key.key);
    if (m->key.count == 1) write_number(text, *ms_colliders_get_member(c, m));
    else write_numbers(text, m->key.count, 1, ms_colliders_get_member(c, m));
  }
  write_samples(text, c);
  if (c->inside) ms_text_append(text, ", \"inside\": true");
  write_collider_motion(text, motion);
  ms_text_append(text, "}");
}

static void write_json_colliders(ms_text *text, const ms_scene *s) {
  if (s->ncolliders == 0) return;
  ms_text_append(text, ",\n  \"colliders\": [");
  for (int32_t i = 0; i < s->ncolliders; i++) {
    ms_text_append(text, i ? ",\n    " : "\n    ");
    write_json_collider(text, &s->colliders[i], &s->collider_motions[i]);
  }
  ms_text_append(text, "\n  ]");
}

static void write_json_motions(ms_text *text, const ms_scene *s) {
  if (s->nmotions == 0) return;
  ms_text_append(text, ",\n  \"motions\": [");
  for (int32_t i = 0; i < s->nmotions; i++) {
    const ms_motion *m = &s->motions[i];
    ms_text_append(text, "%s\n    {\"particles\": [", i ? "," : "");
    for (int32_t k = 0; k < m->n; k++) ms_text_append(text, "%s%d", k ? "," : "", m->particles[k]);
    ms_text_append(text, "], \"t\": ");
    write_numbers(text, m->nt, 1, m->t);
    ms_text_append(text, ", \"x\": [");
    for (int32_t k = 0; k < m->nt; k++) {
      if (k) ms_text_append(text, ",");
      write_numbers(text, 3 * (int64_t)m->n, 3, m->x + 3 * (size_t)k * (size_t)m->n);
    }
    ms_text_append(text, "]");
    write_interpolation(text, m->interpolation);
  }
  ms_text_append(text, "\n  ]");
}

static void write_json_self_contact(ms_text *text, const ms_scene *s) {
  if (!ms_scene_has_self_contact(s)) return;
  ms_text_append(text, ",\n  \"self_contact\": {\"thickness\": %s",
                 ms_text_format_double(s->self_contact.thickness).text);
  ms_text_append(text, ", \"friction\": %s}", ms_text_format_double(s->self_contact.friction).text);
}

static msim_status write_json_run(ms_text *text, const ms_scene *s, msim_error *err) {
  if (s->nrun == 0) return MSIM_OK;
  ms_text_append(text, ",\n  \"run\": {");
  for (int32_t i = 0; i < s->nrun; i++) {
    const ms_run_option *entry = &s->run[i];
    int number;
    const msim_option_entry *option = ms_options_find(entry->name, &number);
    ms_text_append(text, "%s\n    \"%s\": ", i ? "," : "", entry->name);
    msim_status status = MSIM_OK;
    if (number && !ms_options_accepts_word(option, entry->value))
      ms_text_append(text, "%s", entry->value);
    else status = write_string(text, entry->value, err);
    if (status) return status;
  }
  ms_text_append(text, "\n  }");
  return MSIM_OK;
}

/*------------------------------------- the whole ------------------------------------------------*/

int ms_scene_is_utf8(const char *text) {
  errno = 0; /* errno distinguishes the two reasons for which json_string() fails */
  json_t *value = json_string(text);
  const int result = value ? 1 : errno == ENOMEM ? -1 : 0;
  json_decref(value);
  return result;
}

msim_status ms_scene_check_savable(const ms_scene *scene, msim_error *err) {
  if (scene->nparticles == 0)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "the scene has no particles; a scene file needs at least one");
  const int is_utf8 = ms_scene_is_utf8(scene->name);
  if (is_utf8 > 0) return MSIM_OK;
  if (is_utf8 < 0) return ms_error_set_memory(err, "a scene file");
  return ms_error_set(err, MSIM_ERR_ARG,
                      "the name of the scene is not valid UTF-8; change it to save the scene");
}

static msim_status write_json_scene(ms_text *text, const ms_scene *s, msim_error *err) {
  msim_status status = ms_scene_check_savable(s, err);
  if (status) return status;
  ms_text_append(text, "{\n  \"msim\": 1,\n  \"name\": ");
  status = write_string(text, s->name, err);
  if (status) return status;
  for (int i = 0; i < MS_SCENE_PARAMETERS; i++) {
    const ms_scene_parameter *p = &ms_scene_parameters[i];
    const double *numbers = ms_scene_get_parameter(s, p);
    ms_text_append(text, ",\n  \"%s\": ", p->key.key);
    if (p->key.count == 1) ms_text_append(text, "%s", ms_text_format_double(*numbers).text);
    else write_numbers(text, p->key.count, 1, numbers);
  }
  write_json_particles(text, s);
  write_json_laws(text, s);
  write_json_springs(text, s);
  write_json_angles(text, s);
  write_json_faces(text, s);
  write_json_planes(text, s);
  if (s->planes_constrain) ms_text_append(text, ",\n  \"planes_constrain\": true");
  write_json_colliders(text, s);
  write_json_motions(text, s);
  write_json_self_contact(text, s);
  status = write_json_run(text, s, err);
  ms_text_append(text, "\n}\n");
  return status;
}

msim_status ms_scene_write_json(const ms_scene *scene, ms_text *text, msim_error *err) {
  msim_status status = MSIM_OK;
  if (scene->source) ms_text_append(text, "%s", scene->source);
  else status = write_json_scene(text, scene, err);
  if (status) return status;
  ms_text_flush(text);
  return text->failed ? ms_error_set_memory(err, "a scene file") : ms_error_clear(err);
}
