/* scene_schema - the format of scene files as a JSON schema, made from the tables of the loader */
#include <stdio.h>
#include <string.h>

#include "scene/laws.h"
#include "scene/options.h"
#include "scene/scene_json_objects.h"

/*------------------------------------- JSON -----------------------------------------------------*/

/* Text is counted, and written as far as there is room. */
typedef struct writer {
  char *to;
  size_t capacity, length;
  int depth;
  int follows; /* 1: an element of the present object or array is written */
} writer;

static void put(writer *w, const char *format, ...) MS_PRINTF(2, 3);
static void put(writer *w, const char *format, ...) {
  const size_t room = w->length < w->capacity ? w->capacity - w->length : 0;
  va_list args;
  va_start(args, format);
  const int more = vsnprintf(room ? w->to + w->length : NULL, room, format, args);
  va_end(args);
  if (more > 0) w->length += (size_t)more;
}

static void put_string(writer *w, const char *text) {
  put(w, "\"");
  for (; *text; text++) put(w, *text == '"' || *text == '\\' ? "\\%c" : "%c", *text);
  put(w, "\"");
}

static void open_bracket(writer *w, const char *bracket) {
  put(w, "%s", bracket);
  w->depth++;
  w->follows = 0;
}

static void close_bracket(writer *w, const char *bracket) {
  put(w, "%s", bracket);
  w->depth--;
  w->follows = 1;
}

/* The start of an element of an array */
static void put_item(writer *w) {
  if (w->follows) put(w, ", ");
  w->follows = 1;
}

/* The start of a line with an element of an object */
static void put_line(writer *w) {
  put(w, "%s\n%*s", w->follows ? "," : "", 2 * w->depth, "");
  w->follows = 1;
}

static void put_key(writer *w, const char *key) {
  put_line(w);
  put_string(w, key);
  put(w, ": ");
}

static void put_text_member(writer *w, const char *key, const char *text) {
  put_key(w, key);
  put_string(w, text);
}

static void put_member(writer *w, const char *key, const char *json) {
  put_key(w, key);
  put(w, "%s", json);
}

static void open_member(writer *w, const char *key, const char *bracket) {
  put_key(w, key);
  open_bracket(w, bracket);
}

/*------------------------------------- forms of values ------------------------------------------*/

static const char index_schema[] = "\"type\": \"integer\", \"minimum\": 0";

static const char *number_schema(ms_range range) {
  static const char *const schemas[] = {
      [MS_ANY] = "\"type\": \"number\"",
      [MS_NOT_NEGATIVE] = "\"type\": \"number\", \"minimum\": 0",
      [MS_POSITIVE] = "\"type\": \"number\", \"exclusiveMinimum\": 0",
      [MS_FRACTION] = "\"type\": \"number\", \"minimum\": 0, \"maximum\": 1",
      [MS_POSITIVE_INTEGER] = "\"type\": \"integer\", \"minimum\": 1, \"maximum\": 2147483647",
      [MS_INDEX] = "\"type\": \"integer\", \"minimum\": 0, \"maximum\": 2147483647"};
  return schemas[range];
}

/* `each`: the schema of the elements; n = 0: of any length */
static void put_array(writer *w, const char *each, int32_t n) {
  put(w, "\"type\": \"array\", \"items\": {%s}", each);
  if (n) put(w, ", \"minItems\": %d, \"maxItems\": %d", n, n);
}

static void put_rows(writer *w, const char *each, int32_t n) {
  put(w, "\"type\": \"array\", \"items\": {");
  put_array(w, each, n);
  put(w, "}");
}

static void put_row_lists(writer *w, const char *each, int32_t n) {
  put(w, "\"type\": \"array\", \"items\": {");
  put_rows(w, each, n);
  put(w, "}");
}

static void put_particle_names(writer *w, const char *separator, const char *quote) {
  const char *name;
  for (int32_t i = 0; (name = ms_json_objects_particle_name(i)) != NULL; i++)
    put(w, "%s%s%s%s", i ? separator : "", quote, name, quote);
}

