/* clusters - connected sets of about the same number of nodes of a graph, without geometry */
#ifndef MS_CLUSTERS_H
#define MS_CLUSTERS_H

#include "layout/incidence.h"

/* Nodes in a cluster */
typedef struct ms_cluster_size {
  int32_t complete; /* at this size a cluster grows no further; it may become twice as large when it
                       is merged with smaller ones */
  int32_t least;    /* smaller ones are dissolved; 1: also nodes without edges are clusters */
} ms_cluster_size;

/* of: n, the cluster of each node; -1: none. members: the nodes of each
 * cluster, ascending; clusters are numbered by their first nodes. Returns the number of clusters,
 * or -1 if memory is exhausted. */
int32_t ms_clusters_grow(const msim_allocator *alloc, const ms_incidence *graph, int32_t n,
                         ms_cluster_size size, int32_t *of, ms_buckets *members);

#endif
