#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "scene/options.h"
#include "scene/json_syntax.h"
#include "scene/scene_json.h"
#include "scene/scene_json_angles.h"
#include "scene/scene_json_colliders.h"
#include "scene/scene_json_laws.h"
#include "scene/scene_json_motions.h"
#include "scene/scene_json_objects.h"

enum { FORMAT_VERSION = 1 };

/*------------------------------------- small sections -------------------------------------------*/

static msim_status read_version(ms_json_reader *r, const char *path, ms_value value) {
  if (ms_value_is_whole(value) && ms_value_whole(value) == FORMAT_VERSION) return MSIM_OK;
  return ms_json_refuse(r, ms_json_at(path), value, "1, the version of the format");
}

static msim_status read_name(ms_json_reader *r, const char *path, ms_value value) {
  if (!ms_value_text(value)) return ms_json_refuse(r, ms_json_at(path), value, "a string");
  return ms_json_forward_error(r, "", msim_scene_set_name(r->scene, ms_value_text(value), r->err));
}

static msim_status read_parameter(ms_json_reader *r, const ms_scene_parameter *p, ms_value root) {
  double numbers[3];
  if (!ms_value_member(root, p->key.key).json) return MSIM_OK;
  const msim_status status = ms_json_read_numbers(r, "", root, &p->key, numbers);
  return status ? status : ms_json_forward_error(r, "", p->set(r->scene, numbers, r->err));
}

/*------------------------------------- particles ------------------------------------------------*/

/* A list of particle indices; the caller deletes *list, also after an error. */
static msim_status read_indices(const ms_json_reader *r, const char *key, ms_value value,
                                int32_t limit, int32_t *n, int32_t **list) {
  if (!ms_value_is_array(value))
    return ms_json_refuse(r, ms_json_at(key), value, "an array of indices of particles");
  msim_status status = ms_json_read_array_size(r, key, value, n);
  if (status) return status;
  *list = ms_memory_allocate(&r->alloc, (size_t)*n, sizeof **list);
  if (!*list) return ms_json_fail_memory(r);
  for (size_t i = 0; i < (size_t)*n && !status; i++)
    status =
        ms_json_read_index(r, ms_json_at_item(key, i), ms_value_item(value, i), limit, *list + i);
  return status;
}

/* Of particles of the whole scene those that this one has; returns their number. */
static int32_t select_particles(const ms_json_reader *r, int32_t n, int32_t *list) {
  int32_t k = 0;
  for (int32_t i = 0; i < n; i++) {
    const int32_t p = list[i] - r->first_particle;
    if (p >= 0 && p < r->scene->data->nparticles) list[k++] = p;
  }
  return k;
}

static msim_status read_pinned_particles(const ms_json_reader *r, ms_value value) {
  const int32_t limit = ms_scene_count_ends(r->scene->data);
  int32_t n, *list = NULL;
  msim_status status = read_indices(r, "particles.pinned", value, limit, &n, &list);
  if (!status) n = select_particles(r, n, list);
  if (!status)
    status = ms_json_forward_error(r, "particles.", msim_scene_pin(r->scene, n, list, r->err));
  ms_memory_free(&r->alloc, list);
  return status;
}

/* Free the numbers that have just been read: no array is there twice. */
static msim_status release(const ms_json_reader *r, ms_value value, msim_status status) {
  ms_value_release(value, &r->alloc);
  return status;
}

static msim_status add_listed_particles(const ms_json_reader *r, ms_value section, ms_value x,
                                        ms_value mass, int32_t n, double *room /* 10n */) {
  double *at_v = room + 3 * (size_t)n, *at_force = at_v + 3 * (size_t)n,
         *at_mass = at_force + 3 * (size_t)n;
  const ms_scene_key *keys = ms_particle_keys;
  const ms_value v = ms_value_member(section, keys[MS_KEY_V].key),
                 pinned = ms_value_member(section, keys[MS_KEY_PINNED].key),
                 force = ms_value_member(section, keys[MS_KEY_FORCE].key);
  msim_status status = release(r, x, ms_json_read_rows(r, "particles.x", x, n, room));
  if (!status && v.json) status = release(r, v, ms_json_read_rows(r, "particles.v", v, n, at_v));
  if (!status)
    status = release(
        r, mass, ms_json_read_each(r, "particles.mass", mass, keys[MS_KEY_MASS].range, n, at_mass));
  if (!status && force.json)
    status = release(r, force, ms_json_read_rows(r, "particles.force", force, n, at_force));
  if (status) return status;
  status = msim_scene_add_particles(r->scene, n, room, at_v, at_mass, r->err);
  if (!status && force.json) status = msim_scene_set_forces(r->scene, at_force, r->err);
  if (status || !pinned.json) return ms_json_forward_error(r, "", status);
  return read_pinned_particles(r, pinned);
}

