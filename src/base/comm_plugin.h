/* comm_plugin - communicators by plugins, and a check of any communicator's table */
#ifndef MS_COMM_PLUGIN_H
#define MS_COMM_PLUGIN_H

#include "base/error.h"
#include "msim/comm.h"

/* Refuse a table of another ABI, without functions, or with a rank out of range. */
msim_status ms_comm_plugin_check(const msim_comm *comm, msim_error *err);

#endif
