/* import - reading and writing of scene files in formats other than JSON, by importer plugins */
#ifndef MS_IMPORT_H
#define MS_IMPORT_H

#include "base/plugin.h"
#include "msim/importer.h"
#include "scene/scene.h"

/* Name of the importer for a path, by its extension; NULL: the file is JSON. */
const char *ms_importer_name_for(const char *path);

/* Get the importer's function table, linked in or from a plugin. where: path of the plugin.
 * Nullable: plugin_path. */
msim_status ms_importer_find(const char *name, const char *plugin_path, const msim_importer **table,
                             ms_text *where, msim_error *err);

msim_status ms_import_scene(const msim_allocator *alloc, const char *name, const char *path,
                            msim_scene **scene, msim_error *err);

/* `label` replaces the file name in messages. */
msim_status ms_export_scene(const ms_scene *scene, const char *name, const char *path,
                            const char *label, msim_error *err);

#endif
