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
} walk;

static const char *text_member(const json_t *schema, const char *key) {
  const char *text = json_string_value(json_object_get(schema, key));
  return text ? text : "";
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

static int visit_key(const walk *w, const char *path, const char *name, const json_t *object,
                     const json_t *schema) {
  char *preset = dump(json_object_get(schema, "default"));
  char *example = dump(json_array_get(json_object_get(schema, "examples"), 0));
  const scene_key key = {.path = path,
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

static int visit_members(const walk *w, const char *path, const json_t *object);

/* The keys of an object, or of the objects of an array, which may be of several types */
static int visit_inside(const walk *w, const char *path, const json_t *schema) {
  char inner[128];
  size_t i;
  const json_t *items = json_object_get(schema, "items"), *type;
  snprintf(inner, sizeof inner, "%s.", path);
  int status = visit_members(w, inner, schema);
  snprintf(inner, sizeof inner, "%s[].", path);
  if (!status) status = visit_members(w, inner, items);
  json_array_foreach(json_object_get(items, "oneOf"), i, type) {
    snprintf(inner, sizeof inner, "%s[%s].", path, text_member(type, "title"));
    if (!status) status = visit_members(w, inner, type);
  }
  return status;
}

static int visit_members(const walk *w, const char *path, const json_t *object) {
  const char *name;
  json_t *schema;
  int status = EXIT_OK;
  json_object_foreach(json_object_get(object, "properties"), name, schema) {
    char inner[96];
    if (!json_object_get(schema, "description")) continue; /* the type of an object, again */
    snprintf(inner, sizeof inner, "%s%s", path, name);
    if (!status) status = visit_key(w, inner, name, object, schema);
    if (!status) status = visit_inside(w, inner, schema);
  }
  return status;
}

int scene_help_visit(scene_key_visitor *visit, void *user) {
  const walk w = {visit, user};
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
      "count from 0. objects[rope].n is a key of an object of type rope. An example\n"
      "follows each description.\n");
  return scene_help_visit(scene_help_print_key, NULL);
}