static msim_status read_particles(ms_json_reader *r, const char *path, ms_value section) {
  ms_value x = {NULL}, mass = {NULL};
  int32_t n = 0;
  msim_status status = ms_json_check_table(r, path, section, ms_particle_keys, MS_PARTICLE_KEYS);
  if (!status) status = ms_json_require_key(r, path, section, &ms_particle_keys[MS_KEY_X], &x);
  if (!status)
    status = ms_json_require_key(r, path, section, &ms_particle_keys[MS_KEY_MASS], &mass);
  if (!status) status = ms_json_read_array_size(r, "particles.x", x, &n);
  if (status) return status;
  double *room = ms_memory_allocate(&r->alloc, (size_t)n, 10 * sizeof *room);
  if (!room) return ms_json_fail_memory(r);
  status = add_listed_particles(r, section, x, mass, n, room);
  ms_memory_free(&r->alloc, room);
  return status;
}

/*------------------------------------- springs --------------------------------------------------*/

/* In place: no array is there twice. */
static msim_status add_listed_springs(const ms_json_reader *r, ms_value section, ms_value pairs,
                                      ms_value k, int32_t n) {
  const ms_scene_key *keys = ms_spring_keys;
  ms_value rest = ms_value_member(section, keys[MS_KEY_REST].key);
  ms_value damping = ms_value_member(section, keys[MS_KEY_DAMPING].key);
  msim_status status = ms_json_forward_error(r, "", ms_scene_begin_springs(r->scene, n, r->err));
  if (status) return status;
  ms_scene *s = r->scene->data;
  const size_t at = (size_t)s->nsprings;
  if (n) memset(s->damping + at, 0, (size_t)n * sizeof *s->damping);
  status = release(
      r, pairs,
      ms_json_read_index_rows(r, "springs.ij", pairs, keys[MS_KEY_IJ].count, n, s->ij + 2 * at));
  if (!status)
    status =
        release(r, k, ms_json_read_each(r, "springs.k", k, keys[MS_KEY_K].range, n, s->k + at));
  if (!status && rest.json)
    status = release(
        r, rest,
        ms_json_read_each(r, "springs.rest", rest, keys[MS_KEY_REST].range, n, s->rest + at));
  if (!status && damping.json)
    status = release(r, damping,
                     ms_json_read_each(r, "springs.damping", damping, keys[MS_KEY_DAMPING].range, n,
                                       s->damping + at));
  if (status) return status;
  const int has_rest = rest.json || r->nends; /* of a part it is computed later */
  return ms_json_forward_error(r, "", ms_scene_end_springs(s, n, has_rest, r->err));
}

static msim_status read_laws_of_springs(const ms_json_reader *r, ms_value law, int32_t n) {
  double *scratch = ms_memory_allocate(&r->alloc, (size_t)n, sizeof *scratch);
  if (!scratch) return ms_json_fail_memory(r);
  const msim_status status =
      ms_json_read_spring_laws(r, law, r->scene->data->nsprings - n, n, scratch);
  ms_memory_free(&r->alloc, scratch);
  return status;
}

static msim_status read_springs(ms_json_reader *r, const char *path, ms_value section) {
  ms_value pairs = {NULL}, k = {NULL};
  int32_t n = 0;
  msim_status status = ms_json_check_table(r, path, section, ms_spring_keys, MS_SPRING_KEYS);
  if (!status) status = ms_json_require_key(r, path, section, &ms_spring_keys[MS_KEY_IJ], &pairs);
  if (!status) status = ms_json_require_key(r, path, section, &ms_spring_keys[MS_KEY_K], &k);
  if (!status) status = ms_json_read_array_size(r, "springs.ij", pairs, &n);
  if (!status) status = add_listed_springs(r, section, pairs, k, n);
  const ms_value law = ms_value_member(section, ms_spring_keys[MS_KEY_LAW].key);
  return status || !law.json ? status : read_laws_of_springs(r, law, n);
}

/*------------------------------------- faces ----------------------------------------------------*/

static msim_status read_faces(ms_json_reader *r, const char *path, ms_value faces) {
  int32_t n;
  msim_status status = ms_json_read_array_size(r, path, faces, &n);
  if (!status) status = ms_json_forward_error(r, "", ms_scene_begin_faces(r->scene, n, r->err));
  if (status) return status;
  ms_scene *s = r->scene->data;
  status = ms_json_read_index_rows(r, path, faces, 3, n, s->faces + 3 * (size_t)s->nfaces);
  return status ? status : ms_json_forward_error(r, "", ms_scene_end_faces(s, n, r->err));
}

