/* plugin - finding and loading plugins, each at first use and for good, and services for them */
#ifndef MS_PLUGIN_H
#define MS_PLUGIN_H

#include "base/memory.h"
#include "base/text.h"

/* Get the function msim_KIND_entry of msim_KIND_NAME.so from the first folder that contains the
 * file: plugin_path (folders, ':' between), those of the environment variable MSIM_PLUGIN_PATH, the
 * plugin folder next to the library itself. Plugins are never unloaded, because threads of BLAS and
 * OpenMP may still run in them. Nullable: plugin_path. where: the file, or the list of folders. */
msim_status ms_plugin_open(const char *kind, const char *name, const char *plugin_path,
                           void **entry, ms_text *where, msim_error *err);

/* Services for a plugin: memory of the scene's allocator, and a buffer for its last message. */
typedef struct ms_plugin_host {
  msim_host base;
  msim_allocator alloc; /* a copy: a plugin may outlast the scene that it was opened for */
  char text[768];
} ms_plugin_host;

void ms_plugin_init_host(ms_plugin_host *host, const msim_allocator *alloc);

/* Fail with the plugin's status and its message, or the text of the status if it gave none. */
msim_status ms_plugin_fail(const ms_plugin_host *host, const char *name, msim_status status,
                           msim_error *err);

#endif
