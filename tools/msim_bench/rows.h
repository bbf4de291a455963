/* rows - what a race found, as a table and as rows of the report */
#ifndef BENCH_ROWS_H
#define BENCH_ROWS_H

#include "race.h"
#include "report.h"

/* The scene and its step; what the columns of a race are. */
void print_heading(const moving *m, double h);
void print_columns(void);

/* A new row about a scene and its step. */
json_t *step_row(report *out, const char *measure, const moving *m, double h);

/* All contestants of a race. */
void report_race(report *out, const race *r);

/* Those of them that failed or never ran, as rows of another measure than their own. */
void report_failures(report *out, const race *r, const char *measure);

/* A solver that was not even tried. */
void report_left_out(report *out, const char *measure, const moving *m, double h,
                     const char *solver, const char *why);

#endif
