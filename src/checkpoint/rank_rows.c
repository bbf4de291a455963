#include "checkpoint/rank_rows.h"

#include <math.h>

enum { VALUE = sizeof(double) };

static int32_t owner_of(const ms_rank_rows *r, int32_t k) {
  return r->part->owner[r->part->whole.particle[r->first + k]];
}

/*------------------------------------- writing --------------------------------------------------*/

/* The rows [begin, end) of the present component that lie in a part of all bytes, some of them
 * perhaps with a few of their bytes only */
typedef struct row_range {
  int32_t begin, end;
} row_range;

static int32_t clip(const ms_rank_rows *r, size_t row) {
  return row < (size_t)r->base.n ? (int32_t)row : r->base.n;
}

static row_range rows_of(const ms_rank_rows *r, size_t position, int32_t rank) {
  const size_t begin = r->bounds[rank], end = r->bounds[rank + 1];
  row_range range = {0, 0};
  if (begin >= end || end <= position) return range;
  if (begin > position) range.begin = clip(r, (begin - position) / VALUE);
  range.end = clip(r, (end - position + VALUE - 1) / VALUE);
  return range;
}

/* Values of own rows for the parts of all ranks, one rank after the other, to part->own */
static void fill_messages(ms_rank_rows *r, size_t position, const double *component) {
  double *to = r->part->own;
  const double *from = component + r->own;
  int32_t k = 0;
  for (int32_t rank = 0; rank < r->part->ranks->n; rank++) {
    const row_range range = rows_of(r, position, rank);
    const double *start = to;
    if (k > range.begin && range.begin < range.end) /* a row in two parts is sent to both */
      from -= owner_of(r, --k) == r->part->ranks->rank;
    for (; k < range.end; k++)
      if (owner_of(r, k) == r->part->ranks->rank) *to++ = *from++;
    r->part->send_bytes[rank] = (to - start) * (int64_t)VALUE;
  }
}

/* Ranks send the rows of all to those that write them. */
static void write_rows(ms_rank_rows *r, ms_archive *b, const double *component) {
  const ms_rank_part *part = r->part;
  const size_t position = b->position;
  const row_range mine = rows_of(r, position, part->ranks->rank);
  int64_t at = 0;
  fill_messages(r, position, component);
  for (int32_t k = 0; k < part->ranks->n; k++) part->receive_bytes[k] = 0;
  for (int32_t k = mine.begin; k < mine.end; k++) part->receive_bytes[owner_of(r, k)] += VALUE;
  ms_ranks_all_to_all(part->ranks, part->send_bytes, part->own, part->receive_bytes, part->all);
  for (int32_t k = 0; k < part->ranks->n; k++) {
    part->next[k] = at;
    at += part->receive_bytes[k] / VALUE;
  }
  b->position = position + (size_t)mine.begin * VALUE;
  for (int32_t k = mine.begin; k < mine.end && !part->ranks->failed; k++)
    ms_archive_transfer(b, part->all + part->next[owner_of(r, k)]++, VALUE);
  b->position = position + (size_t)r->base.n * VALUE;
}

/*------------------------------------- reading --------------------------------------------------*/

static void read_rows(const ms_rank_rows *r, ms_archive *b, double *component) {
  double *to = component + r->own;
  for (int32_t k = 0; k < r->base.n; k++) {
    if (owner_of(r, k) != r->part->ranks->rank) {
      b->position += VALUE;
      continue;
    }
    ms_archive_transfer(b, to, VALUE);
    ms_archive_check(b, fabs(*to++) <= MS_LARGEST_VALID, "a vector of the state");
  }
}

/*------------------------------------- both -----------------------------------------------------*/

static void transfer_rows(ms_archive *b, double *component) {
  ms_rank_rows *r = (ms_rank_rows *)b->rows;
  if (b->direction == MS_ARCHIVE_WRITE && r->bounds) write_rows(r, b, component);
  else if (b->direction == MS_ARCHIVE_READ) read_rows(r, b, component);
  else b->position += (size_t)r->base.n * VALUE;
}

ms_archive_rows *ms_rank_rows_begin(ms_rank_rows *rows, ms_rank_part *part, const size_t *bounds) {
  *rows = (ms_rank_rows){.base.transfer = transfer_rows, .part = part, .bounds = bounds};
  return part ? &rows->base : NULL;
}

void ms_rank_rows_select(ms_rank_rows *r, int32_t i) {
  const ms_whole_islands *whole = &r->part->whole;
  r->own = i == 0 ? 0 : r->own + r->nown;
  r->first = whole->first[i];
  r->base.n = whole->first[i + 1] - r->first;
  r->nown = 0;
  for (int32_t k = 0; k < r->base.n; k++) r->nown += owner_of(r, k) == r->part->ranks->rank;
}
