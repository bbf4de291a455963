/* linear_report - prints the results of a solver comparison and writes them to the report */
#ifndef BENCH_LINEAR_REPORT_H
#define BENCH_LINEAR_REPORT_H

#include "solver_comparison.h"
#include "report.h"

/* Print the scene and its step; print the header of the table. */
void print_heading(const moving_scene *m, double h);
void print_columns(void);

/* Appends a row with the properties of a scene and its step. */
json_t *add_step_row(report *out, const char *measure, const moving_scene *m, double h);

/* Prints and writes the results of all candidates. */
void report_comparison(report *out, const solver_comparison *r);

/* Writes those that failed or never ran, as rows with this measure instead of their own. */
void report_failures(report *out, const solver_comparison *r, const char *measure);

/* Writes a row for a solver that was not run. */
void report_left_out(report *out, const char *measure, const moving_scene *m, double h,
                     const char *solver, const char *why);

#endif
