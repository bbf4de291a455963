/* adjacency - lists the springs of each particle of an island by the particle at the other end */
#ifndef MS_ADJACENCY_H
#define MS_ADJACENCY_H

#include "layout/unknowns.h"

/* A half-edge of a row: a spring of it and the row at the other end. */
typedef struct ms_half_edge {
  int32_t neighbour, spring;
} ms_half_edge;

typedef struct ms_adjacency {
  int32_t *first;           /* stride + 1 */
  ms_half_edge *half_edges; /* of each row, pinned ones too: sorted by neighbour, then by spring;
                               in a rank's part of a scene, as in one process */
  uint8_t *is_split;        /* stride: rows to be split (half_edges.h); NULL: where worthwhile */
} ms_adjacency;

msim_status ms_adjacency_create(const ms_scene *scene, const ms_unknowns *rows,
                                const ms_springs *springs, ms_adjacency *a, msim_error *err);

void ms_adjacency_destroy(const ms_scene *scene, ms_adjacency *a);

static inline int32_t ms_adjacency_degree(const ms_adjacency *a, int32_t row) {
  return a->first[row + 1] - a->first[row];
}

#endif
