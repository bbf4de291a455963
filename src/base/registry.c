#include "base/registry.h"

#include <stdio.h>
#include <string.h>

#include "base/suggest.h"

/*------------------------------------- tables ---------------------------------------------------*/

/* The members at the beginning of every table. */
typedef struct table_head {
  uint32_t abi, size;
  const char *name;
} table_head;

/* The pointer at an offset of a table or a list; a function's address is never NULL either. */
static const void *pointer_at(const void *base, size_t offset) {
  const void *pointer;
  memcpy(&pointer, (const char *)base + offset, sizeof pointer);
  return pointer;
}

/* 1: the text at the offset is this word, or several of which it is one. */
static int has_word(const void *table, size_t offset, const char *word) {
  const char *own = pointer_at(table, offset);
  while (own && *own) {
    const size_t length = strcspn(own, " ");
    if (length == strlen(word) && strncmp(own, word, length) == 0) return 1;
    own += length + (own[length] == ' ');
  }
  return 0;
}

/* Nullable: name. */
static msim_status check_table(const ms_registry *r, const char *name, const void *table,
                               const char *file, msim_error *err) {
  table_head head;
  memcpy(&head, table, sizeof head);
  if (head.abi != r->abi)
    return ms_error_set(err, MSIM_ERR_ABI,
                        "%s was built for %s ABI %u, but msim %s has ABI %u; rebuild it", file,
                        r->kind, head.abi, msim_version(), r->abi);
  if (head.size < r->least_size)
    return ms_error_set(
        err, MSIM_ERR_ABI,
        "%s has a function table of %u bytes, but at least %zu are required; rebuild it", file,
        head.size, r->least_size);
  if (name && strcmp(head.name ? head.name : "", name) != 0)
    return ms_error_set(err, MSIM_ERR_PLUGIN,
                        "%s contains plugin '%s', not '%s'; the name in its function table must be "
                        "that of the file",
                        file, head.name ? head.name : "", name);
  for (const ms_registry_member *m = r->required; m->name; m++)
    if (!pointer_at(table, m->offset))
      return ms_error_set(err, MSIM_ERR_PLUGIN, "the function table of %s lacks `%s`", file,
                          m->name);
  return r->check ? r->check(table, file, err) : MSIM_OK;
}

/*------------------------------------- search ---------------------------------------------------*/

static const char *known_name(int32_t i, const void *registry) {
  return ((const ms_registry *)registry)->known[i].name;
}

/* The known plugin with this text at the offset; NULL: none. */
static const ms_registry_plugin *find_known(const ms_registry *r, size_t offset, const char *text) {
  for (const ms_registry_plugin *known = r->known; known->name; known++)
    if (has_word(known, offset, text)) return known;
  return NULL;
}

/* The first table with this text at the offset, of the program or linked in; NULL: none. */
static const void *search_tables(const ms_registry *r, const void *own, size_t offset,
                                 const char *text) {
  const void *table;
  for (size_t i = 0; own && (table = pointer_at(own, i * sizeof table)) != NULL; i++)
    if (has_word(table, offset, text)) return table;
  for (int32_t i = 0; (table = r->linked(i)) != NULL; i++)
    if (has_word(table, offset, text)) return table;
  return NULL;
}

/* "; or install ...": where to get a plugin of msim whose file is missing; "" for others */
typedef struct remedy {
  char text[256];
} remedy;

static remedy describe_packages(const ms_registry_plugin *known) {
  remedy r = {""};
  if (!known || !known->plugin) return r;
  snprintf(r.text, sizeof r.text,
           "; or install its package, libmsim0-%s (apt)%s libmsim-%s (conda)%s%s%s, or build msim "
           "after 'apt install %s' or 'conda install %s'",
           known->plugin, known->pip ? "," : " or", known->plugin, known->pip ? " or " : "",
           known->pip ? known->pip : "", known->pip ? " (pip)" : "", known->debian, known->conda);
  return r;
}

static msim_status load_table(const ms_registry *r, const char *name, const char *plugin_path,
                              const void **table, ms_text *where, msim_error *err) {
  void *symbol;
  msim_error why;
  const msim_status status = ms_plugin_open(r->kind, name, plugin_path, &symbol, where, &why);
  const ms_registry_plugin *known = find_known(r, offsetof(ms_registry_plugin, name), name);
  if (status == MSIM_ERR_NAME && !known)
    return ms_error_set(err, status, "unknown %s '%s'%s: %s", r->noun, name,
                        ms_suggest_hint(name, known_name, r).text, why.text);
  if (status)
    return ms_error_set(err, status, "%s '%s': %s%s", r->noun, name, why.text,
                        status == MSIM_ERR_NAME ? describe_packages(known).text : "");
  *table = r->enter(symbol);
  if (*table) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_PLUGIN,
                      "%s: msim_%s_entry() returned NULL; report this to the author of the plugin",
                      where->data, r->kind);
}

