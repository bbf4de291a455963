/* halves - every spring seen from each of its unknown ends, for loops that gather and never scatter
 *
 * A slot holds up to 8 half springs, one a lane. Rows come in groups of 8: lane l of the slots of a
 * group is its row l (sliced ELLPACK; Monakov, Lokhmotov and Avetisyan 2010). They are filled so
 * that neighbours of consecutive rows are consecutive rows wherever the mesh has any such order:
 * these are read by one vector load. A row with many more springs than others of its group is long:
 * its halves lie across all lanes of slots of its own, in parts that threads can share; the 8 sums
 * of each part are added to the row at the end. A star with 1e5 springs takes 1.0 lanes a half, not
 * 4.5, and a third of the time.
 *
 * So slots come in segments: the groups, then the parts. Each row meets its halves in one fixed
 * order. */
#ifndef MS_HALVES_H
#define MS_HALVES_H

#include "layout/adjacency.h"

/* Slots of a part: long enough that its 8 sums cost nothing beside it. */
enum { MS_PART = 256 };

typedef struct ms_halves {
  int32_t ngroups;    /* first_pinned / 8: the unknowns */
  int32_t nparts;     /* of long rows */
  int32_t nslots;     /* of 8 halves each */
  int32_t *first;     /* ngroups + nparts + 1: the first slot of each segment */
  int32_t *part;      /* first_pinned: the first part of a long row; else -1 */
  int32_t *part_row;  /* nparts: whose part it is */
  double *part_sums;  /* 6 x 8 nparts: up to 6 sums a lane, component-wise; scratch of kernels */
  int32_t *start;     /* nslots: the neighbour of lane l is row start + l; -1: see neighbour */
  int32_t *neighbour; /* 8 nslots: the row at the other end; padding: any row */
  int32_t *spring;    /* 8 nslots: its index in ms_springs; padding: -1 */
  double *k, *rest, *damping; /* 8 nslots; padding: 0 */
} ms_halves;

msim_status ms_halves_create(const ms_scene *scene, const ms_rows *rows, const ms_springs *springs,
                             const ms_adjacency *a, ms_halves *halves, msim_error *err);

/* Take k, rest and damping from the springs again. */
void ms_halves_update(const ms_springs *springs, ms_halves *halves);
void ms_halves_destroy(const ms_scene *scene, ms_halves *halves);

/* Add what the kernels left in part_sums to the long rows of a vector, part by part. */
void ms_halves_add_parts(const ms_halves *halves, int32_t components, size_t stride, double *vec);

/* Where a row's halves lie: at = begin, begin + step, ... below end, neighbours ascending, with
 * padding among them. */
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

/* Work on segments is cut into chunks of so many: how many chunks, and where the k-th ends. */
static inline int32_t ms_chunks(const ms_halves *h, int32_t size) {
  return (h->ngroups + h->nparts + size - 1) / size;
}

static inline int32_t ms_chunk_end(const ms_halves *h, int32_t size, int32_t k) {
  const int32_t n = h->ngroups + h->nparts;
  return n - size * k < size ? n : size * (k + 1);
}

#endif
