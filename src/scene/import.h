/* import - reading and writing of scene files in formats other than JSON, by importer plugins */
#ifndef MS_IMPORT_H
#define MS_IMPORT_H

#include "base/plugin.h"
#include "msim/importer.h"
#include "scene/scene.h"

/* The importer for the file `path`, linked in or from a plugin. *table NULL: the file is JSON, as
 * its extension is .json, none, or that of no importer; why->text then says what was looked for. */
msim_status ms_importers_find(const char *path, const msim_allocator *alloc,
                              const msim_importer **table, msim_error *why);

msim_status ms_import_scene(const msim_allocator *alloc, const msim_importer *table,
                            const char *path, msim_scene **scene, msim_error *err);

/* The rows of one of several ranks (msim_scene_load_part) */
msim_status ms_import_scene_part(const msim_allocator *alloc, const msim_importer *table,
                                 const char *path, int32_t rank, int32_t nranks, msim_scene **scene,
                                 msim_error *err);

/* `label` replaces the file name in messages. */
msim_status ms_export_scene(const ms_scene *scene, const msim_importer *table, const char *path,
                            const char *label, msim_error *err);

#endif
