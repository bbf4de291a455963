#include "linear/backends.h"

#include <string.h>

/* Static builds define MSIM_LINKED_BACKENDS as the list of their backends: X(cholmod) X(klu) ... */
#define X(name) const msim_backend *msim_backend_##name(void);
MSIM_LINKED_BACKENDS
#undef X

#define X(name) msim_backend_##name,
MS_REGISTRY_ENTRIES(msim_backend_entry_fn, MSIM_LINKED_BACKENDS)
#undef X

static msim_status check_format(const void *table, const char *file, msim_error *err) {
  const int32_t format = ((const msim_backend *)table)->format;
  if (format >= MSIM_FORMAT_NONE && format <= MSIM_FORMAT_FULL) return MSIM_OK;
  return ms_error_set(
      err, MSIM_ERR_PLUGIN,
      "%s requests the unknown matrix format %d; rebuild it for this version of msim", file,
      format);
}

#define SUNDIALS .plugin = "sundials", .debian = "libsundials-dev", .conda = "sundials"
static const ms_registry_plugin known[] = {
    {.name = "auto", .has_no_table = 1},
    {.name = "pcg", .has_no_table = 1},
    {.name = "cholmod",
     .plugin = "cholmod",
     .debian = "libsuitesparse-dev",
     .conda = "libcholmod",
     .pip = "msim-cholmod"},
    {.name = "klu",
     .plugin = "klu",
     .debian = "libsuitesparse-dev libsundials-dev",
     .conda = "libklu sundials"},
    {.name = "petsc", .plugin = "petsc", .debian = "petsc-dev", .conda = "petsc openmpi"},
    {.name = "sundials-pcg", SUNDIALS},
    {.name = "sundials-spgmr", SUNDIALS},
    {.name = "sundials-spfgmr", SUNDIALS},
    {.name = "sundials-spbcgs", SUNDIALS},
    {.name = "sundials-sptfqmr", SUNDIALS},
    {NULL}};

#define MEMBER(member) \
  { #member, offsetof(msim_backend, member) }
static const ms_registry_member required[] = {MEMBER(library), MEMBER(license), MEMBER(create),
                                              MEMBER(analyze), MEMBER(factor),  MEMBER(solve),
                                              MEMBER(destroy), {NULL}};

static const ms_registry backends = {.kind = "backend",
                                     .noun = "solver",
                                     .abi = MSIM_BACKEND_ABI,
                                     .least_size = MSIM_BACKEND_SIZE_1,
                                     .library = offsetof(msim_backend, library),
                                     .license = offsetof(msim_backend, license),
                                     .known = known,
                                     .required = required,
                                     .linked = linked,
                                     .enter = enter,
                                     .check = check_format};

msim_status ms_backends_find(const char *name, const msim_options *opt, const msim_allocator *alloc,
                             const msim_backend **table, msim_error *err) {
  const ms_registry_sources sources = {opt->backends, opt->plugin_path, alloc};
  const void *found;
  const msim_status status = ms_registry_find(&backends, name, &sources, &found, err);
  *table = found;
  return status;
}

int ms_backends_supports_ranks(const msim_options *opt, const msim_allocator *alloc) {
  const msim_backend *table;
  return ms_backends_find(opt->solver, opt, alloc, &table, NULL) ||
         (table->flags & MSIM_BACKEND_RANKS);
}

msim_status ms_backends_refuse_options(const char *name, msim_error *err) {
  return ms_error_set(
      err, MSIM_ERR_ARG,
      "solver '%s' takes no solver.options; remove them, or use a solver that takes "
      "some, as petsc",
      name);
}

msim_status ms_backends_check_name(const msim_options *opt, const msim_allocator *alloc,
                                   msim_error *err) {
  const msim_backend *table;
  if (!opt->solver) return MSIM_OK;
  if (opt->solver_options && (strcmp(opt->solver, "auto") == 0 || strcmp(opt->solver, "pcg") == 0))
    return ms_backends_refuse_options(opt->solver, err);
  for (const ms_registry_plugin *solver = known; solver->name; solver++)
    if (strcmp(solver->name, opt->solver) == 0) return MSIM_OK;
  return ms_backends_find(opt->solver, opt, alloc, &table, err);
}

msim_status msim_solver_backend(const char *name, const char *plugin_path,
                                const msim_backend **backend, msim_error *err) {
  if (!name || !backend) return ms_error_set(err, MSIM_ERR_ARG, "name or backend is NULL");
  if (strcmp(name, "auto") == 0 || strcmp(name, "pcg") == 0)
    return ms_error_set(err, MSIM_ERR_NAME,
                        "solver '%s' is built into msim and has no function table", name);
  const msim_allocator alloc = ms_memory_allocator(NULL);
  const msim_options opt = {.plugin_path = plugin_path};
  const msim_status status = ms_backends_find(name, &opt, &alloc, backend, err);
  return status ? status : ms_error_clear(err);
}

int32_t msim_solver_info(int32_t i, const char *plugin_path, msim_plugin_entry *entry,
                         msim_error *err) {
  return ms_registry_info(&backends, i, plugin_path, entry, err);
}
