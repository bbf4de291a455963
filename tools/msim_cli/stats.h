/* stats - the counters and phases of msim_stats: their names, for files, and tables of them */
#ifndef CLI_STATS_H
#define CLI_STATS_H

#include "msim/msim.h"

/* The i-th counter or phase: its name and its value; NULL past the end. */
const char *stats_counter(const msim_stats *stats, int i, int64_t *count);
const char *stats_phase(const msim_stats *stats, int i, double *seconds);

/* Print all of them in groups, each with its unit. */
void stats_print(const msim_stats *stats);

#endif
