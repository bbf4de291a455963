/* precision_report - prints the results of `precision` on one scene and writes them to the report
 * */
#ifndef BENCH_PRECISION_REPORT_H
#define BENCH_PRECISION_REPORT_H

#include "report.h"
#include "work_precision.h"

/* Writes a row for a scene without a reference solution. */
void report_no_reference(report *out, const precision_scene *kind, const char *why);

/* Writes the properties of the scene, every run, and the cost of each error by each method. */
void report_sweep(report *out, const setting_sweep *c);

#endif
