/* registry - linear solvers by name: the ones linked in, and those that a plugin brings */
#ifndef MS_REGISTRY_H
#define MS_REGISTRY_H

#include "linear/plugin.h"
#include "msim/backend.h"

/* The table of a backend. where: the plugin's file, empty if it is linked in. */
msim_status ms_backend_find(const char *name, const char *plugin_path, const msim_backend **table,
                            ms_text *where, msim_error *err);

/* Names that the option `solver` knows, "auto" and "pcg" first; NULL past the end. */
const char *ms_solver_name(int32_t i, const void *unused);

#endif
