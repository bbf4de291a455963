/* import - scene files other than JSON, read and written by plugins */
#ifndef MS_IMPORT_H
#define MS_IMPORT_H

#include "base/plugin.h"
#include "msim/importer.h"
#include "scene/scene.h"

/* The importer for files of that name; NULL: none, the file is JSON. */
const char *ms_importer_for(const char *path);

/* Its table: linked in, or that of a plugin. where: the plugin's file. Nullable: plugin_path. */
msim_status ms_importer_find(const char *name, const char *plugin_path, const msim_importer **table,
                             ms_text *where, msim_error *err);

msim_status ms_scene_import(const msim_allocator *alloc, const char *name, const char *path,
                            msim_scene **scene, msim_error *err);

/* `label` stands for the file in errors. */
msim_status ms_scene_export(const ms_scene *scene, const char *name, const char *path,
                            const char *label, msim_error *err);

#endif
