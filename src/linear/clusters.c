#include "linear/clusters.h"

/*------------------------------------- growth ---------------------------------------------------*/

/* State of the growth of clusters, one after the other */
typedef struct growth {
  const ms_incidence *graph;
  ms_cluster_size size;
  int32_t *of;                       /* n: the cluster of each node; -1: none yet */
  int32_t *seeds, next_seed, nseeds; /* nodes at borders, oldest first */
  uint8_t *is_seed;                  /* n: 1 if among the seeds */
  int32_t *candidate, ncandidates;   /* nodes adjacent to the present cluster */
  int32_t *distance, *links;         /* n: from the seed; edges to members */
  int32_t *mark;                     /* n: the cluster to which these refer */
} growth;

/* Bounds the cost at a hub, a node with very many edges. */
enum { MOST_CANDIDATES = 1024 };

/* The node at the other end of the e-th half-edge */
static int32_t neighbour(const growth *g, int32_t e) {
  return g->graph->row[g->graph->of.item[e] ^ 1];
}

static void add_candidate(growth *g, int32_t cluster, int32_t row, int32_t distance) {
  if (g->of[row] >= 0) return;
  if (!g->is_seed[row]) g->is_seed[row] = 1, g->seeds[g->nseeds++] = row;
  if (g->mark[row] == cluster) {
    g->links[row]++;
  } else if (g->ncandidates < MOST_CANDIDATES) {
    g->mark[row] = cluster, g->distance[row] = distance, g->links[row] = 1;
    g->candidate[g->ncandidates++] = row;
  }
}

/* Remove and return the candidate nearest to the seed, of several the one with most edges to the
 * cluster, so that clusters are round. */
static int32_t take_best(growth *g) {
  int32_t best = 0;
  for (int32_t c = 1; c < g->ncandidates; c++) {
    const int32_t p = g->candidate[c], q = g->candidate[best];
    if (g->distance[p] < g->distance[q] ||
        (g->distance[p] == g->distance[q] && g->links[p] > g->links[q]))
      best = c;
  }
  const int32_t row = g->candidate[best];
  g->candidate[best] = g->candidate[--g->ncandidates];
  return row;
}

static void grow(growth *g, int32_t cluster, int32_t seed) {
  g->ncandidates = 0;
  add_candidate(g, cluster, seed, 0);
  for (int32_t members = 0; members < g->size.complete && g->ncandidates; members++) {
    const int32_t row = take_best(g);
    g->of[row] = cluster;
    for (int32_t e = g->graph->of.first[row]; e < g->graph->of.first[row + 1]; e++)
      add_candidate(g, cluster, neighbour(g, e), g->distance[row] + 1);
  }
}

/* Seeds are adjacent to earlier clusters, so that few gaps remain. Returns how many clusters. */
static int32_t grow_clusters(growth *g, int32_t n) {
  int32_t clusters = 0;
  for (int32_t r = 0; r < n; r++) {
    const int is_alone = g->graph->of.first[r] == g->graph->of.first[r + 1];
    if (g->of[r] >= 0 || (is_alone && g->size.least > 1)) continue;
    grow(g, clusters++, r);
    for (; g->next_seed < g->nseeds; g->next_seed++)
      if (g->of[g->seeds[g->next_seed]] < 0) grow(g, clusters++, g->seeds[g->next_seed]);
  }
  return clusters;
}

/*------------------------------------- small clusters -------------------------------------------*/

/* Merge each small cluster, grown in a gap, with an adjacent larger one, up to 2 size members, so
 * that clusters stay connected. If there is none, as beside a hub, and the cluster is too
 * small, it is dissolved. into: scratch */
static void merge_small_clusters(const growth *g, int32_t n, int32_t *members, int32_t *into) {
  for (int32_t k = 0; k < n; k++) into[k] = k;
  for (int32_t r = 0; r < n; r++) {
    const int32_t own = g->of[r];
    if (own < 0 || members[own] > g->size.complete / 4 || into[own] != own) continue;
    for (int32_t e = g->graph->of.first[r]; e < g->graph->of.first[r + 1]; e++) {
      const int32_t other = into[g->of[neighbour(g, e)]];
      if (members[other] <= g->size.complete / 4 ||
          members[other] + members[own] > 2 * g->size.complete)
        continue;
      into[own] = other;
      members[other] += members[own];
      break;
    }
  }
  for (int32_t r = 0; r < n; r++) {
    if (g->of[r] >= 0) g->of[r] = into[g->of[r]];
    if (g->of[r] >= 0 && members[g->of[r]] < g->size.least) g->of[r] = -1;
  }
}

/* Number the remaining clusters by their first nodes. number: scratch, 0. Returns how many. */
static int32_t number_clusters(int32_t n, int32_t *of, int32_t *number) {
  int32_t clusters = 0;
  for (int32_t r = 0; r < n; r++) {
    if (of[r] < 0) continue;
    if (number[of[r]] == 0) number[of[r]] = ++clusters;
    of[r] = number[of[r]] - 1;
  }
  return clusters;
}

int32_t ms_clusters_grow(const msim_allocator *alloc, const ms_incidence *graph, int32_t n,
                         ms_cluster_size size, int32_t *of, ms_buckets *members) {
  const size_t count = (size_t)n;
  growth g = {.graph = graph, .size = size, .of = of};
  int32_t *sizes = NULL, clusters = -1;
  if (MS_NEW(alloc, g.seeds, n) && MS_NEW(alloc, g.distance, n) && MS_NEW(alloc, g.links, n) &&
      MS_NEW(alloc, g.mark, n) && MS_NEW(alloc, g.candidate, MOST_CANDIDATES) &&
      MS_NEW(alloc, g.is_seed, n) && MS_NEW(alloc, sizes, 3 * count)) {
    for (int32_t r = 0; r < n; r++) of[r] = g.mark[r] = -1;
    grow_clusters(&g, n);
    for (int32_t r = 0; r < n; r++)
      if (of[r] >= 0) sizes[of[r]]++;
    merge_small_clusters(&g, n, sizes, sizes + count);
    clusters = number_clusters(n, of, sizes + 2 * count);
    if (!ms_buckets_create(alloc, n, of, clusters, members)) {
      ms_buckets_destroy(alloc, members);
      clusters = -1;
    }
  }
  MS_FREE(alloc, g.seeds, g.distance, g.links, g.mark, g.candidate, g.is_seed, sizes);
  return clusters;
}
