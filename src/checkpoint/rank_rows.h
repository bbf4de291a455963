/* rank_rows - the rows of one process in checkpoints of several ranks, each of which has some
 *
 * A checkpoint has the islands of one process, with vectors in its order of unknowns, so that it
 * does not depend on the number of ranks. The unknowns of a rank are in the same order. Each rank
 * writes a part of the bytes, for which the others send it rows, and reads its rows from all. */
#ifndef MS_RANK_ROWS_H
#define MS_RANK_ROWS_H

#include "base/archive.h"
#include "layout/rank_part.h"

typedef struct ms_rank_rows {
  ms_archive_rows base; /* of the present island */
  ms_rank_part *part;
  int32_t first;     /* of the island, in the order of one process */
  int32_t own, nown; /* own rows of the island: the first one, and their number */
  /* nranks + 1: rank r writes the bytes from bounds[r] to bounds[r + 1]; NULL: none are written */
  const size_t *bounds;
} ms_rank_rows;

/* For an archive of the whole scene; NULL where part is: one process has all rows. bounds: as
 * above */
ms_archive_rows *ms_rank_rows_begin(ms_rank_rows *rows, ms_rank_part *part, const size_t *bounds);

/* The rows of island i of part->whole are transferred next; from 0 on, one after the other. */
void ms_rank_rows_select(ms_rank_rows *rows, int32_t i);

#endif
