/* precision_rows - what the methods came to on one scene, as a table and as rows of the report */
#ifndef BENCH_PRECISION_ROWS_H
#define BENCH_PRECISION_ROWS_H

#include "envelope.h"
#include "report.h"

void print_scene(const precision_scene *kind);

/* The scene without a result. */
void report_no_truth(report *out, const precision_scene *kind, const char *why);

/* What is known of the scene, every rung, and what each error costs by each method. */
void report_climb(report *out, const climb *c);

#endif
