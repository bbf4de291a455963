#include "csv.h"

#include <errno.h>
#include <string.h>

/* Returns an object with the keys of all rows, in the order of their first appearance. */
static json_t *collect_columns(const report *r) {
  json_t *columns = json_object(), *row, *value;
  const char *key;
  size_t i;
  json_array_foreach(r->rows, i, row) {
    json_object_foreach(row, key, value) {
      if (!json_object_get(columns, key)) json_object_set_new(columns, key, json_null());
    }
  }
  return columns;
}

/* Quotes the text if RFC 4180 requires it. */
static void put_field(FILE *out, const char *text) {
  if (!strpbrk(text, ",\"\n\r")) {
    fputs(text, out);
    return;
  }
  putc('"', out);
  for (; *text; text++) {
    if (*text == '"') putc('"', out);
    putc(*text, out);
  }
  putc('"', out);
}

static void put_csv_value(FILE *out, const json_t *value) {
  if (json_is_string(value)) put_field(out, json_string_value(value));
  else if (json_is_integer(value)) fprintf(out, "%" JSON_INTEGER_FORMAT, json_integer_value(value));
  else if (json_is_real(value)) fprintf(out, "%.9g", json_real_value(value));
  else if (json_is_boolean(value)) fputs(json_is_true(value) ? "1" : "0", out);
}

/* row NULL: writes the header */
static void put_line(FILE *out, json_t *columns, const json_t *row) {
  const char *key, *comma = "";
  json_t *unused;
  json_object_foreach(columns, key, unused) {
    fputs(comma, out);
    comma = ",";
    if (row) put_csv_value(out, json_object_get(row, key));
    else put_field(out, key);
  }
  putc('\n', out);
}

int csv_write(const report *r, output_file *file) {
  json_t *columns = collect_columns(r), *row;
  size_t i;
  errno = 0;
  put_line(file->stream, columns, NULL);
  json_array_foreach(r->rows, i, row) put_line(file->stream, columns, row);
  json_decref(columns);
  return output_close(file, columns != NULL && !ferror(file->stream));
}
