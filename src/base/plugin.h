/* plugin - finding, loading and checking plugins; each is loaded at first use and never unloaded */
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

/* Refuse a table with another ABI, a size below `least`, or another name. */
msim_status ms_plugin_check(const char *kind, const char *name, const char *file, uint32_t abi,
                            uint32_t host_abi, uint32_t size, uint32_t least,
                            const char *table_name, msim_error *err);

/* Refuse a table in which one of these members is missing. */
typedef struct ms_plugin_member {
  const char *name;
  int missing;
} ms_plugin_member;
msim_status ms_plugin_check_members(const char *file, const ms_plugin_member *members, size_t n,
                                    msim_error *err);

/* Services for a plugin: memory of the scene's allocator, and a buffer for its last message. */
typedef struct ms_plugin_host {
  msim_host base;
  const msim_allocator *alloc;
  char text[768];
} ms_plugin_host;

void ms_plugin_init_host(ms_plugin_host *host, const msim_allocator *alloc);

/* Fail with the plugin's status and its message, or the text of the status if it gave none. */
msim_status ms_plugin_fail(const ms_plugin_host *host, const char *name, msim_status status,
                           msim_error *err);

#endif
