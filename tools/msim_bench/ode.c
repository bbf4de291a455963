#include "ode.h"

#include <dlfcn.h>
#include <stdio.h>
#include <unistd.h>

#include "reference_program.h"

/* The module is never unloaded. */
const ode_methods *ode_load(char reason[static 256]) {
  static const char name[] = "msim_bench_ode_sundials.so";
  char path[4096];
  if (!reference_program_path(name, R_OK, path, sizeof path)) {
    snprintf(reason, 256, "%s was not built", name);
    return NULL;
  }
  void *module = dlopen(path, RTLD_NOW | RTLD_LOCAL);
  const ode_methods *methods = module ? dlsym(module, ODE_SYMBOL) : NULL;
  if (!methods) snprintf(reason, 256, "%s", dlerror());
  return methods;
}
