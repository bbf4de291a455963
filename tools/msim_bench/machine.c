#define _POSIX_C_SOURCE 200809L /* getline */
#include "machine.h"

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/utsname.h>

#include "msim/msim.h"
#include "background_load.h"

/* Returns the text after `separator` in the first line that begins with `key`, to be freed; NULL:
 * no such file or line. */
static char *look_up(const char *path, const char *key, char separator) {
  FILE *file = fopen(path, "r");
  char *line = NULL, *found = NULL;
  size_t size = 0;
  while (file && !found && getline(&line, &size, file) > 0) {
    const char *value = strchr(line, separator);
    if (strncmp(line, key, strlen(key)) != 0 || !value) continue;
    value += 1 + strspn(value + 1, " \t\"");
    found = strdup(value);
    if (found) found[strcspn(found, "\"\n")] = '\0';
  }
  free(line);
  if (file) fclose(file);
  return found;
}

/* Frees text; NULL adds nothing. */
static void put_owned_text(json_t *object, const char *key, char *text) {
  if (text) json_object_set_new(object, key, json_string(text));
  free(text);
}

/* Lists the processor features that determine the speed of arithmetic. */
static json_t *list_isa(void) {
  static const char *const known[] = {"sse4_2",   "avx",      "avx2",     "fma",
                                      "avx512f",  "avx512cd", "avx512bw", "avx512dq",
                                      "avx512vl", "asimd",    "sve"};
  json_t *list = json_array();
  char *flags = look_up("/proc/cpuinfo", "flags", ':');
  if (!flags) flags = look_up("/proc/cpuinfo", "Features", ':');
  for (char *flag = flags ? strtok(flags, " ") : NULL; flag; flag = strtok(NULL, " "))
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
      if (strcmp(flag, known[i]) == 0) json_array_append_new(list, json_string(flag));
  free(flags);
  return list;
}

json_t *machine_describe(void) {
  json_t *machine = json_object();
  struct utsname system;
  put_owned_text(machine, "cpu", look_up("/proc/cpuinfo", "model name", ':'));
  json_object_set_new(machine, "cores", json_integer(usable_cores()));
  json_object_set_new(machine, "isa", list_isa());
  put_owned_text(machine, "os", look_up("/etc/os-release", "PRETTY_NAME", '='));
  if (uname(&system) == 0)
    json_object_set_new(machine, "kernel", json_pack("s++", system.sysname, " ", system.release));
#ifdef __VERSION__
  json_object_set_new(machine, "compiler", json_string(__VERSION__));
#endif
  json_object_set_new(machine, "msim", json_string(msim_version()));
  return machine;
}

static char *call_text_function(void *library, const char *symbol) {
  char *(*question)(void);
  void *address = dlsym(library, symbol);
  memcpy(&question, &address, sizeof question); /* ISO C has no cast from void * to a function */
  return address ? question() : NULL;
}

void machine_add_blas(json_t *machine) {
  void *library = dlopen("libopenblas.so.0", RTLD_LAZY | RTLD_NOLOAD);
  if (!library) return;
  const char *config = call_text_function(library, "openblas_get_config");
  const char *kernels = call_text_function(library, "openblas_get_corename");
  json_object_set_new(machine, "blas", json_pack("{ss*ss*}", "config", config, "kernels", kernels));
  dlclose(library);
}
