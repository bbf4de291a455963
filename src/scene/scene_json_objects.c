#include <stdio.h>
#include <string.h>

#include "base/suggest.h"
#include "scene/scene_json_objects.h"

/*------------------------------------- types ----------------------------------------------------*/

static const char *type_name(int32_t i, const void *data) {
  (void)data;
  const ms_object_type *type = ms_objects_get_type(i);
  return type ? type->name : NULL;
}

static msim_status read_type(const ms_json_reader *r, const char *path, ms_value object,
                             const ms_object_type **type) {
  if (!json_is_object(object.json)) return ms_json_refuse(r, ms_json_at(path), object, "an object");
  static const char *const must = "\"rope\", \"cloth\", \"lattice\" or \"mesh\"";
  ms_value value;
  msim_status status = ms_json_require(r, path, object, ms_type_key.key, must, &value);
  if (status) return status;
  const ms_key_path at = ms_json_member_path(path, ms_type_key.key);
  const char *name = ms_value_text(value);
  if (!name) return ms_json_refuse(r, ms_json_at(at.text), value, must);
  for (int32_t i = 0; (*type = ms_objects_get_type(i)) != NULL; i++)
    if (strcmp((*type)->name, name) == 0) return MSIM_OK;
  char hinted[160];
  snprintf(hinted, sizeof hinted, "%s%s", must, ms_suggest_hint(name, type_name, NULL).text);
  return ms_json_refuse(r, ms_json_at(at.text), value, hinted);
}

static msim_status check_keys(const ms_json_reader *r, const char *path, ms_value object,
                              const ms_object_type *type) {
  const char *keys[MS_MAX_MEMBERS + 3] = {ms_type_key.key};
  int32_t n = 1;
  for (int32_t i = 0; i < type->nmembers; i++) keys[n++] = type->members[i].key.key;
  keys[n] = type->pinned->key;
  return ms_json_check_keys(r, path, object, keys);
}

/*------------------------------------- members --------------------------------------------------*/

/* "k": {"shear": 10}; missing parts are 0. */
static msim_status read_parts(const ms_json_reader *r, const char *path, ms_value value,
                              const ms_object_member *m, double *numbers) {
  const char *keys[4] = {m->parts[0], m->parts[1], m->parts[2]};
  msim_status status = ms_json_check_keys(r, path, value, keys);
  for (int32_t i = 0; i < m->key.count && !status; i++) {
    ms_value part = ms_value_member(value, keys[i]);
    const ms_key_path at = ms_json_member_path(path, keys[i]);
    if (part.json)
      status = ms_json_read_number(r, ms_json_at(at.text), part, m->key.range, numbers + i);
  }
  return status;
}

/* One number for all parts, or an object */
static msim_status read_number_or_parts(const ms_json_reader *r, const char *path, ms_value object,
                                        const ms_object_member *m, double *numbers) {
  ms_value value;
  msim_status status = ms_json_require_key(r, path, object, &m->key, &value);
  if (status) return status;
  const ms_key_path at = ms_json_member_path(path, m->key.key);
  if (json_is_object(value.json)) return read_parts(r, at.text, value, m, numbers);
  status = ms_json_read_number(r, ms_json_at(at.text), value, m->key.range, numbers);
  for (int32_t i = 1; i < m->key.count; i++) numbers[i] = numbers[0];
  return status;
}

/* A text, which stays where it is in the tree */
static msim_status read_text(const ms_json_reader *r, const char *path, ms_value object,
                             const ms_object_member *m, ms_object *to) {
  static const char *const must = "the name of a file";
  ms_value value;
  const msim_status status = ms_json_require(r, path, object, m->key.key, must, &value);
  if (status) return status;
  const char *text = ms_value_text(value);
  if (!text || !*text)
    return ms_json_refuse(r, ms_json_at(ms_json_member_path(path, m->key.key).text), value, must);
  memcpy((char *)to + m->offset, &text, sizeof text);
  return MSIM_OK;
}

