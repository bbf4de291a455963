/* csv - the rows of a report as a table with one line of names, for spreadsheets and plots */
#ifndef BENCH_CSV_H
#define BENCH_CSV_H

#include "report.h"

/* To a file that is open; complains. What a row lacks is empty. */
int csv_write(const report *r, output_file *file);

#endif
