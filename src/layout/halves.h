/* halves - stores each spring once for each unknown end (as half-edges), so that loops over them
 * gather from neighbours and write to their own rows only
 *
 * The format is sliced ELLPACK (Monakov, Lokhmotov and Avetisyan 2010):
 *   entry        up to 8 half-edges, one per lane;
 *   slice        8 consecutive rows: lane l of its entries belongs to its row l. Wherever the order
 *                of the mesh allows it, the neighbours in an entry are consecutive rows, which one
 *                vector load reads;
 *   split row    a row with many more springs than others of its slice: its half-edges fill all
 *                lanes of entries of its own, in parts that threads can share; the 8 sums of each
 *                part are added to the row at the end. A star of 1e5 springs takes 1.0 lanes per
 *                half-edge instead of 4.5, and a third of the time;
 *   slice range  the entries of a slice or of a part of a split row. All slices come first.
 * The half-edges of a row have a fixed order. */
#ifndef MS_HALVES_H
#define MS_HALVES_H

#include "layout/adjacency.h"

/* Entries of a part of a split row; the cost of its 8 sums is negligible beside so many. */
enum { MS_PART = 256 };

typedef struct ms_halves {
  int32_t ngroups;    /* slices of unknowns: first_pinned / 8 */
  int32_t nparts;     /* of split rows */
  int32_t nslots;     /* entries of 8 half-edges each */
  int32_t *first;     /* ngroups + nparts + 1: the first entry of each slice range */
  int32_t *part;      /* first_pinned: the first part of a split row; -1: the row is not split */
  int32_t *part_row;  /* nparts: the row of each part */
  double *part_sums;  /* 6 x 8 nparts: up to 6 sums per lane, component by component; scratch */
  int32_t *start;     /* nslots: the neighbour of lane l is row start + l; -1: see neighbour */
  int32_t *neighbour; /* 8 nslots: the row at the other end; padding: any row */
  int32_t *spring;    /* 8 nslots: index in ms_springs; padding: -1 */
  double *k, *rest, *damping; /* 8 nslots; padding: 0 */
} ms_halves;

msim_status ms_halves_create(const ms_scene *scene, const ms_rows *rows, const ms_springs *springs,
                             const ms_adjacency *a, ms_halves *halves, msim_error *err);

/* Copy k, rest and damping from the springs again. */
void ms_halves_update(const ms_springs *springs, ms_halves *halves);
void ms_halves_destroy(const ms_scene *scene, ms_halves *halves);

/* Add the sums that the kernels left in part_sums to the split rows of a vector, part by part. */
void ms_halves_add_parts(const ms_halves *halves, int32_t components, size_t stride, double *vec);

/* Positions of a row's half-edges: begin, begin + step, ... below end, neighbours ascending, with
 * padding between them. */
typedef struct ms_span {
  int32_t begin, end, step;
} ms_span;

static inline ms_span ms_halves_of(const ms_halves *h, int32_t row) {
  const int32_t part = h->part[row], g = row / MS_GROUP, lane = row % MS_GROUP;
  if (part < 0)
    return (ms_span){MS_GROUP * h->first[g] + lane, MS_GROUP * h->first[g + 1], MS_GROUP};
  int32_t last = part;
  while (last < h->nparts && h->part_row[last] == row) last++;
  return (ms_span){MS_GROUP * h->first[h->ngroups + part], MS_GROUP * h->first[h->ngroups + last],
                   1};
}

/* Threads share the slice ranges in chunks of `size`: the number of chunks, and the end of chunk k.
 */
static inline int32_t ms_chunks(const ms_halves *h, int32_t size) {
  return (h->ngroups + h->nparts + size - 1) / size;
}

static inline int32_t ms_chunk_end(const ms_halves *h, int32_t size, int32_t k) {
  const int32_t n = h->ngroups + h->nparts;
  return n - size * k < size ? n : size * (k + 1);
}

#endif
