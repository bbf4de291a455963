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

/* A member of a row: FIELDS(TEXT("solver", name), REAL("ms", 1e3 * seconds)) is a list of them. A
 * text that is NULL and a real that is NAN (not measured) add no key; an infinite one is null. */
typedef struct field {
  const char *key;
  json_type type;
  const char *text;
  double real;
  int64_t integer;
} field;

#define TEXT(name_, value) \
  { .key = name_, .type = JSON_STRING, .text = value }
#define REAL(name_, value) \
  { .key = name_, .type = JSON_REAL, .real = value }
#define INTEGER(name_, value) \
  { .key = name_, .type = JSON_INTEGER, .integer = value }
#define BOOLEAN(name_, value) \
  { .key = name_, .type = JSON_TRUE, .integer = value }
#define FIELDS(...)              \
  (const field[]) {              \
    __VA_ARGS__, { .key = NULL } \
  }

/* Appends a row, which the report owns. */
json_t *report_add_row(report *r, const char *measure, const field *fields);
void put_fields(json_t *row, const field *fields);

/* A text of a row, "" if there is none; a number, NAN if there is none. */
const char *row_text(const json_t *row, const char *key);
double row_number(const json_t *row, const char *key);

/* Sets a key of the summary; NAN and infinity become null, printed as "no result", so that a key
 * which could not be measured stays visible. */
void report_key(report *r, const char *key, double value);

/* Prints to stdout. */
void report_print_summary(const report *r);

/* Write all as JSON to an open file; print an error if that fails. */
int report_write(const report *r, output_file *file);

/* A column of a printed table: the value of a row's key, times `scale` if that is not 0. */
typedef struct column {
  const char *title, *key;
  int width;          /* negative: flush left */
  const char *format; /* of a number */
  double scale;
} column;

/* Print the titles, a row, one value of it; columns end with a key that is NULL. A row that has a
 * reason instead of a result is printed as that. An absent value is "-", null is "inf". */
void print_titles(const column *columns);
void print_row(const column *columns, const json_t *row);
void print_value(const column *c, const json_t *row);

#endif
