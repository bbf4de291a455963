/* rank_fetch - particles or springs of a scene of which each rank has a slice, by their numbers */
#ifndef MS_RANK_FETCH_H
#define MS_RANK_FETCH_H

#include "sim/rank_gather.h"

/* What a rank asks the others for, and they this one; zero: nothing yet */
typedef struct ms_rank_fetch {
  ms_ranks *ranks;
  const ms_rank_scene *slices;
  int64_t *nin, *nout; /* nranks: rows from each rank, and to it */
  int64_t sum_out;
  int32_t *out; /* sum_out: the rows of the slice that are sent, by rank */
  char *buffer; /* room for sum_out rows of any array */
} ms_rank_fetch;

/* Sort numbers, and leave each of them once; returns how many are left. */
int32_t ms_rank_fetch_sort(int64_t n, int32_t *number);

/* Ask for n particles or springs of ascending numbers. Collective, with the same status on all
 * ranks; destroy it, also after an error. */
msim_status ms_rank_fetch_create(ms_ranks *ranks, const ms_rank_scene *slices, ms_element of,
                                 int32_t n, const int32_t *number, ms_rank_fetch *fetch,
                                 msim_error *err);
void ms_rank_fetch_destroy(ms_rank_fetch *fetch);

/* to: the rows that were asked for, of `size` bytes, of an array of which slices have `from`. A
 * failure of the communicator is kept for the next agreement. Collective */
void ms_rank_fetch_rows(const ms_rank_fetch *fetch, size_t size, const void *from, void *to);

#endif
