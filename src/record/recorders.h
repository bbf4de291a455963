/* recorders - finds the recorder for a trajectory file by its extension */
#ifndef MS_RECORDERS_H
#define MS_RECORDERS_H

#include "base/registry.h"
#include "msim/recorder.h"

/* The table of the recorder for the file `path`, see ms_registry_find. */
msim_status ms_recorders_find(const char *path, const msim_options *opt,
                              const msim_allocator *alloc, const msim_recorder_type **type,
                              msim_error *err);

/* 1: the table is long enough to have that member, and has it. */
#define MS_RECORDERS_HAS(type, member) \
  ((type)->size > offsetof(msim_recorder_type, member) && (type)->member)

#endif
