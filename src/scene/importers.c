/* importers - finds the importer for a scene file by its extension */
#include <string.h>

#include "base/registry.h"
#include "scene/import.h"

/* Static builds define the list of importers that are linked in: X(hdf5) ... */
#define X(name) const msim_importer *msim_importer_##name(void);
MSIM_LINKED_IMPORTERS
#undef X

#define X(name) msim_importer_##name,
MS_REGISTRY_ENTRIES(msim_importer_entry_fn, MSIM_LINKED_IMPORTERS)
#undef X

static const ms_registry_plugin known[] = {{.name = "hdf5",
                                            .extension = ".h5",
                                            .plugin = "hdf5",
                                            .debian = "libhdf5-dev",
                                            .conda = "hdf5"},
                                           {.name = "assimp",
                                            .extension = ".obj .stl .ply .gltf .glb",
                                            .plugin = "assimp",
                                            .debian = "libassimp-dev",
                                            .conda = "assimp"},
                                           {NULL}};

#define MEMBER(member) \
  { #member, offsetof(msim_importer, member) }
static const ms_registry_member required[] = {MEMBER(name),    MEMBER(extension), MEMBER(library),
                                              MEMBER(license), MEMBER(load),      MEMBER(save),
                                              {NULL}};

static const ms_registry importers = {.kind = "importer",
                                      .noun = "importer",
                                      .abi = MSIM_IMPORTER_ABI,
                                      .least_size = MSIM_IMPORTER_SIZE_1,
                                      .library = offsetof(msim_importer, library),
                                      .license = offsetof(msim_importer, license),
                                      .extension = offsetof(msim_importer, extension),
                                      .known = known,
                                      .required = required,
                                      .linked = linked,
                                      .enter = enter};

msim_status ms_importers_find(const char *path, const msim_allocator *alloc,
                              const msim_importer **table, msim_error *why) {
  const ms_registry_sources sources = {.alloc = alloc};
  const char *dot = strrchr(path, '.');
  const void *found;
  *table = NULL;
  if (dot && strcmp(dot, ".json") == 0) return ms_error_clear(why);
  const msim_status status = ms_registry_find(&importers, path, &sources, &found, why);
  if (status == MSIM_ERR_NAME && !ms_registry_knows(&importers, path)) return MSIM_OK;
  *table = found;
  return status ? status : ms_error_clear(why);
}

int32_t msim_importer_info(int32_t i, const char *plugin_path, msim_plugin_entry *entry,
                           msim_error *err) {
  return ms_registry_info(&importers, i, plugin_path, entry, err);
}