/*------------------------------------- planes ---------------------------------------------------*/

static msim_status read_plane(const ms_json_reader *r, const char *path, ms_value value) {
  msim_plane p = {.restitution = 1};
  double *const to[MS_PLANE_KEYS] = {p.normal, &p.offset, &p.restitution, &p.friction};
  msim_status status = ms_json_check_table(r, path, value, ms_plane_keys, MS_PLANE_KEYS);
  for (int i = 0; i < MS_PLANE_KEYS && !status; i++)
    status = ms_json_read_numbers(r, path, value, &ms_plane_keys[i], to[i]);
  if (status) return status;
  status = msim_scene_add_plane(r->scene, &p, r->err);
  return ms_json_forward_error(r, ms_json_member_path(path, "").text, status);
}

static msim_status read_planes(ms_json_reader *r, const char *path, ms_value planes) {
  int32_t n;
  msim_status status = ms_json_read_array_size(r, path, planes, &n);
  for (size_t i = 0; i < ms_value_size(planes) && !status; i++)
    status = read_plane(r, ms_json_item_path(path, i).text, ms_value_item(planes, i));
  return status;
}

static msim_status read_planes_constrain(ms_json_reader *r, const char *path, ms_value value) {
  return ms_json_read_flag(r, ms_json_at(path), value, &r->scene->data->planes_constrain);
}

static msim_status read_self_contact(ms_json_reader *r, const char *path, ms_value section) {
  double thickness = 0, friction = 0;
  const ms_scene_key *keys = ms_self_contact_keys;
  msim_status status = ms_json_check_table(r, path, section, keys, MS_SELF_CONTACT_KEYS);
  if (!status)
    status = ms_json_read_numbers(r, path, section, &keys[MS_KEY_SELF_THICKNESS], &thickness);
  if (!status)
    status = ms_json_read_numbers(r, path, section, &keys[MS_KEY_SELF_FRICTION], &friction);
  if (status) return status;
  return ms_json_forward_error(r, ms_json_member_path(path, "").text,
                               msim_scene_set_self_contact(r->scene, thickness, friction, r->err));
}

/*------------------------------------- run ------------------------------------------------------*/

/* The value in the form that msim_options_set takes; a number is written to *number. */
static const char *option_text(ms_value value, ms_number_text_buffer *number) {
  if (ms_value_text(value)) return ms_value_text(value);
  if (ms_value_is_whole(value))
    snprintf(number->text, sizeof number->text, "%lld", (long long)ms_value_whole(value));
  else *number = ms_text_format_double(ms_value_number(value));
  return number->text;
}

static msim_status check_option_type(const ms_json_reader *r, const char *path, ms_value value,
                                     const msim_option_entry *option, int is_number) {
  const char *word = ms_value_text(value);
  if (is_number ? ms_value_is_number(value) || (word && ms_options_accepts_word(option, word))
                : !!word)
    return MSIM_OK;
  char values[64], must[96];
  ms_options_describe_values(option, sizeof values, values);
  snprintf(must, sizeof must, is_number ? "a %s" : "a string: %s", values);
  return is_number ? ms_json_refuse_number(r, ms_json_at(path), value, must)
                   : ms_json_refuse(r, ms_json_at(path), value, must);
}

static msim_status read_option(const ms_json_reader *r, const char *path, const char *name,
                               ms_value value) {
  if (strcmp(name, "plugin_path") == 0)
    return ms_json_fail(r, MSIM_ERR_ARG,
                        "%s is not allowed in scene files, which must not load code; use "
                        "--plugin_path or MSIM_PLUGIN_PATH",
                        path);
  msim_error inner;
  msim_options scratch;
  ms_number_text_buffer number;
  int is_number;
  const msim_option_entry *option = ms_options_find(name, &is_number);
  msim_status status = option ? check_option_type(r, path, value, option, is_number) : MSIM_OK;
  if (status) return status;
  const char *text = option_text(value, &number);
  msim_options_init(&scratch, sizeof scratch);
  status = msim_options_set(&scratch, name, text, &inner);
  if (status)
    return ms_json_fail(r, status, "%s%s%s", option ? "run." : path, option ? "" : ": ",
                        inner.text);
  return ms_json_forward_error(r, "", ms_scene_add_run_option(r->scene, name, text, r->err));
}

static msim_status read_run(ms_json_reader *r, const char *path, ms_value run) {
  if (!json_is_object(run.json)) return ms_json_refuse(r, ms_json_at(path), run, "an object");
  const char *name;
  json_t *member;
  json_object_foreach(run.json, name, member) {
    const ms_value value = {member, run.columns, 0, 0};
    msim_status status = read_option(r, ms_json_member_path(path, name).text, name, value);
    if (status) return status;
  }
  return MSIM_OK;
}

