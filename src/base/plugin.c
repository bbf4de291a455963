#define _GNU_SOURCE /* dladdr, secure_getenv */
#include "base/plugin.h"

#include <dlfcn.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static int is_name(const char *name) {
  return *name && strspn(name, "abcdefghijklmnopqrstuvwxyz0123456789_-") == strlen(name);
}

/* The plugin folder next to the file of this library, so that an installation can be moved. */
static void add_own_folder(ms_text *folders) {
  Dl_info self;
  if (!dladdr((void *)(uintptr_t)ms_plugin_open, &self) || !self.dli_fname) return;
  const char *slash = strrchr(self.dli_fname, '/');
  if (slash) ms_text_append(folders, ":%.*s/", (int)(slash - self.dli_fname), self.dli_fname);
  else ms_text_append(folders, ":./");
  ms_text_append(folders, "%s", MSIM_PLUGIN_FOLDER);
}

/* All folders to search, ':' between. Empty names (the current directory) are ignored. A program
 * linked with -static has no folder of its own: dladdr fails there. */
static void list_folders(const char *plugin_path, ms_text *folders) {
  const char *environment = secure_getenv("MSIM_PLUGIN_PATH");
  ms_text_append(folders, ":");
  if (plugin_path) ms_text_append(folders, ":%s", plugin_path);
  if (environment) ms_text_append(folders, ":%s", environment);
  add_own_folder(folders);
}

static msim_status load_plugin(const char *kind, const char *file, void **entry, msim_error *err) {
  void *handle = dlopen(file, RTLD_NOW | RTLD_LOCAL);
  if (!handle) {
    const char *why = dlerror();
    return ms_error_set(err, MSIM_ERR_PLUGIN, "%s cannot be loaded: %s", file, why ? why : "?");
  }
  char symbol[64];
  snprintf(symbol, sizeof symbol, "msim_%s_entry", kind);
  *entry = dlsym(handle, symbol);
  if (*entry) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_PLUGIN,
                      "%s is not a plugin of this kind for msim: it does not export %s", file,
                      symbol);
}

/* Open the first file that exists: a defective one is reported, not skipped. */
static msim_status search_folders(const char *kind, const char *name, const char *folders,
                                  void **entry, ms_text *where, msim_error *err) {
  for (const char *folder = folders; *folder;) {
    size_t length = strcspn(folder, ":");
    where->length = 0;
    ms_text_append(where, "%.*s/msim_%s_%s.so", (int)length, folder, kind, name);
    if (where->failed) return ms_error_set_memory(err, "a file name");
    if (length && access(where->data, F_OK) == 0) return load_plugin(kind, where->data, entry, err);
    folder += length + (folder[length] == ':');
  }
  where->length = 0;
  for (const char *folder = folders; *folder;) {
    size_t length = strcspn(folder, ":");
    if (length) ms_text_append(where, "%s%.*s", where->length ? ", " : "", (int)length, folder);
    folder += length + (folder[length] == ':');
  }
  return ms_error_set(
      err, MSIM_ERR_NAME,
      "msim_%s_%s.so was not found in %s; add its folder to MSIM_PLUGIN_PATH or plugin_path", kind,
      name, where->length ? where->data : "any folder");
}

msim_status ms_plugin_open(const char *kind, const char *name, const char *plugin_path,
                           void **entry, ms_text *where, msim_error *err) {
  *entry = NULL;
  if (!is_name(name))
    return ms_error_set(err, MSIM_ERR_NAME,
                        "'%s' is not a valid name of a %s; names consist of a-z, 0-9, '_' and '-'",
                        name, kind);
  ms_text folders = {.alloc = where->alloc};
  list_folders(plugin_path, &folders);
  msim_status status = folders.failed ? ms_error_set_memory(err, "the list of plugin folders")
                                      : search_folders(kind, name, folders.data, entry, where, err);
  ms_text_free(&folders);
  return status;
}

/*------------------------------------- host -----------------------------------------------------*/

static void *host_alloc(const msim_host *host, size_t bytes) {
  return ms_memory_allocate(&((const ms_plugin_host *)host)->alloc, bytes, 1);
}

static void host_free(const msim_host *host, void *ptr) {
  ms_memory_free(&((const ms_plugin_host *)host)->alloc, ptr);
}

static void host_fail(const msim_host *host, const char *format, ...) {
  va_list args;
  va_start(args, format);
  vsnprintf(host->data, sizeof((ms_plugin_host *)0)->text, format, args);
  va_end(args);
}

/* One for all plugins, as each has a copy of its own static variables. */
static pthread_mutex_t library_mutex = PTHREAD_MUTEX_INITIALIZER;

static void host_lock(const msim_host *host) {
  (void)host;
  pthread_mutex_lock(&library_mutex);
}

static void host_unlock(const msim_host *host) {
  (void)host;
  pthread_mutex_unlock(&library_mutex);
}

void ms_plugin_init_host(ms_plugin_host *host, const msim_allocator *alloc) {
  *host = (ms_plugin_host){.base = {.size = sizeof host->base,
                                    .alloc = host_alloc,
                                    .free = host_free,
                                    .fail = host_fail,
                                    .data = host->text,
                                    .lock = host_lock,
                                    .unlock = host_unlock},
                           .alloc = *alloc};
}

msim_status ms_plugin_fail(const ms_plugin_host *host, const char *name, msim_status status,
                           msim_error *err) {
  return ms_error_set(err, status, "%s: %s", name,
                      *host->text ? host->text : msim_status_text(status));
}
