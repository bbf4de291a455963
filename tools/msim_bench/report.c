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

json_t *report_add_row(report *r, const char *measure) {
  json_t *row = json_object();
  put_text(row, "measure", measure);
  json_array_append_new(r->rows, row);
  return row;
}

static void put_real_or_null(json_t *object, const char *key, double value) {
  json_object_set_new(object, key, isfinite(value) ? json_real(value) : json_null());
}

void put_real(json_t *object, const char *key, double value) {
  if (!isnan(value)) put_real_or_null(object, key, value);
}

void put_text(json_t *object, const char *key, const char *text) {
  json_object_set_new(object, key, json_string(text));
}

void put_integer(json_t *object, const char *key, int64_t value) {
  json_object_set_new(object, key, json_integer(value));
}

void report_key(report *r, const char *key, double value) {
  put_real_or_null(r->summary, key, value);
}

void report_print_summary(const report *r) {
  const char *key;
  json_t *value;
  puts("\nSummary");
  json_object_foreach(r->summary, key, value) {
    if (json_is_null(value)) printf("  %-50s no result\n", key);
    else printf("  %-50s %.4g\n", key, json_real_value(value));
  }
  if (json_object_size(r->summary) == 0) puts("  nothing that has a key was measured");
}

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
