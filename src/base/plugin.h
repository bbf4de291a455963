/* plugin - finds and opens one plugin file, on first use and for good */
#ifndef MS_PLUGIN_H
#define MS_PLUGIN_H

#include "base/memory.h"
#include "base/text.h"

/* The function msim_KIND_entry of msim_KIND_NAME.so, from the first of these folders that has the
 * file: plugin_path (folders, ':' between), the environment's MSIM_PLUGIN_PATH, the folder of
 * plugins beside the library itself. Never closed: threads of BLAS and OpenMP live on in it.
 * Nullable: plugin_path. where: the file that was opened, or a list of the folders. */
msim_status ms_plugin_open(const char *kind, const char *name, const char *plugin_path,
                           void **entry, ms_text *where, msim_error *err);

/* Refuse a table of another ABI, a short one, or one that goes by another name. */
msim_status ms_plugin_check(const char *kind, const char *name, const char *file, uint32_t abi,
                            uint32_t host_abi, uint32_t size, uint32_t least,
                            const char *table_name, msim_error *err);

/* Refuse a table without these. */
typedef struct ms_plugin_member {
  const char *name;
  int missing;
} ms_plugin_member;
msim_status ms_plugin_check_members(const char *file, const ms_plugin_member *members, size_t n,
                                    msim_error *err);

/* What a plugin is lent: memory of the scene's allocator, and a place for its last words. */
typedef struct ms_host {
  msim_host base;
  const msim_allocator *alloc;
  char text[768];
} ms_host;

void ms_host_init(ms_host *host, const msim_allocator *alloc);

/* The plugin's status with its sentence, or with a general one where it said nothing. */
msim_status ms_host_fail(const ms_host *host, const char *name, msim_status status,
                         msim_error *err);

#endif