static void put_named_indices(writer *w) {
  put(w, "\"anyOf\": [{\"enum\": [");
  put_particle_names(w, ", ", "\"");
  put(w, "]}, {\"type\": \"array\", \"items\": {\"anyOf\": [{%s}, {\"enum\": [", index_schema);
  put_particle_names(w, ", ", "\"");
  put(w, "]}]}}]");
}

/* Name i of the types of objects, colliders or laws; NULL past the end. Callbacks have no form in
 * scene files. */
static const char *type_name(ms_key_form form, int32_t i) {
  if (form == MS_LAW_TYPE) return i < MSIM_LAW_CALLBACK ? ms_laws_kind_name(i) : NULL;
  const ms_object_type *object = form == MS_TYPE ? ms_objects_get_type(i) : NULL;
  const ms_collider_type *collider =
      form == MS_TYPE ? NULL : ms_colliders_get_type(MSIM_COLLIDER_SPHERE + i);
  return object ? object->name : collider ? collider->name : NULL;
}

static void put_type_names(writer *w, ms_key_form form, const char *separator, const char *quote) {
  const char *name;
  for (int32_t i = 0; (name = type_name(form, i)) != NULL; i++)
    put(w, "%s%s%s%s", i ? separator : "", quote, name, quote);
}

/* A number, or an object of numbers, or a flag */
static void put_alternatives(writer *w, const ms_object_member *m) {
  const char *each = number_schema(m->key.range);
  if (m->key.form == MS_FLAG_OR_NUMBER) {
    put(w, "\"anyOf\": [{\"type\": \"boolean\"}, {%s}]", each);
    return;
  }
  put(w, "\"anyOf\": [{%s}, {\"type\": \"object\", \"additionalProperties\": false, ", each);
  put(w, "\"properties\": {");
  for (int32_t i = 0; i < m->key.count; i++)
    put(w, "%s\"%s\": {%s}", i ? ", " : "", m->parts[i], each);
  put(w, "}}]");
}

static const char *const json_types[] = {
    [MS_FLAG] = "boolean", [MS_TEXT] = "string", [MS_SECTION] = "object", [MS_LIST] = "array"};

/* The members of a key's schema that restrict its value; of sections and lists, its type alone */
static void put_form(writer *w, const ms_scene_key *key, const ms_object_member *m) {
  const char *number = number_schema(key->range);
  put_line(w);
  switch (key->form) {
    case MS_NUMBERS:
      if (key->count == 1) put(w, "%s", number);
      else put_array(w, number, key->count);
      break;
    case MS_NUMBER_EACH:
      put(w, "\"anyOf\": [{%s}, {", number);
      put_array(w, number, 0);
      put(w, "}]");
      break;
    case MS_ROWS:
      put_rows(w, number, key->count);
      break;
    case MS_ROW_LISTS:
      put_row_lists(w, number, key->count);
      break;
    case MS_NUMBER_LIST:
    case MS_INDICES:
      put_array(w, key->form == MS_INDICES ? index_schema : number, 0);
      break;
    case MS_NAMED_INDICES:
      put_named_indices(w);
      break;
    case MS_INDEX_ROWS:
      put_rows(w, index_schema, key->count);
      break;
    case MS_NUMBER_OR_PARTS:
    case MS_FLAG_OR_NUMBER:
      if (m) put_alternatives(w, m); /* of members of objects only */
      break;
    case MS_VERSION:
      put(w, "\"const\": 1");
      break;
    case MS_TYPE:
    case MS_LAW_TYPE:
    case MS_COLLIDER_TYPE:
      put(w, "\"enum\": [");
      put_type_names(w, key->form, ", ", "\"");
      put(w, "]");
      break;
    case MS_FLAG:
    case MS_TEXT:
    case MS_SECTION:
    case MS_LIST:
      put(w, "\"type\": \"%s\"", json_types[key->form]);
  }
}

