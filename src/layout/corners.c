#include "layout/corners.h"

/* The corners of the rows of a slice that are still to be placed */
typedef struct corner_cursors {
  const int32_t *next[MS_SLICE], *end[MS_SLICE];
  const int32_t *place;
  int32_t row; /* of lane 0 */
} corner_cursors;

static corner_cursors begin_rows(const ms_buckets *at, const int32_t *place, int32_t nfree,
                                 int32_t slice) {
  corner_cursors h = {.place = place, .row = MS_SLICE * slice};
  for (int32_t lane = 0; lane < MS_SLICE && h.row + lane < nfree; lane++) {
    h.next[lane] = at->item + at->first[h.row + lane];
    h.end[lane] = at->item + at->first[h.row + lane + 1];
  }
  return h;
}

/* The place of the next corner of a lane, relative to that of lane 0 in a run; -1: none is left */
static int32_t next_offset(const corner_cursors *h, int32_t lane) {
  return h->next[lane] == h->end[lane] ? -1 : h->place[*h->next[lane]] - lane + MS_SLICE;
}

static int32_t find_least(const corner_cursors *h) {
  int32_t least = -1;
  for (int32_t lane = 0; lane < MS_SLICE; lane++) {
    const int32_t offset = next_offset(h, lane);
    if (offset >= 0 && (least < 0 || offset < least)) least = offset;
  }
  return least;
}

/* Take the places of the next entry, `empty` in lanes without; aligned: only those of a run.
 * Returns 0 if no corner is left. */
static int take_places(corner_cursors *h, int aligned, int32_t empty, int32_t to[MS_SLICE]) {
  const int32_t least = find_least(h);
  for (int32_t lane = 0; lane < MS_SLICE && least >= 0; lane++) {
    const int32_t offset = next_offset(h, lane);
    to[lane] = empty;
    if (offset >= 0 && (!aligned || offset == least)) to[lane] = h->place[*h->next[lane]++];
  }
  return least >= 0;
}

static int32_t count_entries(corner_cursors h, int aligned) {
  int32_t n = 0, to[MS_SLICE];
  while (take_places(&h, aligned, 0, to)) n++;
  return n;
}

/* Entries of runs leave lanes empty where the mesh is irregular: they may be 1.5 times as many. */
static int is_aligned(corner_cursors h) {
  return 2 * count_entries(h, 1) <= 3 * count_entries(h, 0);
}

static int32_t find_start(const int32_t place[MS_SLICE]) {
  for (int32_t lane = 1; lane < MS_SLICE; lane++)
    if (place[lane] != place[0] + lane) return -1;
  return place[0];
}

int ms_corners_create(const msim_allocator *alloc, const ms_unknowns *rows, const ms_buckets *at,
                      const int32_t *place, int32_t empty, ms_corners *c) {
  *c = (ms_corners){.nslices = rows->first_pinned / MS_SLICE};
  if (!MS_NEW(alloc, c->first, c->nslices + 1)) return 0;
  for (int32_t s = 0; s < c->nslices; s++) {
    const corner_cursors h = begin_rows(at, place, rows->nfree, s);
    c->first[s + 1] = c->first[s] + count_entries(h, is_aligned(h));
  }
  const size_t n = (size_t)c->first[c->nslices];
  if (!MS_NEW(alloc, c->start, n) || !MS_NEW(alloc, c->place, MS_SLICE * n)) return 0;
  for (int32_t s = 0; s < c->nslices; s++) {
    corner_cursors h = begin_rows(at, place, rows->nfree, s);
    const int aligned = is_aligned(h);
    for (size_t e = (size_t)c->first[s]; e < (size_t)c->first[s + 1]; e++) {
      take_places(&h, aligned, empty, c->place + MS_SLICE * e);
      c->start[e] = find_start(c->place + MS_SLICE * e);
    }
  }
  return 1;
}

void ms_corners_destroy(const msim_allocator *alloc, ms_corners *c) {
  MS_FREE(alloc, c->first, c->start, c->place);
  *c = (ms_corners){0};
}