/*------------------------------------- the whole ------------------------------------------------*/

/* Of the sections, in their order */
static msim_status (*const readers[MS_SECTIONS])(ms_json_reader *r, const char *path,
                                                 ms_value value) = {
    read_version,          read_name,
    read_particles,        ms_json_read_laws,
    ms_json_add_objects,   read_springs,
    ms_json_read_angles,   read_faces,
    read_planes,           read_planes_constrain,
    ms_json_add_colliders, ms_json_read_motions,
    read_self_contact,     read_run};

static msim_status read_root(ms_json_reader *r, ms_value root) {
  const ms_scene_key *sections = ms_section_keys;
  const char *keys[MS_SECTIONS + MS_SCENE_PARAMETERS + 1] = {NULL};
  ms_value version;
  for (int i = 0; i < MS_SECTIONS; i++) keys[i] = sections[i].key;
  for (int i = 0; i < MS_SCENE_PARAMETERS; i++)
    keys[MS_SECTIONS + i] = ms_scene_parameters[i].key.key;
  if (!json_is_object(root.json)) return ms_json_refuse(r, ms_json_at(""), root, "an object");
  /* check the version first: another version may have other keys */
  msim_status status = ms_json_require(r, "", root, sections[MS_KEY_MSIM].key,
                                       "1, the version of the format", &version);
  if (!status) status = read_version(r, sections[MS_KEY_MSIM].key, version);
  if (!status) status = ms_json_check_keys(r, "", root, keys);
  for (int i = 0; i < MS_SCENE_PARAMETERS && !status; i++)
    status = read_parameter(r, &ms_scene_parameters[i], root);
  for (int i = MS_KEY_NAME; i < MS_SECTIONS && !status; i++) {
    ms_value value = ms_value_member(root, sections[i].key);
    if (value.json) status = readers[i](r, sections[i].key, value);
  }
  if (!status) status = ms_json_add_object_springs(r);
  if (!status && r->scene->data->nparticles == 0)
    status = ms_json_fail(r, MSIM_ERR_ARG,
                          "it contains no particles; add some by `particles` or `objects`");
  return status;
}

/* Store the text from which the new scene was read, unless it is not the whole scene: saved in
 * another folder it would refer to no file, or to another one. */
static msim_status store_source(ms_json_reader *r, const char *text, size_t length) {
  ms_scene *s = r->scene->data;
  if (r->has_files) return MSIM_OK;
  s->source = ms_memory_allocate(&s->alloc, length + 1, 1);
  if (!s->source) return ms_json_fail_memory(r);
  memcpy(s->source, text, length);
  return MSIM_OK;
}

msim_status ms_json_build_scene(ms_json_reader *r, ms_value root) {
  msim_status status =
      ms_json_forward_error(r, "", msim_scene_create(&r->alloc, &r->scene, r->err));
  if (status) return status;
  r->scene->data->nends = r->nends;
  status = read_root(r, root);
  for (int32_t i = 0; i < r->nshapes && r->shapes; i++)
    ms_objects_free_shape(&r->alloc, &r->shapes[i]);
  ms_memory_free(&r->alloc, r->shapes);
  if (!status) return MSIM_OK;
  msim_scene_destroy(r->scene);
  r->scene = NULL;
  return status;
}

msim_status msim_scene_parse(const msim_allocator *alloc, const char *label, const char *text,
                             size_t length, msim_scene **scene, msim_error *err) {
  if (scene) *scene = NULL;
  if (!scene || !label || !text)
    return ms_error_set(err, MSIM_ERR_ARG, "scene, label or text is NULL");
  msim_status status = ms_memory_check_allocator(alloc, err);
  if (status) return status;
  ms_json_reader r = {.label = label, .alloc = ms_memory_allocator(alloc), .err = err};
  if (length == 0)
    return ms_json_fail(&r, MSIM_ERR_ARG, "it is empty; it must contain a JSON object");
  json_error_t error;
  errno = 0;
  json_t *root = json_loadb(text, length, JSON_REJECT_DUPLICATES, &error);
  if (!root && errno == ENOMEM)
    return ms_json_fail_memory(&r); /* jansson may call it a syntax error */
  if (!root) return ms_json_syntax_refuse(&r, text, length, &error);
  status = ms_json_build_scene(&r, (ms_value){.json = root});
  json_decref(root);
  if (!status) status = store_source(&r, text, length);
  if (status) {
    msim_scene_destroy(r.scene);
    return status;
  }
  *scene = r.scene;
  return ms_error_clear(err);
}