/* The same in words */
static void put_values(writer *w, const ms_scene_key *key, const ms_object_member *m) {
  static const char *const words[] = {
      [MS_INDICES] = "an array of indices",
      [MS_ROW_LISTS] = "for each t an array of arrays of 3, each a finite number",
      [MS_NAMED_INDICES] = "an array of indices and names, or a name: ",
      [MS_TEXT] = "a string",
      [MS_VERSION] = "1",
      [MS_TYPE] = "",
      [MS_LAW_TYPE] = "",
      [MS_COLLIDER_TYPE] = "",
      [MS_FLAG] = "true or false",
      [MS_SECTION] = "an object",
      [MS_LIST] = "an array of objects"};
  const char *range = ms_range_text(key->range);
  put_key(w, "values");
  put(w, "\"");
  if (key->form == MS_NUMBERS && key->count == 1) put(w, "%s", range);
  else if (key->form == MS_NUMBERS) put(w, "an array of %d, each %s", key->count, range);
  else if (key->form == MS_ROWS) put(w, "an array of arrays of %d, each %s", key->count, range);
  else if (key->form == MS_NUMBER_EACH) put(w, "%s for all, or an array of one for each", range);
  else if (key->form == MS_NUMBER_LIST) put(w, "an array, each %s", range);
  else if (key->form == MS_INDEX_ROWS) put(w, "an array of arrays of %d indices", key->count);
  else if (key->form == MS_NUMBER_OR_PARTS)
    put(w, "%s for all, or an object with %s, %s and %s", range, m->parts[0], m->parts[1],
        m->parts[2]);
  else if (key->form == MS_FLAG_OR_NUMBER) put(w, "true, false or %s", range);
  else put(w, "%s", words[key->form]);
  if (key->form == MS_NAMED_INDICES) put_particle_names(w, ", ", "");
  if (key->form == MS_TYPE || key->form == MS_LAW_TYPE || key->form == MS_COLLIDER_TYPE)
    put_type_names(w, key->form, " | ", "");
  put(w, "\"");
}

/*------------------------------------- keys -----------------------------------------------------*/

/* Begins the schema of a key; m: the member that the key belongs to, or NULL. */
static void open_key(writer *w, const ms_scene_key *key, const ms_object_member *m) {
  open_member(w, key->key, "{");
  put_text_member(w, "description", key->doc);
  put_values(w, key, m);
  if (*key->unit) put_text_member(w, "unit", key->unit);
  put_form(w, key, m);
  if (key->preset && *key->preset) put_member(w, "default", key->preset);
  put_key(w, "examples");
  put(w, "[%s]", key->example);
}

static void put_scene_key(writer *w, const ms_scene_key *key) {
  open_key(w, key, NULL);
  close_bracket(w, "}");
}

static void put_required(writer *w, const ms_scene_key *key) {
  if (key->preset) return;
  put_item(w);
  put_string(w, key->key);
}

/* The members of the schema of an object with the keys of a table */
static void put_section(writer *w, const ms_scene_key *keys, int32_t n) {
  put_member(w, "additionalProperties", "false");
  open_member(w, "required", "[");
  for (int32_t i = 0; i < n; i++) put_required(w, &keys[i]);
  close_bracket(w, "]");
  open_member(w, "properties", "{");
  for (int32_t i = 0; i < n; i++) put_scene_key(w, &keys[i]);
  close_bracket(w, "}");
}

/*------------------------------------- objects --------------------------------------------------*/

static void put_object_type(writer *w, const ms_object_type *type) {
  put_item(w);
  open_bracket(w, "{");
  put_text_member(w, "title", type->name);
  put_text_member(w, "description", type->doc);
  put_member(w, "additionalProperties", "false");
  open_member(w, "required", "[");
  put_required(w, &ms_type_key);
  for (int32_t i = 0; i < type->nmembers; i++) put_required(w, &type->members[i].key);
  close_bracket(w, "]");
  open_member(w, "properties", "{");
  put_key(w, ms_type_key.key);
  put(w, "{\"const\": \"%s\"}", type->name);
  for (int32_t i = 0; i < type->nmembers; i++) {
    open_key(w, &type->members[i].key, &type->members[i]);
    close_bracket(w, "}");
  }
  put_scene_key(w, type->pinned);
  close_bracket(w, "}");
  close_bracket(w, "}");
}

