/* recorders - registry of recorders: find the one that writes a kind of trajectory file */
#ifndef MS_RECORDERS_H
#define MS_RECORDERS_H

#include "base/text.h"
#include "msim/recorder.h"

/* The name of the recorder whose files have the extension of `path`; NULL: there is none. */
const char *ms_recorders_find_name(const char *path);

/* Find a recorder by name, and open its plugin unless it is linked in. where: as of ms_plugin_open.
 * Errors are those of ms_plugin_open, and MSIM_ERR_PLUGIN for a defective table. */
msim_status ms_recorders_find(const char *kind, const char *plugin_path,
                              const msim_recorder_type **type, ms_text *where, msim_error *err);

/* 1: the table is long enough to have that member, and has it. */
#define MS_RECORDERS_HAS(type, member) \
  ((type)->size > offsetof(msim_recorder_type, member) && (type)->member)

#endif