/* A number, or whether there is one: true stands for that of the member's preset. */
static msim_status read_flag_or_number(const ms_json_reader *r, const char *path, ms_value object,
                                       const ms_object_member *m, double *number) {
  const ms_value value = ms_value_member(object, m->key.key);
  const char *text = ms_value_text(value);
  if (!value.json || json_is_false(value.json)) return MSIM_OK;
  *number = MSIM_FILL_AUTO;
  if (json_is_true(value.json) || (text && strcmp(text, "true") == 0)) return MSIM_OK;
  *number = ms_value_number(value);
  if (ms_value_is_number(value) && ms_range_contains(m->key.range, *number)) return MSIM_OK;
  char must[96];
  snprintf(must, sizeof must, "true, false or %s", ms_range_text(m->key.range));
  return ms_json_refuse_number(r, ms_json_at(ms_json_member_path(path, m->key.key).text), value,
                               must);
}

static msim_status read_object_member(const ms_json_reader *r, const char *path, ms_value object,
                                      const ms_object_member *m, ms_object *to) {
  double numbers[3] = {0, 0, 0};
  if (m->key.form == MS_TEXT) return read_text(r, path, object, m, to);
  const msim_status status =
      m->key.form == MS_NUMBER_OR_PARTS  ? read_number_or_parts(r, path, object, m, numbers)
      : m->key.form == MS_FLAG_OR_NUMBER ? read_flag_or_number(r, path, object, m, numbers)
                                         : ms_json_read_numbers(r, path, object, &m->key, numbers);
  if (status) return status;
  void *member = (char *)to + m->offset;
  if (m->key.range >= MS_POSITIVE_INTEGER)
    for (int32_t i = 0; i < m->key.count; i++) ((int32_t *)member)[i] = (int32_t)numbers[i];
  else memcpy(member, numbers, (size_t)m->key.count * sizeof *numbers);
  return MSIM_OK;
}

/*------------------------------------- pinned ---------------------------------------------------*/

/* Named sets of particles of a cloth: in the first row, or in the first and last row; all of them,
 * or the first and last of each row. */
typedef struct named_particles {
  const char *name;
  int32_t rows;
  int whole;
} named_particles;

static const named_particles names[] = {
    {"corners", 2, 0}, {"first_row", 1, 1}, {"first_corners", 1, 0}};
#define LIST_OF_NAMES "\"corners\", \"first_row\" or \"first_corners\""

const char *ms_json_objects_particle_name(int32_t i) {
  return i < (int32_t)(sizeof names / sizeof *names) ? names[i].name : NULL;
}

static const named_particles *find_name(const ms_object_type *type, ms_value value) {
  if (type->pinned->form != MS_NAMED_INDICES || !ms_value_text(value)) return NULL;
  for (size_t i = 0; i < sizeof names / sizeof *names; i++)
    if (strcmp(names[i].name, ms_value_text(value)) == 0) return &names[i];
  return NULL;
}

static void mark_named(const named_particles *named, const ms_shape *shape, int32_t *is_pinned) {
  const int32_t columns = shape->grid.n[1], last_row = shape->nparticles - columns;
  for (int32_t r = 0; r < named->rows; r++)
    for (int32_t c = 0; c < (named->whole ? columns : 2); c++)
      is_pinned[r * last_row + (named->whole ? c : c * (columns - 1))] = 1;
}

static msim_status mark_item(const ms_json_reader *r, ms_json_location at, ms_value value,
                             const ms_object_type *type, const ms_shape *shape,
                             int32_t *is_pinned) {
  const named_particles *named = find_name(type, value);
  if (named) {
    mark_named(named, shape, is_pinned);
    return MSIM_OK;
  }
  if (ms_value_text(value) && type->pinned->form == MS_NAMED_INDICES)
    return ms_json_refuse(r, at, value, "an index, " LIST_OF_NAMES);
  int32_t p;
  msim_status status = ms_json_read_index(r, at, value, shape->nparticles, &p);
  if (!status) is_pinned[p] = 1;
  return status;
}

/* An array of indices and names, or one name. is_pinned: a flag per particle; becomes the list of
 * the indices of pinned particles. */
