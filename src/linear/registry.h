/* registry - linear solvers by name: the program's own, the ones linked in, those of plugins */
#ifndef MS_REGISTRY_H
#define MS_REGISTRY_H

#include "base/plugin.h"
#include "msim/backend.h"

/* The table of a backend, from own (NULL at the end, nullable), linked in, or from a plugin; one
 * that cannot be called is refused. where: the plugin's file, empty if there is none. */
msim_status ms_backend_find(const char *name, const msim_backend *const *own,
                            const char *plugin_path, const msim_backend **table, ms_text *where,
                            msim_error *err);

/* Names that the option `solver` knows, "auto" and "pcg" first; NULL past the end. */
const char *ms_solver_name(int32_t i, const void *unused);

#endif
