#define _POSIX_C_SOURCE 200809L /* strdup */
#include "scene_help.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../common/message.h"
#include "help.h"

/*------------------------------------- the schema -----------------------------------------------*/

/* To be freed by the caller; NULL: no memory. */
static char *schema_text(void) {
  const size_t size = msim_scene_schema(NULL, 0) + 1;
  char *text = malloc(size);
  if (text) msim_scene_schema(text, size);
  return text;
}

int scene_help_print_schema(void) {
  char *text = schema_text();
  if (!text) return report_error("out of memory for the schema of scenes");
  fputs(text, stdout);
  free(text);
  return EXIT_OK;
}

/*------------------------------------- visits ---------------------------------------------------*/

typedef struct walk {
  scene_key_visitor *visit;
  void *user;
  char path[160]; /* of the present key; enough for all keys of the format */
} walk;

static const char *text_member(const json_t *schema, const char *key) {
  const char *text = json_string_value(json_object_get(schema, key));
  return text ? text : "";
}

static void append(char *text, size_t size, const char *more) {
  const size_t length = strlen(text);
  snprintf(text + length, size - length, "%s", more);
}

static int is_required(const json_t *object, const char *name) {
  size_t i;
  const json_t *item;
  json_array_foreach(json_object_get(object, "required"), i, item) {
    if (strcmp(json_string_value(item), name) == 0) return 1;
  }
  return 0;
}

/* A value as JSON; "" if it is NULL. To be freed by the caller. */
static char *dump(const json_t *value) {
  return value ? json_dumps(value, JSON_ENCODE_ANY | JSON_REAL_PRECISION(15)) : strdup("");
}

static const json_t *find_property(const json_t *object, const char *name) {
  return json_object_get(json_object_get(object, "properties"), name);
}

static int visit_key(const walk *w, const char *name, const json_t *object) {
  const json_t *schema = find_property(object, name);
  char *preset = dump(json_object_get(schema, "default"));
  char *example = dump(json_array_get(json_object_get(schema, "examples"), 0));
  const scene_key key = {.path = w->path,
                         .name = name,
                         .doc = text_member(schema, "description"),
                         .unit = text_member(schema, "unit"),
                         .values = text_member(schema, "values"),
                         .preset = preset,
                         .example = example,
                         .required = is_required(object, name)};
  const int status = preset && example ? w->visit(&key, w->user) : report_error("out of memory");
  free(preset);
  free(example);
  return status;
}

static int visit_member(walk *w, const char *name, const json_t *object);

static int visit_members(walk *w, const char *separator, const json_t *object) {
  const size_t length = strlen(w->path);
  const char *name;
  json_t *schema;
  int status = EXIT_OK;
  append(w->path, sizeof w->path, separator);
  json_object_foreach(json_object_get(object, "properties"), name, schema) {
    if (!status) status = visit_member(w, name, object);
  }
  w->path[length] = '\0';
  return status;
}

/* Appends "[sphere, capsule].", the types in which a key is the same as in type `first`, or "[]."
 * for all types. Returns 0 if an earlier type has the same key. */
static int append_types(walk *w, const json_t *types, size_t first, const char *name) {
  const size_t length = strlen(w->path);
  const json_t *schema = find_property(json_array_get(types, first), name), *type;
  size_t i, same = 0;
  json_array_foreach(types, i, type) {
    if (!json_equal(find_property(type, name), schema)) continue;
    if (i < first) return 0;
    append(w->path, sizeof w->path, same++ ? ", " : "[");
    append(w->path, sizeof w->path, text_member(type, "title"));
  }
  if (same == json_array_size(types)) w->path[length + 1] = '\0';
  append(w->path, sizeof w->path, "].");
  return 1;
}

/* The keys of objects of several types; a key that several types share, once */
static int visit_types(walk *w, const json_t *types) {
  const size_t length = strlen(w->path);
  size_t i;
  const json_t *type;
  int status = EXIT_OK;
  json_array_foreach(types, i, type) {
    const char *name;
    json_t *schema;
    json_object_foreach(json_object_get(type, "properties"), name, schema) {
      if (!status && append_types(w, types, i, name)) status = visit_member(w, name, type);
      w->path[length] = '\0';
    }
  }
  return status;
}

/* A key, and those of the object, or of the objects of the array, that is its value */
static int visit_member(walk *w, const char *name, const json_t *object) {
  const size_t length = strlen(w->path);
  const json_t *schema = find_property(object, name), *items = json_object_get(schema, "items");
  if (!json_object_get(schema, "description")) return EXIT_OK; /* the type of an object, again */
  append(w->path, sizeof w->path, name);
  int status = visit_key(w, name, object);
  if (!status) status = visit_members(w, ".", schema);
  if (!status) status = visit_members(w, "[].", items);
  if (!status) status = visit_types(w, json_object_get(items, "oneOf"));
  w->path[length] = '\0';
  return status;
}

int scene_help_visit(scene_key_visitor *visit, void *user) {
  walk w = {visit, user, ""};
  char *text = schema_text();
  json_t *schema = text ? json_loads(text, 0, NULL) : NULL;
  const int status =
      schema ? visit_members(&w, "", schema) : report_error("out of memory for the schema");
  json_decref(schema);
  free(text);
  return status;
}

/*------------------------------------- text -----------------------------------------------------*/

void scene_help_describe(const scene_key *key, char *text, size_t size) {
  const char *otherwise = key->required ? "; required" : *key->preset ? "; default " : "";
  snprintf(text, size, "%s (%s%s%s%s%s)", key->doc, key->unit, *key->unit ? "; " : "", key->values,
           otherwise, key->required ? "" : key->preset);
}

int scene_help_print_key(const scene_key *key, void *user) {
  char text[1024];
  (void)user;
  scene_help_describe(key, text, sizeof text);
  print_column(HELP_COLUMN, key->path);
  print_wrapped(HELP_COLUMN, text);
  snprintf(text, sizeof text, "\"%s\": %s", key->name, key->example);
  print_column(HELP_COLUMN, "");
  print_wrapped(HELP_COLUMN, text);
  return EXIT_OK;
}

int scene_help_print(void) {
  puts(
      "A scene file is JSON, or HDF5 (*.h5) with the same tree. Units are SI, indices\n"
      "count from 0. objects[rope].n is a key of an object of type rope, objects[].mass\n"
      "one of each type. An example follows each description.\n");
  return scene_help_visit(scene_help_print_key, NULL);
}
