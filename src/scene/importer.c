/* importer - the list of importers by file extension, and the checks of their function tables */
#include <string.h>

#include "scene/import.h"

static const struct { const char *name, *extension; } kinds[] = {{"hdf5", ".h5"}};
enum { NKINDS = sizeof kinds / sizeof *kinds };

/* Static builds define the list of importers that are linked in: X(hdf5) ... */
#define X(name) const msim_importer *msim_importer_##name(void);
MSIM_LINKED_IMPORTERS
#undef X

static const msim_importer *linked_in(const char *name) {
#define X(importer) \
  if (strcmp(name, #importer) == 0) return msim_importer_##importer();
  MSIM_LINKED_IMPORTERS
#undef X
      (void)
  name;
  return NULL;
}

const char *ms_importer_name_for(const char *path) {
  const char *dot = strrchr(path, '.');
  for (int i = 0; i < NKINDS && dot; i++)
    if (strcmp(dot, kinds[i].extension) == 0) return kinds[i].name;
  return NULL;
}

static msim_status check_importer_table(const char *name, const char *file,
                                        const msim_importer *table, msim_error *err) {
  msim_status status = ms_plugin_check("importer", name, file, table->abi, MSIM_IMPORTER_ABI,
                                       table->size, MSIM_IMPORTER_SIZE_1, table->name, err);
  if (status) return status;
  const ms_plugin_member members[] = {{"library", !table->library},
                                      {"license", !table->license},
                                      {"load", !table->load},
                                      {"save", !table->save}};
  return ms_plugin_check_members(file, members, sizeof members / sizeof *members, err);
}

msim_status ms_importer_find(const char *name, const char *plugin_path, const msim_importer **table,
                             ms_text *where, msim_error *err) {
  *table = linked_in(name);
  if (*table) return MSIM_OK;
  void *symbol;
  msim_error why;
  msim_status status = ms_plugin_open("importer", name, plugin_path, &symbol, where, &why);
  if (status) return ms_error_set(err, status, "importer '%s': %s", name, why.text);
  msim_importer_entry_fn *entry;
  memcpy(&entry, &symbol, sizeof entry); /* ISO C has no cast from void * to a function */
  *table = entry();
  if (!*table)
    return ms_error_set(
        err, MSIM_ERR_PLUGIN,
        "%s: msim_importer_entry() returned NULL; report this to the author of the plugin",
        where->data);
  return check_importer_table(name, where->data, *table, err);
}

int32_t msim_importer_info(int32_t i, const char *plugin_path, msim_plugin_entry *entry,
                           msim_error *err) {
  if (i < 0 || i >= NKINDS) return 0;
  ms_error_clear(err);
  const msim_allocator alloc = ms_memory_allocator(NULL);
  ms_text where = {.alloc = &alloc};
  const msim_importer *table;
  const int found = ms_importer_find(kinds[i].name, plugin_path, &table, &where, err) == MSIM_OK;
  *entry = (msim_plugin_entry){.name = kinds[i].name,
                               .library = found ? table->library : "",
                               .license = found ? table->license : "",
                               .available = found,
                               .note = ""};
  if (found) ms_error_set(err, MSIM_OK, "%s", where.length ? where.data : "linked in");
  if (err) entry->note = err->text;
  ms_text_free(&where);
  return 1;
}
