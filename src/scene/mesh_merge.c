#include "scene/mesh_merge.h"

#include <math.h>
#include <string.h>

#define MERGE_TOLERANCE 1e-6 /* of the diagonal */

/* A hash table of cubic cells as wide as the tolerance: vertices within it are in the same cell or
 * in one of its 26 neighbours. Lengths are in units of the largest extent, so that their squares
 * neither overflow nor underflow. */
typedef struct hash_grid {
  double low[3], unit;
  double tolerance, cell;
  uint64_t mask; /* number of chains less 1 */
  int32_t
      *chain;    /* mask + 1: the last representative with that hash; 0: none, else its index + 1 */
  int32_t *next; /* n: of the same chain */
  double *u;     /* 3 n: (x - low) / unit */
} hash_grid;

static void measure(hash_grid *g, int32_t n, const double *x, const int32_t *representative) {
  double high[3], squares = 0;
  for (int c = 0; c < 3; c++) g->low[c] = INFINITY, high[c] = -INFINITY;
  for (int32_t v = 0; v < n; v++)
    for (int c = 0; c < 3 && representative[v] >= 0; c++) {
      g->low[c] = fmin(g->low[c], x[3 * (size_t)v + (size_t)c]);
      high[c] = fmax(high[c], x[3 * (size_t)v + (size_t)c]);
    }
  g->unit = fmax(fmax(high[0] - g->low[0], high[1] - g->low[1]), high[2] - g->low[2]);
  if (!(g->unit > 0)) g->unit = 1;
  for (int c = 0; c < 3; c++) squares += pow((high[c] - g->low[c]) / g->unit, 2);
  g->tolerance = MERGE_TOLERANCE * sqrt(squares);
  g->cell = g->tolerance > 0 ? g->tolerance : 1;
}

/* Multiplicative hashing of three coordinates (Teschner et al. 2003, section 3.1), with the high
 * bits mixed into those that are used. */
static uint64_t hash_cell(const hash_grid *g, const int64_t cell[3]) {
  const uint64_t h =
      (uint64_t)cell[0] * 73856093u ^ (uint64_t)cell[1] * 19349663u ^ (uint64_t)cell[2] * 83492791u;
  return (h ^ h >> 17) & g->mask;
}

/* The least representative in a chain within the tolerance of vertex v, if below `least`. */
static int32_t search_chain(const hash_grid *g, uint64_t hash, int32_t v, int32_t least) {
  const double *u = g->u + 3 * (size_t)v;
  for (int32_t r = g->chain[hash] - 1; r >= 0; r = g->next[r] - 1) {
    const double *w = g->u + 3 * (size_t)r;
    const double d[3] = {u[0] - w[0], u[1] - w[1], u[2] - w[2]};
    if (r < least && d[0] * d[0] + d[1] * d[1] + d[2] * d[2] <= g->tolerance * g->tolerance)
      least = r;
  }
  return least;
}

static int32_t find_representative(hash_grid *g, int32_t v) {
  int64_t at[3], cell[3];
  for (int c = 0; c < 3; c++) at[c] = (int64_t)(g->u[3 * (size_t)v + (size_t)c] / g->cell);
  int32_t least = v;
  for (cell[0] = at[0] - 1; cell[0] <= at[0] + 1; cell[0]++)
    for (cell[1] = at[1] - 1; cell[1] <= at[1] + 1; cell[1]++)
      for (cell[2] = at[2] - 1; cell[2] <= at[2] + 1; cell[2]++)
        least = search_chain(g, hash_cell(g, cell), v, least);
  if (least < v) return least;
  const uint64_t hash = hash_cell(g, at);
  g->next[v] = g->chain[hash];
  g->chain[hash] = v + 1;
  return v;
}

static int allocate(const msim_allocator *alloc, int32_t n, hash_grid *g) {
  g->mask = 1;
  while (g->mask < (uint64_t)n) g->mask = 2 * g->mask + 1;
  return MS_NEW(alloc, g->chain, g->mask + 1) && MS_NEW(alloc, g->next, n) &&
         MS_NEW(alloc, g->u, 3 * (size_t)n);
}

int ms_mesh_merge(const msim_allocator *alloc, int32_t n, const double *x, int32_t *representative,
                  double *tolerance, msim_mesh_repairs *repairs) {
  hash_grid g = {0};
  const int ok = allocate(alloc, n, &g);
  if (ok) measure(&g, n, x, representative);
  for (int32_t v = 0; v < n && ok; v++) {
    const double *at = x + 3 * (size_t)v;
    if (representative[v] < 0) continue;
    for (size_t c = 0; c < 3; c++) g.u[3 * (size_t)v + c] = (at[c] - g.low[c]) / g.unit;
    representative[v] = find_representative(&g, v);
    if (representative[v] == v) continue;
    const double *to = x + 3 * (size_t)representative[v];
    if (at[0] == to[0] && at[1] == to[1] && at[2] == to[2]) repairs->equal_vertices++;
    else repairs->near_vertices++;
  }
  *tolerance = g.tolerance * g.unit;
  MS_FREE(alloc, g.chain, g.next, g.u);
  return ok;
}
