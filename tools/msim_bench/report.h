/* report - what a bench found: rows and summary, for people and as JSON */
#ifndef BENCH_REPORT_H
#define BENCH_REPORT_H

#include <jansson.h>
#include <stdint.h>

#include "../common/output.h"

typedef struct report {
  const char *bench;
  int quick;
  json_t *machine, *rows, *summary;
} report;

void report_begin(report *r, const char *bench, int quick);
void report_free(report *r);

/* Append a row, which is taken; its keys are set through the calls below. */
json_t *report_row(report *r, const char *measure);

/* NAN, what was not measured, leaves no key; an infinite value is null. */
void put_real(json_t *object, const char *key, double value);
void put_text(json_t *object, const char *key, const char *text);
void put_integer(json_t *object, const char *key, int64_t value);

/* A key of the summary; null, printed as "no result", where it is NAN or infinite: a key that was
 * to be measured does not vanish. */
void report_key(report *r, const char *key, double value);

/* To the terminal. */
void report_print_summary(const report *r);

/* To a file that is open; complains. */
int report_write(const report *r, output_file *file);

#endif
