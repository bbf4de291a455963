/* text - conversion of numbers to and from text independent of the locale, and growing strings */
#ifndef MS_TEXT_H
#define MS_TEXT_H

#include "base/memory.h"

/* Parse all of `text` as a finite double, or as an integer; return 0 if it is not one. */
int ms_text_parse_double(const char *text, double *value);
int ms_text_parse_int64(const char *text, int64_t *value);

/* A finite double as text: the fewest digits, 15 to 17, that read back as the same bits. */
typedef struct ms_number_text_buffer {
  char text[32];
} ms_number_text_buffer;
ms_number_text_buffer ms_text_format_double(double value);

/* A growing string. After a failed allocation `failed` is set and nothing more is appended. */
typedef struct ms_text {
  const msim_allocator *alloc;
  char *data; /* NULL while empty */
  size_t length, capacity;
  int failed;
  /* NULL, or takes pieces of about MS_TEXT_PIECE bytes, which are then removed from data; returns
   * 0 where nothing more is to be appended. */
  int (*take)(void *user, const char *piece, size_t length);
  void *user;
} ms_text;

enum { MS_TEXT_PIECE = 1 << 16 };

void ms_text_append(ms_text *text, const char *format, ...) MS_PRINTF(2, 3);
/* Let the last piece be taken. */
void ms_text_flush(ms_text *text);
void ms_text_free(ms_text *text);

#endif
