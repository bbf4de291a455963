/* registry - finds linear solvers by name: those of the program, linked in, or from plugins */
#ifndef MS_REGISTRY_H
#define MS_REGISTRY_H

#include "base/plugin.h"
#include "msim/backend.h"

/* The table of a backend: from own (NULL-terminated, nullable), linked in, or from a plugin, in
 * this order. where: the plugin's file, else empty. MSIM_ERR_NAME: not found; MSIM_ERR_PLUGIN,
 * MSIM_ERR_ABI: not loadable, or an invalid table. */
msim_status ms_registry_find_backend(const char *name, const msim_backend *const *own,
                                     const char *plugin_path, const msim_backend **table,
                                     ms_text *where, msim_error *err);

/* The i-th name of a solver that msim documents, "auto" and "pcg" first; NULL past the end. */
const char *ms_registry_solver_name(int32_t i, const void *unused);

#endif
