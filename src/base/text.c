#define _GNU_SOURCE /* strtod_l */
#include "base/text.h"

#include <errno.h>
#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int ms_text_parse_double(const char *text, double *value) {
  locale_t c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
  if (!c) return 0;
  char *end;
  *value = strtod_l(text, &end, c);
  freelocale(c);
  return end != text && *end == '\0' && isfinite(*value);
}

int ms_text_parse_int64(const char *text, int64_t *value) {
  char *end;
  errno = 0;
  long long number = strtoll(text, &end, 10);
  *value = number;
  return end != text && *end == '\0' && errno == 0;
}

/* printf and strtod use the decimal point of the locale, of one or more bytes; it becomes '.'. */
ms_number_text_buffer ms_text_format_double(double value) {
  char local[64];
  for (int digits = 15; digits <= 17; digits++) {
    snprintf(local, sizeof local, "%.*g", digits, value);
    if (strtod(local, NULL) == value) break;
  }
  ms_number_text_buffer number = {""};
  size_t n = 0;
  for (const char *c = local; *c && n < sizeof number.text - 3; c++) {
    if (strchr("+-0123456789e", *c)) number.text[n++] = *c;
    else if (n && number.text[n - 1] != '.') number.text[n++] = '.';
  }
  /* JSON reads "-0" as an integer, which has no sign */
  if (value == 0 && signbit(value)) memcpy(number.text + n, ".0", 3);
  return number;
}

static int reserve_text(ms_text *text, size_t more) {
  if (text->length + more < text->capacity) return 1;
  size_t capacity = 2 * (text->length + more) + 256;
  char *larger = ms_memory_allocate(text->alloc, capacity, 1);
  if (!larger) return 0;
  if (text->length) memcpy(larger, text->data, text->length);
  ms_memory_free(text->alloc, text->data);
  text->data = larger;
  text->capacity = capacity;
  return 1;
}

void ms_text_append(ms_text *text, const char *format, ...) {
  if (text->failed) return;
  size_t room = text->capacity - text->length;
  va_list args, again;
  va_start(args, format);
  va_copy(again, args);
  int more = vsnprintf(room ? text->data + text->length : NULL, room, format, args);
  if (more < 0 || !reserve_text(text, (size_t)more)) {
    text->failed = 1;
  } else {
    /* the first attempt was truncated if there was too little room */
    if ((size_t)more >= room) vsnprintf(text->data + text->length, (size_t)more + 1, format, again);
    text->length += (size_t)more;
  }
  va_end(again);
  va_end(args);
  if (text->length >= MS_TEXT_PIECE) ms_text_flush(text);
}

void ms_text_flush(ms_text *text) {
  if (!text->take || text->failed) return;
  if (text->length && !text->take(text->user, text->data, text->length)) text->failed = 1;
  text->length = 0;
}

void ms_text_free(ms_text *text) {
  ms_memory_free(text->alloc, text->data);
  *text = (ms_text){.alloc = text->alloc};
}