typedef struct table_key {
  const char *name, *extension; /* extension NULL: any */
} table_key;

/* By the extension, or by name if that is NULL. where: the plugin's file, empty if the table is not
 * from a plugin. */
static msim_status find_table(const ms_registry *r, table_key key,
                              const ms_registry_sources *sources, const void **table,
                              ms_text *where, msim_error *err) {
  *table = key.extension ? search_tables(r, sources->own, r->extension, key.extension)
                         : search_tables(r, sources->own, offsetof(table_head, name), key.name);
  char label[64];
  snprintf(label, sizeof label, "the %s in this program", r->kind);
  if (*table) return check_table(r, NULL, *table, label, err);
  msim_status status = load_table(r, key.name, sources->plugin_path, table, where, err);
  if (!status) status = check_table(r, key.name, *table, where->data, err);
  if (status || !key.extension || has_word(*table, r->extension, key.extension)) return status;
  return ms_error_set(err, MSIM_ERR_NAME, "%s is for files *%s, not *%s", where->data,
                      (const char *)pointer_at(*table, r->extension), key.extension);
}

/* With the dot; NULL: the last part of the path has none. */
static const char *extension_of(const char *path) {
  const char *dot = strrchr(path, '.');
  return dot && !strchr(dot, '/') ? dot : NULL;
}

/* An extension in lower case: many programs write CUBE.STL. */
typedef struct lower_case {
  char text[16];
} lower_case;

static lower_case to_lower_case(const char *extension) {
  lower_case lower = {""};
  for (size_t i = 0; extension[i] && i + 1 < sizeof lower.text; i++) {
    const char c = extension[i];
    lower.text[i] = (char)(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  }
  return lower;
}

int ms_registry_knows(const ms_registry *r, const char *path) {
  const char *extension = extension_of(path);
  return extension &&
         find_known(r, offsetof(ms_registry_plugin, extension), to_lower_case(extension).text);
}

msim_status ms_registry_find(const ms_registry *r, const char *name,
                             const ms_registry_sources *sources, const void **table,
                             msim_error *err) {
  const char *extension = r->extension ? extension_of(name) : NULL;
  const lower_case lower = to_lower_case(extension ? extension : "");
  const ms_registry_plugin *known =
      extension ? find_known(r, offsetof(ms_registry_plugin, extension), lower.text) : NULL;
  const table_key key = {known       ? known->name
                         : extension ? extension + 1
                                     : name,
                         known ? lower.text : extension};
  ms_text where = {.alloc = sources->alloc};
  *table = NULL;
  if (r->extension && !extension)
    return ms_error_set(err, MSIM_ERR_NAME, "the name has no extension");
  const msim_status status = find_table(r, key, sources, table, &where, err);
  ms_text_free(&where);
  return status;
}

/*------------------------------------- list -----------------------------------------------------*/

static void describe_table(const ms_registry *r, const char *plugin_path, msim_plugin_entry *entry,
                           msim_error *err) {
  const msim_allocator alloc = ms_memory_allocator(NULL);
  const ms_registry_sources sources = {NULL, plugin_path, &alloc};
  const void *table;
  ms_text where = {.alloc = &alloc};
  entry->available =
      find_table(r, (table_key){entry->name, NULL}, &sources, &table, &where, err) == MSIM_OK;
  entry->library = entry->available ? pointer_at(table, r->library) : "";
  entry->license = entry->available ? pointer_at(table, r->license) : "";
  if (entry->available) ms_error_set(err, MSIM_OK, "%s", where.length ? where.data : "built in");
  if (err) entry->note = err->text;
  ms_text_free(&where);
}

int32_t ms_registry_info(const ms_registry *r, int32_t i, const char *plugin_path,
                         msim_plugin_entry *entry, msim_error *err) {
  ms_error_clear(err);
  if (entry->size == 0)
    ms_error_set(err, MSIM_ERR_SIZE, "entry->size is 0; set it to sizeof(msim_plugin_entry)");
  if (entry->size == 0 || i < 0) return 0;
  for (int32_t k = 0; k <= i; k++)
    if (!r->known[k].name) return 0;
  msim_plugin_entry full = {.size = entry->size,
                            .name = r->known[i].name,
                            .library = "msim",
                            .license = "MIT",
                            .note = "",
                            .available = 1};
  if (!r->known[i].has_no_table) describe_table(r, plugin_path, &full, err);
  MS_COPY_SIZED(entry, full);
  return 1;
}
