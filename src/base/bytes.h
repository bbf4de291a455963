/* bytes - what is kept, to bytes and back, by one description for both, and for how many it takes
 *
 * A description passes one number after the other. No length is ever read: all follow from what is
 * there already, so that bytes, whatever they are, lead nowhere. */
#ifndef MS_BYTES_H
#define MS_BYTES_H

#include <stddef.h>
#include <stdint.h>

#include "base/vector.h"

typedef enum ms_direction { MS_COUNT, MS_PUT, MS_TAKE } ms_direction;

typedef struct ms_bytes {
  ms_direction direction;
  unsigned char *at; /* COUNT: NULL. TAKE: only read */
  size_t size, used; /* used > size: they were too few, and what came late was left alone */
  const char *wrong; /* TAKE: the first thing that cannot be so; NULL: none */
} ms_bytes;

void ms_bytes_pass(ms_bytes *b, void *data, size_t size);

#define MS_BYTES_PASS(b, variable) ms_bytes_pass(b, &(variable), sizeof(variable))

/* A count: not negative, with room to grow. */
void ms_bytes_pass_count(ms_bytes *b, int64_t *count);

/* The unknown rows of a vector. Where one that is taken is not finite, that is wrong. */
void ms_bytes_pass_rows(ms_bytes *b, ms_shape shape, double *x);

/* A part that is not always there; counted, it is. */
#define MS_BYTES_IF(b, there) ((b)->direction == MS_COUNT || (there))

/* 1 where something was taken that cannot be. */
static inline int ms_bytes_failed(const ms_bytes *b) {
  return b->direction == MS_TAKE && (b->wrong || b->used > b->size);
}

/* What was taken must be so. */
void ms_bytes_check(ms_bytes *b, int is_so, const char *what);

/* The hash of `before` and these bytes. Another single byte is another hash always. */
uint64_t ms_hash(uint64_t before, const void *data, size_t size);

#endif
