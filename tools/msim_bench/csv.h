/* csv - writes the rows of a report as a CSV table with a header line */
#ifndef BENCH_CSV_H
#define BENCH_CSV_H

#include "report.h"

/* Writes to an open file; prints an error if that fails. Keys that a row lacks are empty fields. */
int csv_write(const report *r, output_file *file);

#endif
