/* backends - finds linear solvers by name: those of the program, linked in, or from plugins */
#ifndef MS_BACKENDS_H
#define MS_BACKENDS_H

#include "base/registry.h"
#include "msim/backend.h"

/* The table of the backend that opt->solver may name, see ms_registry_find. */
msim_status ms_backends_find(const char *name, const msim_options *opt, const msim_allocator *alloc,
                             const msim_backend **table, msim_error *err);

/* MSIM_ERR_NAME and others: opt->solver is neither a solver of msim, installed or not, nor one of
 * the program or a plugin. */
msim_status ms_backends_check_name(const msim_options *opt, const msim_allocator *alloc,
                                   msim_error *err);

/* 1: opt->solver is a backend of systems that several ranks share, or is not available. */
int ms_backends_supports_ranks(const msim_options *opt, const msim_allocator *alloc);

/* MSIM_ERR_ARG: the solver of this name takes no solver.options. */
msim_status ms_backends_refuse_options(const char *name, msim_error *err);

#endif
