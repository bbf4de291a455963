#include "linear/registry.h"

#include <string.h>

const char *ms_registry_solver_name(int32_t i, const void *unused) {
  static const char *const names[] = {"auto",
                                      "pcg",
                                      "cholmod",
                                      "klu",
                                      "sundials-pcg",
                                      "sundials-spgmr",
                                      "sundials-spfgmr",
                                      "sundials-spbcgs",
                                      "sundials-sptfqmr"};
  (void)unused;
  return i >= 0 && i < (int32_t)(sizeof names / sizeof *names) ? names[i] : NULL;
}

static int is_known(const char *name) {
  const char *known;
  for (int32_t i = 0; (known = ms_registry_solver_name(i, NULL)) != NULL; i++)
    if (strcmp(known, name) == 0) return 1;
  return 0;
}

static int is_built_in(const char *name) {
  return strcmp(name, "auto") == 0 || strcmp(name, "pcg") == 0;
}

/*------------------------------------- sources of tables ----------------------------------------*/

static const msim_backend *find_own_backend(const char *name, const msim_backend *const *backends) {
  for (; backends && *backends; backends++)
    if ((*backends)->name && strcmp((*backends)->name, name) == 0) return *backends;
  return NULL;
}

/* Static builds define MSIM_LINKED_BACKENDS as the list of their backends: X(cholmod) X(klu) ... */
#define X(name) const msim_backend *msim_backend_##name(void);
MSIM_LINKED_BACKENDS
#undef X

static const msim_backend *linked_in(const char *name) {
  static const msim_backend *(*const entries[])(void) = {
#define X(backend) msim_backend_##backend,
      MSIM_LINKED_BACKENDS
#undef X
          NULL};
  for (size_t i = 0; entries[i]; i++)
    if (strcmp(entries[i]()->name, name) == 0) return entries[i]();
  return NULL;
}

static msim_status load_backend(const char *name, const char *plugin_path,
                                const msim_backend **table, ms_text *where, msim_error *err) {
  void *symbol;
  msim_error why;
  msim_status status = ms_plugin_open("backend", name, plugin_path, &symbol, where, &why);
  if (status == MSIM_ERR_NAME && !is_known(name))
    return ms_error_set(err, status, "unknown solver '%s'%s: %s", name,
                        ms_text_suggest(name, ms_registry_solver_name, NULL).text, why.text);
  if (status) return ms_error_set(err, status, "solver '%s': %s", name, why.text);
  msim_backend_entry_fn *entry;
  memcpy(&entry, &symbol, sizeof entry); /* ISO C has no cast from void * to a function */
  *table = entry();
  if (*table) return MSIM_OK;
  return ms_error_set(
      err, MSIM_ERR_PLUGIN,
      "%s: msim_backend_entry() returned NULL; report this to the author of the plugin",
      where->data);
}

/*------------------------------------- validity of a table --------------------------------------*/

static msim_status check_backend_table(const char *name, const char *file,
                                       const msim_backend *table, msim_error *err) {
  msim_status status = ms_plugin_check("backend", name, file, table->abi, MSIM_BACKEND_ABI,
                                       table->size, MSIM_BACKEND_SIZE_1, table->name, err);
  if (status) return status;
  const ms_plugin_member members[] = {{"library", !table->library}, {"license", !table->license},
                                      {"create", !table->create},   {"analyze", !table->analyze},
                                      {"factor", !table->factor},   {"solve", !table->solve},
                                      {"destroy", !table->destroy}};
  status = ms_plugin_check_members(file, members, sizeof members / sizeof *members, err);
  if (status) return status;
  if (table->format >= MSIM_FORMAT_NONE && table->format <= MSIM_FORMAT_FULL) return MSIM_OK;
  return ms_error_set(
      err, MSIM_ERR_PLUGIN,
      "%s requests the unknown matrix format %d; rebuild it for this version of msim", file,
      table->format);
}

msim_status ms_registry_find_backend(const char *name, const msim_backend *const *backends,
                                     const char *plugin_path, const msim_backend **table,
                                     ms_text *where, msim_error *err) {
  msim_status status = MSIM_OK;
  *table = find_own_backend(name, backends);
  if (!*table) *table = linked_in(name);
  if (!*table) status = load_backend(name, plugin_path, table, where, err);
  if (!status)
    status = check_backend_table(name, where->length ? where->data : "the backend in this program",
                                 *table, err);
  return status;
}

msim_status msim_solver_backend(const char *name, const char *plugin_path,
                                const msim_backend **backend, msim_error *err) {
  if (!name || !backend) return ms_error_set(err, MSIM_ERR_ARG, "name or backend is NULL");
  if (is_built_in(name))
    return ms_error_set(err, MSIM_ERR_NAME,
                        "solver '%s' is built into msim and has no function table", name);
  const msim_allocator alloc = ms_memory_allocator(NULL);
  ms_text where = {.alloc = &alloc};
  msim_status status = ms_registry_find_backend(name, NULL, plugin_path, backend, &where, err);
  ms_text_free(&where);
  return status ? status : ms_error_clear(err);
}

int32_t msim_solver_info(int32_t i, const char *plugin_path, msim_plugin_entry *entry,
                         msim_error *err) {
  const char *name = ms_registry_solver_name(i, NULL);
  if (!name) return 0;
  ms_error_clear(err);
  *entry = (msim_plugin_entry){
      .name = name, .library = "msim", .license = "MIT", .note = "", .available = 1};
  if (is_built_in(name)) return 1;
  const msim_allocator alloc = ms_memory_allocator(NULL);
  ms_text where = {.alloc = &alloc};
  const msim_backend *table;
  entry->available =
      ms_registry_find_backend(name, NULL, plugin_path, &table, &where, err) == MSIM_OK;
  entry->library = entry->available ? table->library : "";
  entry->license = entry->available ? table->license : "";
  if (entry->available) ms_error_set(err, MSIM_OK, "%s", where.length ? where.data : "linked in");
  if (err) entry->note = err->text;
  ms_text_free(&where);
  return 1;
}
