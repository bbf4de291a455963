/* recorders - the kinds of trajectories, and who writes them */
#ifndef MS_RECORDERS_H
#define MS_RECORDERS_H

#include "base/text.h"
#include "msim/recorder.h"

/* Whose files are named so; NULL: nobody's. */
const char *ms_recorder_kind(const char *path);

/* The recorder of a kind, its plugin opened. where: its file, as ms_plugin_open says. */
msim_status ms_recorder_find(const char *kind, const char *plugin_path,
                             const msim_recorder_type **type, ms_text *where, msim_error *err);

/* Whether a table goes as far as that member. */
#define MS_RECORDER_HAS(type, member) \
  ((type)->size > offsetof(msim_recorder_type, member) && (type)->member)

#endif
