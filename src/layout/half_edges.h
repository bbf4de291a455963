/* half_edges - stores each spring once for each unknown end (as half-edges), so that loops over
 * them gather from neighbours and write to their own rows only
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
 * The half-edges of a row have a fixed order.
 *
 * So f/l is computed twice for each spring. Keeping that of one half-edge for the other, in a ring
 * of as many rows as they are apart, saves a third to a half of the roots and divisions; but with
 * its loads and stores steps take 0.95 to 1.2 times as long in double precision, 1.1 to 1.2 in
 * single (cloth of 32 x 32, lattice of 10^3, AVX2; docs/performance_limits.md). */
#ifndef MS_HALF_EDGES_H
#define MS_HALF_EDGES_H

#include "layout/adjacency.h"

/* Entries of a part of a split row; the cost of its 8 sums is negligible beside so many. */
enum { MS_PART_ENTRIES = 256 };

typedef struct ms_half_edge_entry {
  int32_t start; /* the neighbour of lane l is row start + l; where neighbours are scattered, ~start
                    numbers such entries */
  int32_t value; /* the index of lane 0 in k, rest, damping and stiffness (spring_values.h) */
} ms_half_edge_entry;

typedef struct ms_half_edges {
  int32_t nslices;     /* slices of unknowns: first_pinned / 8 */
  int32_t nparts;      /* of split rows */
  int32_t nentries;    /* entries of 8 half-edges each */
  int32_t nscattered;  /* of these, those whose neighbours are scattered */
  int32_t *first;      /* nslices + nparts + 1: the first entry of each slice range */
  int32_t *first_part; /* first_pinned: the first part of a split row; -1: the row is not split;
                          NULL: none is */
  int32_t *part_row;   /* nparts: the row of each part */
  double *part_sums;   /* 6 x 8 nparts: up to 6 sums per lane, component by component; scratch */
  ms_half_edge_entry *entry;  /* nentries */
  int32_t *scattered;         /* 8 nscattered, at least: their neighbours; padding: any row */
  int32_t *spring;            /* 8 nentries: index in ms_springs; padding: -1 */
  double *k, *rest, *damping; /* nvalues; padding: 0; k: 0 of springs with a law */
  double *stiffness;          /* nvalues: as k, but |df/de| at most of springs with a law */
  size_t nvalues, room;       /* of these arrays: in use; in memory */
} ms_half_edges;

msim_status ms_half_edges_create(const ms_scene *scene, const ms_unknowns *rows,
                                 const ms_springs *springs, const ms_adjacency *a,
                                 ms_half_edges *half_edges, msim_error *err);

/* Sets first_part to 0 for rows that are split, else -1, and counts their parts; nslices is set. */
void ms_half_edges_find_split_rows(const ms_adjacency *a, int32_t nfree, ms_half_edges *out);

void ms_half_edges_destroy(const ms_scene *scene, ms_half_edges *half_edges);

/* Add the sums that the kernels left in part_sums to the split rows of a vector, part by part. */
void ms_half_edges_add_part_sums(const ms_half_edges *half_edges, int32_t components, size_t stride,
                                 double *vec);

/* Positions of a row's half-edges: begin, begin + step, ... below end, neighbours ascending, with
 * padding between them. */
typedef struct ms_half_edge_span {
  int32_t begin, end, step;
} ms_half_edge_span;

static inline int ms_half_edges_is_split(const ms_half_edges *h, int32_t row) {
  return h->first_part && h->first_part[row] >= 0;
}

static inline ms_half_edge_span ms_half_edges_of_row(const ms_half_edges *h, int32_t row) {
  const int32_t g = row / MS_SLICE, lane = row % MS_SLICE;
  if (!ms_half_edges_is_split(h, row))
    return (ms_half_edge_span){MS_SLICE * h->first[g] + lane, MS_SLICE * h->first[g + 1], MS_SLICE};
  const int32_t part = h->first_part[row];
  int32_t last = part;
  while (last < h->nparts && h->part_row[last] == row) last++;
  return (ms_half_edge_span){MS_SLICE * h->first[h->nslices + part],
                             MS_SLICE * h->first[h->nslices + last], 1};
}

/* The neighbours in an entry where they are scattered */
static inline const int32_t *ms_half_edges_scattered(const ms_half_edges *h, int32_t start) {
  return h->scattered + MS_SLICE * (size_t)~start;
}

/* The row at the other end of a half-edge; padding: any row */
static inline int32_t ms_half_edges_neighbour(const ms_half_edges *h, int32_t half_edge) {
  const int32_t start = h->entry[half_edge / MS_SLICE].start, lane = half_edge % MS_SLICE;
  return start >= 0 ? start + lane : ms_half_edges_scattered(h, start)[lane];
}

/* The index of a half-edge in k, rest, damping and stiffness */
static inline size_t ms_half_edges_value(const ms_half_edges *h, int32_t half_edge) {
  return (size_t)h->entry[half_edge / MS_SLICE].value + (size_t)(half_edge % MS_SLICE);
}

static inline int32_t ms_half_edges_count_ranges(const ms_half_edges *h) {
  return h->nslices + h->nparts;
}

#endif
