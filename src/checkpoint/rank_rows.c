#include "checkpoint/rank_rows.h"

#include <math.h>

static int32_t owner_of(const ms_rank_rows *r, int32_t k) {
  return r->part->owner[r->part->whole.particle[r->first + k]];
}

/* All ranks send what they have, and put the rows of all in order. */
static void gather_rows(ms_rank_rows *r, ms_archive *b, double *component) {
  const ms_rank_part *part = r->part;
  int64_t at = 0;
  ms_ranks_gather_parts(part->ranks, part->island_bytes, component + r->own, part->all);
  for (int32_t k = 0; k < part->ranks->n; k++) {
    part->next[k] = at;
    at += part->island_bytes[k] / (int64_t)sizeof(double);
  }
  for (int32_t k = 0; k < r->base.n && !part->ranks->failed; k++)
    ms_archive_transfer(b, part->all + part->next[owner_of(r, k)]++, sizeof *part->all);
}

static void read_rows(const ms_rank_rows *r, ms_archive *b, double *component) {
  double *to = component + r->own;
  for (int32_t k = 0; k < r->base.n; k++) {
    if (owner_of(r, k) != r->part->ranks->rank) {
      b->position += sizeof *to;
      continue;
    }
    MS_ARCHIVE_TRANSFER(b, *to);
    ms_archive_check(b, fabs(*to++) <= MS_LARGEST_VALID, "a vector of the state");
  }
}

static void transfer_rows(ms_archive *b, double *component) {
  ms_rank_rows *r = (ms_rank_rows *)b->rows;
  if (b->direction == MS_ARCHIVE_WRITE) gather_rows(r, b, component);
  else if (b->direction == MS_ARCHIVE_READ) read_rows(r, b, component);
  else b->position += (size_t)r->base.n * sizeof *component;
}

ms_archive_rows *ms_rank_rows_begin(ms_rank_rows *rows, ms_rank_part *part) {
  *rows = (ms_rank_rows){.base.transfer = transfer_rows, .part = part};
  return part ? &rows->base : NULL;
}

void ms_rank_rows_select(ms_rank_rows *r, int32_t i) {
  const ms_whole_islands *whole = &r->part->whole;
  int64_t *bytes = r->part->island_bytes;
  r->own = i == 0 ? 0 : r->own + r->nown;
  r->first = whole->first[i];
  r->base.n = whole->first[i + 1] - r->first;
  for (int32_t k = 0; k < r->part->ranks->n; k++) bytes[k] = 0;
  for (int32_t k = 0; k < r->base.n; k++) bytes[owner_of(r, k)] += (int64_t)sizeof(double);
  r->nown = (int32_t)(bytes[r->part->ranks->rank] / (int64_t)sizeof(double));
}
