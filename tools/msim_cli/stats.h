/* stats - the counters and phases of msim_stats under their names in files and reports */
#ifndef CLI_STATS_H
#define CLI_STATS_H

#include "msim/msim.h"

/* The i-th counter or phase: its name, NULL past the end, and its value. */
const char *stats_counter(const msim_stats *stats, int i, int64_t *count);
const char *stats_phase(const msim_stats *stats, int i, double *seconds);

#endif