/* The schema of objects of several types, as far as the list of types, which the caller closes.
 * Editors show the types of `properties`, validators check that one of the types fits. */
static void put_typed_object(writer *w, const ms_scene_key *type_key) {
  put_member(w, "type", "\"object\"");
  open_member(w, "required", "[");
  put_required(w, type_key);
  close_bracket(w, "]");
  open_member(w, "properties", "{");
  put_scene_key(w, type_key);
  close_bracket(w, "}");
  open_member(w, "oneOf", "[");
}

static void put_objects(writer *w) {
  const ms_object_type *type;
  put_typed_object(w, &ms_type_key);
  for (int32_t i = 0; (type = ms_objects_get_type(i)) != NULL; i++) put_object_type(w, type);
  close_bracket(w, "]");
}

/*------------------------------------- colliders ------------------------------------------------*/

static void put_collider_type(writer *w, int32_t type) {
  put_item(w);
  open_bracket(w, "{");
  put_text_member(w, "title", ms_colliders_get_type(type)->name);
  put_text_member(w, "description", ms_colliders_get_type(type)->doc);
  put_member(w, "additionalProperties", "false");
  open_member(w, "required", "[");
  put_required(w, &ms_collider_type_key);
  for (int i = 0; i < MS_COLLIDER_MEMBERS; i++)
    if (ms_colliders_type_has(type, &ms_collider_members[i]))
      put_required(w, &ms_collider_members[i].key);
  if (ms_colliders_get_count_key(type)) {
    put_required(w, ms_colliders_get_count_key(type));
    put_required(w, ms_colliders_get_values_key(type));
  }
  close_bracket(w, "]");
  open_member(w, "properties", "{");
  put_key(w, ms_collider_type_key.key);
  put(w, "{\"const\": \"%s\"}", ms_colliders_get_type(type)->name);
  for (int i = 0; i < MS_COLLIDER_MEMBERS; i++)
    if (ms_colliders_type_has(type, &ms_collider_members[i]))
      put_scene_key(w, &ms_collider_members[i].key);
  if (ms_colliders_get_count_key(type)) {
    put_scene_key(w, ms_colliders_get_count_key(type));
    put_scene_key(w, ms_colliders_get_values_key(type));
  }
  put_scene_key(w, &ms_collider_inside_key);
  open_key(w, &ms_collider_motion_key, NULL);
  put_section(w, ms_collider_motion_keys, MS_COLLIDER_MOTION_KEYS);
  close_bracket(w, "}");
  close_bracket(w, "}");
  close_bracket(w, "}");
}

static void put_colliders(writer *w) {
  put_typed_object(w, &ms_collider_type_key);
  for (int32_t t = MSIM_COLLIDER_SPHERE; ms_colliders_get_type(t); t++) put_collider_type(w, t);
  close_bracket(w, "]");
}

/*------------------------------------- options of the run ---------------------------------------*/

/* The words of "a | b" from the n-th on, as an enum */
static void put_words(writer *w, const char *values, int32_t n) {
  put(w, "\"enum\": [");
  for (int32_t i = 0; values; i++) {
    const char *bar = strstr(values, " | ");
    const size_t length = bar ? (size_t)(bar - values) : strlen(values);
    if (i >= n) put(w, "%s\"%.*s\"", i > n ? ", " : "", (int)length, values);
    values = bar ? bar + 3 : NULL;
  }
  put(w, "]");
}

static void put_option_form(writer *w, const char *words, const ms_option_values *values) {
  put_line(w);
  const int has_words = values->is_number && strstr(words, " | ");
  if (has_words) put(w, "\"anyOf\": [{");
  if (values->is_number)
    put(w, "\"type\": \"%s\", \"%s\": %g", values->is_whole ? "integer" : "number",
        values->open ? "exclusiveMinimum" : "minimum", values->least);
  else if (values->is_choice) put_words(w, words, 0);
  else put(w, "\"type\": \"string\", \"minLength\": 1");
  if (!has_words) return;
  put(w, "}, {");
  put_words(w, words, 1);
  put(w, "}]");
}

