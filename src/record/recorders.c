#include "record/recorders.h"

#include "record/csv.h"
#include "record/html.h"
#include "record/pvd.h"

/* Static builds define the list of recorders that are linked in: X(hdf5) ... */
#define X(name) const msim_recorder_type *msim_recorder_##name(void);
MSIM_LINKED_RECORDERS
#undef X

#define X(name) msim_recorder_##name,
MS_REGISTRY_ENTRIES(msim_recorder_entry_fn, ms_csv_recorder_type, ms_pvd_recorder_type,
                    ms_html_recorder_type, MSIM_LINKED_RECORDERS)
#undef X

static const ms_registry_plugin known[] = {{.name = "csv", .extension = ".csv"},
                                           {.name = "html", .extension = ".html"},
                                           {.name = "pvd", .extension = ".pvd"},
                                           {.name = "hdf5",
                                            .extension = ".vtkhdf",
                                            .plugin = "hdf5",
                                            .debian = "libhdf5-dev",
                                            .conda = "hdf5"},
                                           {NULL}};

#define MEMBER(member) \
  { #member, offsetof(msim_recorder_type, member) }
static const ms_registry_member required[] = {
    MEMBER(name), MEMBER(extension), MEMBER(library), MEMBER(license),
    MEMBER(open), MEMBER(write),     MEMBER(close),   {NULL}};

static const ms_registry recorders = {.kind = "recorder",
                                      .noun = "recorder",
                                      .abi = MSIM_RECORDER_ABI,
                                      .least_size = MSIM_RECORDER_SIZE_1,
                                      .library = offsetof(msim_recorder_type, library),
                                      .license = offsetof(msim_recorder_type, license),
                                      .extension = offsetof(msim_recorder_type, extension),
                                      .known = known,
                                      .required = required,
                                      .linked = linked,
                                      .enter = enter};

msim_status ms_recorders_find(const char *path, const msim_options *opt,
                              const msim_allocator *alloc, const msim_recorder_type **type,
                              msim_error *err) {
  const ms_registry_sources sources = {opt->recorders, opt->plugin_path, alloc};
  const void *table;
  msim_error why;
  const msim_status status = ms_registry_find(&recorders, path, &sources, &table, &why);
  *type = table;
  if (!status) return MSIM_OK;
  const int is_unknown = status == MSIM_ERR_NAME && !ms_registry_knows(&recorders, path);
  return ms_error_set(
      err, status, "%s: %s%s", path,
      is_unknown ? "the file name of a trajectory must end in .html, .vtkhdf, .pvd, .csv or "
                   "the extension of a plugin: "
                 : "",
      why.text);
}

int32_t msim_recorder_info(int32_t i, const char *plugin_path, msim_plugin_entry *entry,
                           msim_error *err) {
  return ms_registry_info(&recorders, i, plugin_path, entry, err);
}
