#include "record/recorders.h"

#include <string.h>

#include "base/plugin.h"
#include "record/csv.h"

static const struct {
  const char *name, *extension;
} kinds[] = {{"csv", ".csv"}, {"hdf5", ".vtkhdf"}};
enum { NKINDS = sizeof kinds / sizeof *kinds };

#define X(name) const msim_recorder_type *msim_recorder_##name(void);
MSIM_LINKED_RECORDERS
#undef X

static const msim_recorder_type *linked_in(const char *name) {
  if (strcmp(name, "csv") == 0) return ms_csv_recorder_type();
#define X(recorder) \
  if (strcmp(name, #recorder) == 0) return msim_recorder_##recorder();
  MSIM_LINKED_RECORDERS
#undef X
  return NULL;
}

msim_status ms_recorders_find(const char *name, const char *plugin_path,
                              const msim_recorder_type **type, ms_text *where, msim_error *err) {
  *type = linked_in(name);
  if (*type) return MSIM_OK;
  void *symbol;
  msim_error why;
  msim_status status = ms_plugin_open("recorder", name, plugin_path, &symbol, where, &why);
  if (status) return ms_error_set(err, status, "recorder '%s': %s", name, why.text);
  msim_recorder_entry_fn *entry;
  memcpy(&entry, &symbol, sizeof entry); /* ISO C has no cast from void * to a function */
  *type = entry();
  if (!*type)
    return ms_error_set(
        err, MSIM_ERR_PLUGIN,
        "%s: msim_recorder_entry() returned NULL; report this to the author of the plugin",
        where->data);
  status = ms_plugin_check("recorder", name, where->data, (*type)->abi, MSIM_RECORDER_ABI,
                           (*type)->size, MSIM_RECORDER_SIZE_1, (*type)->name, err);
  if (status) return status;
  const ms_plugin_member members[] = {{"library", !(*type)->library},
                                      {"license", !(*type)->license},
                                      {"open", !(*type)->open},
                                      {"write", !(*type)->write},
                                      {"close", !(*type)->close}};
  return ms_plugin_check_members(where->data, members, sizeof members / sizeof *members, err);
}

const char *ms_recorders_find_name(const char *path) {
  const char *dot = strrchr(path, '.');
  for (int i = 0; i < NKINDS && dot; i++)
    if (strcmp(dot, kinds[i].extension) == 0) return kinds[i].name;
  return NULL;
}

int32_t msim_recorder_info(int32_t i, const char *plugin_path, msim_plugin_entry *entry,
                           msim_error *err) {
  if (i < 0 || i >= NKINDS) return 0;
  ms_error_clear(err);
  const msim_allocator alloc = ms_memory_allocator(NULL);
  ms_text where = {.alloc = &alloc};
  const msim_recorder_type *type;
  int found = ms_recorders_find(kinds[i].name, plugin_path, &type, &where, err) == MSIM_OK;
  *entry = (msim_plugin_entry){.name = kinds[i].name,
                               .library = found ? type->library : "",
                               .license = found ? type->license : "",
                               .available = found,
                               .note = ""};
  if (found) ms_error_set(err, MSIM_OK, "%s", where.length ? where.data : "built in");
  if (err) entry->note = err->text;
  ms_text_free(&where);
  return 1;
}
