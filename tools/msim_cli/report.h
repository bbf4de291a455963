/* report - what a run and `list` print to stdout */
#ifndef CLI_REPORT_H
#define CLI_REPORT_H

#include "arguments.h"

typedef struct report {
  const char *name; /* of the scene */
  msim_state first; /* only its step and t are looked at */
  msim_energy start;
  double wall_s;
  int notes;      /* of the library, printed to stderr */
  int64_t frames; /* written to args->out */
  int goes_on;    /* 1: with frames that were there */
} report;

/* After the run; the sim is where it ended. */
void report_run(const report *r, const arguments *args, msim_sim *sim);

int report_list(const arguments *args);

#endif
