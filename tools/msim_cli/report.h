/* report - print the summary of a run, and the lists of `list` */
#ifndef CLI_REPORT_H
#define CLI_REPORT_H

#include "arguments.h"

typedef struct report {
  char name[256];   /* of the scene */
  msim_state first; /* only step and t are used */
  msim_energy start;
  double wall_s;
  int self_contact; /* 1: the scene has it */
  int notes;        /* number of the library's notes on stderr */
  int64_t frames;   /* frames written to args->out */
  int goes_on;      /* 1: the file had frames before */
} report;

/* Print the summary after the run; the sim is in its last state. */
void report_run(const report *r, const arguments *args, msim_sim *sim);

int report_list(const arguments *args);

#endif
