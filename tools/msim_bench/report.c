#include "report.h"

#include <errno.h>
#include <math.h>

#include "../common/message.h"
#include "machine.h"

void report_begin(report *r, const char *bench, int quick) {
  *r = (report){.bench = bench,
                .quick = quick,
                .machine = machine_describe(),
                .rows = json_array(),
                .summary = json_object()};
}

void report_free(report *r) {
  json_decref(r->machine);
  json_decref(r->rows);
  json_decref(r->summary);
}

/*------------------------------------- rows -----------------------------------------------------*/

static json_t *real_or_null(double value) {
  return isfinite(value) ? json_real(value) : json_null();
}

/* NULL: there is nothing to write. */
static json_t *value_of(const field *f) {
  if (f->type == JSON_STRING) return f->text ? json_string(f->text) : NULL;
  if (f->type == JSON_REAL) return isnan(f->real) ? NULL : real_or_null(f->real);
  return f->type == JSON_INTEGER ? json_integer(f->integer) : json_boolean(f->integer);
}

void put_fields(json_t *row, const field *fields) {
  for (const field *f = fields; f->key; f++) {
    json_t *value = value_of(f);
    if (value) json_object_set_new(row, f->key, value);
  }
}

json_t *report_add_row(report *r, const char *measure, const field *fields) {
  json_t *row = json_object();
  put_fields(row, FIELDS(TEXT("measure", measure)));
  put_fields(row, fields);
  json_array_append_new(r->rows, row);
  return row;
}

const char *row_text(const json_t *row, const char *key) {
  const char *text = json_string_value(json_object_get(row, key));
  return text ? text : "";
}

double row_number(const json_t *row, const char *key) {
  const json_t *value = json_object_get(row, key);
  return json_is_number(value) ? json_number_value(value) : NAN;
}

/*------------------------------------- tables ---------------------------------------------------*/

void print_titles(const column *columns) {
  for (const column *c = columns; c->key; c++) printf(" %*s", c->width, c->title);
  putchar('\n');
}

void print_value(const column *c, const json_t *row) {
  const json_t *value = json_object_get(row, c->key);
  char text[64] = "-";
  if (json_is_string(value)) snprintf(text, sizeof text, "%s", json_string_value(value));
  else if (json_is_null(value)) snprintf(text, sizeof text, "inf");
  else if (value)
    snprintf(text, sizeof text, c->format, json_number_value(value) * (c->scale ? c->scale : 1));
  printf(" %*s", c->width, text);
}

void print_row(const column *columns, const json_t *row) {
  const char *reason = row_text(row, "reason");
  for (const column *c = columns; c->key && (c == columns || !*reason); c++) print_value(c, row);
  if (*reason) printf(" %s: %s", row_text(row, "status"), reason);
  putchar('\n');
}

/*------------------------------------- summary --------------------------------------------------*/

void report_key(report *r, const char *key, double value) {
  json_object_set_new(r->summary, key, real_or_null(value));
}

void report_print_summary(const report *r) {
  const char *key;
  json_t *value;
  puts("\nSummary");
  json_object_foreach(r->summary, key, value) {
    if (json_is_null(value)) printf("  %-50s no result\n", key);
    else printf("  %-50s %.4g\n", key, json_real_value(value));
  }
  if (json_object_size(r->summary) == 0) puts("  no key was measured");
}

/*------------------------------------- JSON -----------------------------------------------------*/

int report_write(const report *r, output_file *file) {
  json_t *whole = json_pack("{sssbsOsOsO}", "bench", r->bench, "quick", r->quick, "machine",
                            r->machine, "rows", r->rows, "summary", r->summary);
  errno = 0;
  const int written =
      whole && json_dumpf(whole, file->stream, JSON_INDENT(1) | JSON_REAL_PRECISION(9)) == 0 &&
      fputc('\n', file->stream) != EOF;
  json_decref(whole);
  return output_close(file, written);
}
