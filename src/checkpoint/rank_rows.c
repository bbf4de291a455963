#include "checkpoint/rank_rows.h"

#include <math.h>

enum { VALUE = sizeof(double), ROW = sizeof(ms_placed_row) };

/* The place of own row k of the island in a component */
static int32_t place_of(const ms_rank_rows *r, int32_t k) {
  return r->part->place[r->own + k] - r->first;
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

/* The parts have so many pieces that each piece of a part has most_received rows at most. */
static int32_t count_pieces(const ms_rank_rows *r, size_t position) {
  int32_t most = 0;
  for (int32_t rank = 0; rank < r->part->ranks->n; rank++) {
    const row_range range = rows_of(r, position, rank);
    if (range.end - range.begin > most) most = range.end - range.begin;
  }
  return (most + r->part->most_received - 1) / r->part->most_received;
}

static row_range piece_of(row_range all, int32_t piece, int32_t npieces) {
  const int64_t n = all.end - all.begin;
  return (row_range){all.begin + (int32_t)(n * piece / npieces),
                     all.begin + (int32_t)(n * (piece + 1) / npieces)};
}

/* The first own row at or behind a place */
static int32_t find_own(const ms_rank_rows *r, int32_t place) {
  int32_t low = 0, high = r->nown;
  while (low < high) {
    const int32_t middle = low + (high - low) / 2;
    if (place_of(r, middle) < place) low = middle + 1;
    else high = middle;
  }
  return low;
}

/* Own rows in a piece of the part of each rank; a row in two parts is sent to both. */
static void fill_messages(const ms_rank_rows *r, size_t position, const double *component,
                          int32_t piece, int32_t npieces) {
  ms_rank_part *part = r->part;
  ms_placed_row *to = part->send;
  for (int32_t rank = 0; rank < part->ranks->n; rank++) {
    const row_range range = piece_of(rows_of(r, position, rank), piece, npieces);
    const ms_placed_row *start = to;
    for (int32_t k = find_own(r, range.begin); k < r->nown && place_of(r, k) < range.end; k++)
      *to++ = (ms_placed_row){place_of(r, k), component[r->own + k]};
    part->send_bytes[rank] = (to - start) * (int64_t)ROW;
  }
}

/* Ranks send rows to those that write them. Returns the number of rows that this rank received. */
static int64_t exchange_rows(ms_rank_part *part) {
  int64_t n = 0;
  for (int32_t k = 0; k < part->ranks->n; k++) part->next[k] = sizeof *part->next;
  ms_ranks_all_to_all(part->ranks, part->next, part->send_bytes, part->next, part->receive_bytes);
  if (part->ranks->failed) return 0;
  for (int32_t k = 0; k < part->ranks->n; k++) n += part->receive_bytes[k] / ROW;
  ms_ranks_all_to_all(part->ranks, part->send_bytes, part->send, part->receive_bytes,
                      part->receive);
  return part->ranks->failed ? 0 : n;
}

static void write_rows(const ms_rank_rows *r, ms_archive *b, const double *component) {
  ms_rank_part *part = r->part;
  const size_t position = b->position;
  const int32_t npieces = count_pieces(r, position);
  for (int32_t piece = 0; piece < npieces; piece++) {
    fill_messages(r, position, component, piece, npieces);
    const int64_t n = exchange_rows(part);
    for (int64_t i = 0; i < n; i++) {
      b->position = position + (size_t)part->receive[i].place * VALUE;
      ms_archive_transfer(b, &part->receive[i].value, VALUE);
    }
  }
  b->position = position + (size_t)r->base.n * VALUE;
}

/*------------------------------------- reading --------------------------------------------------*/

static void read_rows(const ms_rank_rows *r, ms_archive *b, double *component) {
  const size_t position = b->position;
  for (int32_t k = 0; k < r->nown; k++) {
    double *to = component + r->own + k;
    b->position = position + (size_t)place_of(r, k) * VALUE;
    ms_archive_transfer(b, to, VALUE);
    ms_archive_check(b, fabs(*to) <= MS_LARGEST_VALID, "a vector of the state");
  }
  b->position = position + (size_t)r->base.n * VALUE;
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
  const int32_t nown = (int32_t)ms_rank_part_count(r->part, r->part->ranks->rank);
  r->own = i == 0 ? 0 : r->own + r->nown;
  r->first = whole->first[i];
  r->base.n = whole->first[i + 1] - r->first;
  r->nown = 0;
  while (r->own + r->nown < nown && r->part->place[r->own + r->nown] < whole->first[i + 1])
    r->nown++;
}