static void put_option(writer *w, int32_t i) {
  const msim_option_entry *entry = msim_option_info(i);
  const char *quote;
  ms_option_values values;
  ms_options_get_values(i, &values);
  quote = values.is_number ? "" : "\"";
  open_member(w, entry->name, "{");
  put_text_member(w, "description", entry->doc);
  put_text_member(w, "values", entry->values);
  put_option_form(w, entry->values, &values);
  if (*entry->preset) {
    put_key(w, "default");
    put(w, "%s%s%s", quote, entry->preset, quote);
  }
  put_key(w, "examples");
  if (values.example) put(w, "[%s]", values.example);
  else put(w, "[%s%s%s]", quote, entry->preset, quote);
  close_bracket(w, "}");
}

/* All but plugin_path: scene files must not load code. */
static void put_options(writer *w) {
  const msim_option_entry *entry;
  put_member(w, "additionalProperties", "false");
  open_member(w, "properties", "{");
  for (int32_t i = 0; (entry = msim_option_info(i)) != NULL; i++)
    if (strcmp(entry->name, "plugin_path") != 0) put_option(w, i);
  close_bracket(w, "}");
}

/*------------------------------------- the whole ------------------------------------------------*/

/* The elements of a list, objects with these keys */
static void put_items(writer *w, const ms_scene_key *keys, int32_t n) {
  open_member(w, "items", "{");
  put_member(w, "type", "\"object\"");
  put_section(w, keys, n);
  close_bracket(w, "}");
}

static void put_section_key(writer *w, int i) {
  open_key(w, &ms_section_keys[i], NULL);
  if (i == MS_KEY_PARTICLES) put_section(w, ms_particle_keys, MS_PARTICLE_KEYS);
  if (i == MS_KEY_SPRINGS) put_section(w, ms_spring_keys, MS_SPRING_KEYS);
  if (i == MS_KEY_ANGLES) put_section(w, ms_angle_keys, MS_ANGLE_KEYS);
  if (i == MS_KEY_LAWS) put_items(w, ms_law_keys, MS_LAW_KEYS);
  if (i == MS_KEY_PLANES) put_items(w, ms_plane_keys, MS_PLANE_KEYS);
  if (i == MS_KEY_SELF_CONTACT) put_section(w, ms_self_contact_keys, MS_SELF_CONTACT_KEYS);
  if (i == MS_KEY_MOTIONS) put_items(w, ms_motion_keys, MS_MOTION_KEYS);
  if (i == MS_KEY_RUN) put_options(w);
  if (i == MS_KEY_OBJECTS || i == MS_KEY_COLLIDERS) {
    open_member(w, "items", "{");
    if (i == MS_KEY_OBJECTS) put_objects(w);
    else put_colliders(w);
    close_bracket(w, "}");
  }
  close_bracket(w, "}");
}

size_t msim_scene_schema(char *to, size_t capacity) {
  writer w = {.to = to, .capacity = capacity};
  open_bracket(&w, "{");
  put_member(&w, "$schema", "\"https://json-schema.org/draft/2020-12/schema\"");
  put_text_member(&w, "title", "msim scene");
  put_text_member(&w, "description",
                  "A mass-spring system and the options of its run. Units are SI, indices count "
                  "from 0.");
  put_member(&w, "type", "\"object\"");
  put_member(&w, "additionalProperties", "false");
  open_member(&w, "required", "[");
  for (int i = 0; i < MS_SECTIONS; i++) put_required(&w, &ms_section_keys[i]);
  close_bracket(&w, "]");
  put_member(&w, "anyOf", "[{\"required\": [\"particles\"]}, {\"required\": [\"objects\"]}]");
  open_member(&w, "properties", "{");
  for (int i = 0; i < MS_SECTIONS; i++) {
    put_section_key(&w, i);
    for (int p = 0; i == MS_KEY_NAME && p < MS_SCENE_PARAMETERS; p++)
      put_scene_key(&w, &ms_scene_parameters[p].key);
  }
  close_bracket(&w, "}");
  close_bracket(&w, "}\n");
  return w.length;
}
