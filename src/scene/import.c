#include "scene/import.h"

#include <stdio.h>

#include "scene/import_part.h"
#include "scene/scene_json.h"

/*------------------------------------- the tree -------------------------------------------------*/

/* A list with the members 0, 1, 2, ... of a group; NULL: these are not its members. */
static json_t *group_to_list(json_t *group) {
  const size_t n = json_object_size(group);
  json_t *list = n ? json_array() : NULL;
  for (size_t i = 0; i < n && list; i++) {
    char key[24];
    snprintf(key, sizeof key, "%zu", i);
    if (json_array_append(list, json_object_get(group, key)) == 0) continue;
    json_decref(list);
    list = NULL;
  }
  return list;
}

static json_t *convert_group(ms_import_nodes *in, json_t *group);

/* A member in its JSON form: texts as strings, groups with members 0, 1, 2, ... as lists. */
static json_t *convert_member(ms_import_nodes *in, const char *key, json_t *member) {
  if (json_is_object(member)) return convert_group(in, json_incref(member));
  const ms_column *c = &in->columns[json_integer_value(member)];
  if (c->kind != MSIM_NODE_TEXT) return json_incref(member);
  ms_import_nodes_check_utf8(in, key, c->data);
  return in->status ? NULL : json_string_nocheck(c->data);
}

/* Convert a group, whose reference it takes. The recursion is limited by MOST_LENGTH / 2 levels of
 * a path. NULL: a text is not valid UTF-8, or memory is exhausted. */
static json_t *convert_group(ms_import_nodes *in, json_t *group) {
  const char *key;
  json_t *member;
  json_object_foreach(group, key, member) {
    if (json_object_set_new(group, key, convert_member(in, key, member)) == 0) continue;
    json_decref(group);
    return NULL;
  }
  json_t *list = group_to_list(group);
  if (!list) return group;
  json_decref(group);
  return list;
}

/*------------------------------------- the whole ------------------------------------------------*/

/* part: the rank whose rows are to be read; NULL: all of them */
static msim_status load_scene(ms_import_nodes *in, const msim_importer *table, const char *path,
                              ms_scene_part *part) {
  msim_status status = ms_import_nodes_load(in, table, path);
  if (status) return status;
  if (!json_object_get(in->root, "msim") && json_object_get(in->root, "vertices"))
    return ms_json_fail(&in->reader, MSIM_ERR_ARG,
                        "it is a mesh, not a scene; an object of type \"mesh\" in a scene refers "
                        "to it by `file`");
  in->root = convert_group(in, in->root);
  if (!in->root) return in->status ? in->status : ms_import_nodes_fail_memory(in);
  const int is_part = part && ms_import_part_select(in, part);
  status = ms_json_build_scene(&in->reader, (ms_value){.json = in->root, .columns = in->columns});
  if (!in->failure.status) {
    if (!status && is_part) status = ms_import_part_detach(in->reader.scene, part, in->reader.err);
    if (status) msim_scene_destroy(in->reader.scene);
    return status;
  }
  if (!status) msim_scene_destroy(in->reader.scene);
  return ms_error_set(in->reader.err, in->failure.status, "%s", in->failure.text);
}

static msim_status import_scene(const msim_allocator *alloc, const msim_importer *table,
                                const char *path, ms_scene_part *part, msim_scene **scene,
                                msim_error *err) {
  ms_import_nodes in = {.reader = {.label = path, .alloc = ms_memory_allocator(alloc), .err = err},
                        .in_parts = 1};
  const msim_status status = load_scene(&in, table, path, part);
  ms_import_nodes_free(&in);
  if (status) return status;
  *scene = in.reader.scene;
  return ms_error_clear(err);
}

msim_status ms_import_scene(const msim_allocator *alloc, const msim_importer *table,
                            const char *path, msim_scene **scene, msim_error *err) {
  return import_scene(alloc, table, path, NULL, scene, err);
}

/* Errors number the rows of a part, so that those in the file are named by reading all of it. */
msim_status ms_import_scene_part(const msim_allocator *alloc, const msim_importer *table,
                                 const char *path, int32_t rank, int32_t nranks, msim_scene **scene,
                                 msim_error *err) {
  ms_scene_part part = {.rank = rank, .nranks = nranks};
  msim_error of_whole;
  const msim_status status = import_scene(alloc, table, path, &part, scene, err);
  if (status != MSIM_ERR_ARG) return status;
  const msim_status again = import_scene(alloc, table, path, NULL, scene, &of_whole);
  if (!again) msim_scene_destroy(*scene), *scene = NULL;
  return again == status ? ms_error_set(err, status, "%s", of_whole.text) : status;
}
