/* report - the results of a benchmark: rows and a summary, printed and written as JSON */
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

/* Appends a row, which the report owns; the functions below set its keys. */
json_t *report_add_row(report *r, const char *measure);

/* NAN (not measured) adds no key; an infinite value becomes null. */
void put_real(json_t *object, const char *key, double value);
void put_text(json_t *object, const char *key, const char *text);
void put_integer(json_t *object, const char *key, int64_t value);

/* Sets a key of the summary; NAN and infinity become null, printed as "no result", so that a key
 * which could not be measured stays visible. */
void report_key(report *r, const char *key, double value);

/* Prints to stdout. */
void report_print_summary(const report *r);

/* Writes JSON to an open file; prints an error if that fails. */
int report_write(const report *r, output_file *file);

#endif