static msim_status read_pinned_of_object(const ms_json_reader *r, const char *path, ms_value value,
                                         const ms_object_type *type, ms_shape *shape,
                                         int32_t *is_pinned) {
  msim_status status = MSIM_OK;
  int32_t n;
  if (find_name(type, value))
    status = mark_item(r, ms_json_at(path), value, type, shape, is_pinned);
  else if (!ms_value_is_array(value))
    return ms_json_refuse(r, ms_json_at(path), value,
                          type->pinned->form == MS_NAMED_INDICES
                              ? "an array of indices of particles, " LIST_OF_NAMES
                              : "an array of indices of particles");
  else status = ms_json_read_array_size(r, path, value, &n);
  for (size_t i = 0; i < ms_value_size(value) && !status; i++)
    status =
        mark_item(r, ms_json_at_item(path, i), ms_value_item(value, i), type, shape, is_pinned);
  for (int32_t p = 0; p < shape->nparticles; p++)
    if (is_pinned[p]) is_pinned[shape->npinned++] = p;
  shape->pinned = is_pinned;
  return status;
}

/*------------------------------------- objects --------------------------------------------------*/

static msim_status add_object_particles(const ms_json_reader *r, const char *path, ms_value object,
                                        const ms_object_type *type, ms_shape *shape) {
  const ms_key_path at = ms_json_member_path(path, type->pinned->key);
  ms_value pinned = ms_value_member(object, type->pinned->key);
  int32_t *is_pinned =
      ms_memory_allocate(&r->alloc, pinned.json ? (size_t)shape->nparticles : 0, sizeof *is_pinned);
  if (!is_pinned) return ms_json_fail_memory(r);
  msim_status status =
      pinned.json ? read_pinned_of_object(r, at.text, pinned, type, shape, is_pinned) : MSIM_OK;
  if (!status)
    status = ms_json_forward_error(r, "", ms_objects_add_particles(r->scene, shape, path, r->err));
  ms_memory_free(&r->alloc, is_pinned);
  return status;
}

/* The file of a mesh, its first key, is relative to the folder of the scene file. */
static msim_status make_shape(ms_json_reader *r, const char *path, const ms_object_type *type,
                              ms_object *object, ms_shape *shape) {
  const char *slash = strrchr(r->label, '/'), **file = &object->mesh.file;
  const int has_file = type->members[0].key.form == MS_TEXT;
  ms_text name = {.alloc = &r->alloc};
  if (has_file && slash && **file != '/') {
    ms_text_append(&name, "%.*s/%s", (int)(slash - r->label), r->label, *file);
    if (name.failed) return ms_json_fail_memory(r);
    *file = name.data;
  }
  r->has_files |= has_file;
  const msim_status status = ms_objects_make_shape(&r->alloc, type, object, path, shape, r->err);
  ms_text_free(&name);
  return ms_json_forward_error(r, "", status);
}

static msim_status read_json_object(ms_json_reader *r, const char *path, ms_value value,
                                    ms_shape *shape) {
  const ms_object_type *type;
  msim_status status = read_type(r, path, value, &type);
  if (!status) status = check_keys(r, path, value, type);
  if (status) return status;
  ms_object object = {0};
  object.size = type->size;
  for (int32_t i = 0; i < type->nmembers && !status; i++)
    status = read_object_member(r, path, value, &type->members[i], &object);
  if (status) return status;
  status = make_shape(r, path, type, &object, shape);
  return status ? status : add_object_particles(r, path, value, type, shape);
}

msim_status ms_json_add_objects(ms_json_reader *r, const char *path, ms_value objects) {
  msim_status status = ms_json_read_array_size(r, path, objects, &r->nshapes);
  if (status) return status;
  r->shapes = ms_memory_allocate(&r->alloc, (size_t)r->nshapes, sizeof *r->shapes);
  if (!r->shapes) return ms_json_fail_memory(r);
  for (size_t i = 0; i < (size_t)r->nshapes && !status; i++)
    status = read_json_object(r, ms_json_item_path(path, i).text, ms_value_item(objects, i),
                              &r->shapes[i]);
  return status;
}

msim_status ms_json_add_object_springs(const ms_json_reader *r) {
  msim_status status = MSIM_OK;
  for (int32_t i = 0; i < r->nshapes && !status; i++) {
    status = ms_objects_add_faces(r->scene, &r->shapes[i], r->err);
    if (!status) status = ms_objects_add_springs(r->scene, &r->shapes[i], r->err);
  }
  return ms_json_forward_error(r, "", status);
}
