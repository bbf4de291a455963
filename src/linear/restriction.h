/* restriction - prepares P^T r to be summed chunk by chunk while the chunk's r is in cache
 *
 * The rows of an aggregate that lie in one chunk are a part of it. The thread that computes a chunk
 * of r also sums its parts; those of an aggregate are added in order afterwards. */
#ifndef MS_RESTRICTION_H
#define MS_RESTRICTION_H

#include "base/buckets.h"
#include "linear/aggregates.h"

/* In a chunk */
enum { MS_RESTRICTION_SLICES = 128, MS_RESTRICTION_ROWS = MS_SLICE * MS_RESTRICTION_SLICES };

typedef struct ms_restriction {
  int32_t *first; /* of each chunk: its first part. Parts are numbered by their first rows, chunk by
                     chunk; rows of no aggregate are parts as well. */
  uint16_t *part; /* first_pinned: the part of each row, counted from the first of its chunk */
  ms_buckets of;  /* the parts of each aggregate, ascending */
  double *sums;   /* of each part: 4 modes times components */
} ms_restriction;

msim_status ms_restriction_create(const ms_model *model, const ms_aggregates *a, ms_restriction *r,
                                  msim_error *err);
void ms_restriction_destroy(const ms_model *model, ms_restriction *r);

#endif
