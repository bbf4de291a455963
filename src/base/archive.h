/* archive - serialization: one description of the data serves to write, to read, to compare and to
 * count the bytes
 *
 * A description passes one number after the other. Lengths are never read from the bytes: they
 * follow from the existing objects, so that invalid bytes cannot cause an access out of bounds. */
#ifndef MS_ARCHIVE_H
#define MS_ARCHIVE_H

#include <stddef.h>
#include <stdint.h>

#include "base/vector.h"

struct ms_archive;

typedef enum ms_archive_mode {
  MS_ARCHIVE_COUNT,
  MS_ARCHIVE_WRITE,
  MS_ARCHIVE_READ,
  MS_ARCHIVE_COMPARE /* the data with the bytes; neither changes */
} ms_archive_mode;

/* Vectors whose rows several ranks have, of which the bytes contain all */
typedef struct ms_archive_rows {
  int32_t n; /* on all ranks */
  /* Pass these rows of one component, of which this rank has its own; collective. Values read are
   * checked like those of other vectors. */
  void (*transfer)(struct ms_archive *b, double *component);
} ms_archive_rows;

typedef struct ms_archive {
  ms_archive_mode direction;
  unsigned char *data;      /* COUNT: NULL. READ, COMPARE: only read from */
  size_t size, position;    /* used > size: the buffer is too small, the excess was not copied */
  size_t first;             /* WRITE: data has `size` bytes from this position on; else 0 */
  const char *invalid_item; /* READ: the first item that is invalid; NULL: none */
  int differs;              /* COMPARE: data and bytes differ */
  ms_archive_rows *rows;    /* NULL: this process has all rows */
} ms_archive;

void ms_archive_transfer(ms_archive *b, void *data, size_t size);

#define MS_ARCHIVE_TRANSFER(b, variable) ms_archive_transfer(b, &(variable), sizeof(variable))

/* A count: >= 0 and < INT64_MAX / 2, so that it can grow. */
void ms_archive_transfer_count(ms_archive *b, int64_t *count);

/* The n rows of each component of a vector. Read values that are not finite are invalid. */
void ms_archive_transfer_vector(ms_archive *b, ms_shape shape, void *x);

/* Condition of an optional part, which is always counted. */
#define MS_ARCHIVE_OPTIONAL(b, there) ((b)->direction == MS_ARCHIVE_COUNT || (there))

/* 1 if an item read is invalid or missing. */
static inline int ms_archive_failed(const ms_archive *b) {
  return b->direction == MS_ARCHIVE_READ && (b->invalid_item || b->position > b->size);
}

/* Mark the item `what` as invalid if it was read and !is_so. */
void ms_archive_check(ms_archive *b, int is_so, const char *what);

/* The rounding error of a sum (Kahan) is not larger than that of one addition. */
void ms_archive_check_rounding(ms_archive *b, double sum, double rounding, const char *what);

/* Hash of `before` and these bytes. A change of one byte always changes the hash. */
uint64_t ms_archive_hash(uint64_t before, const void *data, size_t size);

/* The same in pieces: begin with the size of all, then each piece, in order; all but the last one
 * have whole words of 8 bytes. */
uint64_t ms_archive_hash_begin(uint64_t before, size_t size);
uint64_t ms_archive_hash_words(uint64_t hash, const void *data, size_t size);
uint64_t ms_archive_hash_last(uint64_t hash, const void *data, size_t size);

#endif
