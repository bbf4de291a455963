/* bytes - serialization: one description of the data serves to write, to read and to count the
 * bytes
 *
 * A description passes one number after the other. Lengths are never read from the bytes: they
 * follow from the existing objects, so that invalid bytes cannot cause an access out of bounds. */
#ifndef MS_BYTES_H
#define MS_BYTES_H

#include <stddef.h>
#include <stdint.h>

#include "base/vector.h"

typedef enum ms_direction { MS_COUNT, MS_PUT, MS_TAKE } ms_direction;

typedef struct ms_bytes {
  ms_direction direction;
  unsigned char *at; /* COUNT: NULL. TAKE: only read from */
  size_t size, used; /* used > size: the buffer is too small, the excess was not copied */
  const char *wrong; /* TAKE: the first item that is invalid; NULL: none */
} ms_bytes;

void ms_bytes_pass(ms_bytes *b, void *data, size_t size);

#define MS_BYTES_PASS(b, variable) ms_bytes_pass(b, &(variable), sizeof(variable))

/* A count: >= 0 and < INT64_MAX / 2, so that it can grow. */
void ms_bytes_pass_count(ms_bytes *b, int64_t *count);

/* The n rows of each component of a vector. Read values that are not finite are invalid. */
void ms_bytes_pass_rows(ms_bytes *b, ms_shape shape, double *x);

/* Condition of an optional part, which is always counted. */
#define MS_BYTES_IF(b, there) ((b)->direction == MS_COUNT || (there))

/* 1 if an item read is invalid or missing. */
static inline int ms_bytes_failed(const ms_bytes *b) {
  return b->direction == MS_TAKE && (b->wrong || b->used > b->size);
}

/* Mark the item `what` as invalid if it was read and !is_so. */
void ms_bytes_check(ms_bytes *b, int is_so, const char *what);

/* Hash of `before` and these bytes. A change of one byte always changes the hash. */
uint64_t ms_hash(uint64_t before, const void *data, size_t size);

#endif
