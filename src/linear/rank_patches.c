#include "linear/rank_patches.h"

#include <math.h>
#include <string.h>

#include "base/disjoint_sets.h"
#include "linear/modes.h"

/* A component of the springs between own unknowns, at its root */
typedef struct component {
  int32_t size, patch;
  int crosses; /* 1: springs join it with unknowns of other ranks */
} component;

static void join_neighbours(const ms_model *model, int32_t *root, component *all) {
  const ms_unknowns *rows = &model->unknowns;
  for (int32_t r = 0; r < rows->nfree; r++) {
    const ms_half_edge_span span = ms_half_edges_of_row(&model->half_edges, r);
    for (int32_t at = span.begin; at < span.end; at += span.step) {
      const int32_t other = ms_half_edges_neighbour(&model->half_edges, at);
      if (model->half_edges.spring[at] < 0 || other >= rows->first_fixed) continue;
      if (other < rows->nfree) ms_disjoint_sets_join(root, r, other);
      else if (other >= rows->first_pinned) all[r].crosses = 1;
    }
  }
}

static void join_corners(const ms_model *model, int32_t *root) {
  for (int32_t e = 0; e < model->angles.n; e++) {
    const int32_t *row = model->angles.row + 3 * (size_t)e;
    for (int k = 1; k < 3; k++)
      if (row[0] < model->unknowns.nfree && row[k] < model->unknowns.nfree)
        ms_disjoint_sets_join(root, row[0], row[k]);
  }
}

/* The root of the largest component without a patch, of those that cross; -1: there is none */
static int32_t find_largest(int32_t n, const component *all, int must_cross) {
  int32_t largest = -1, size = 0;
  for (int32_t r = 0; r < n; r++)
    if (all[r].size > size && all[r].patch < 0 && (all[r].crosses || !must_cross))
      largest = r, size = all[r].size;
  return largest;
}

int32_t ms_rank_patches_find(const ms_model *model, int32_t *of) {
  const msim_allocator *alloc = &model->scene->alloc;
  const int32_t n = model->unknowns.nfree;
  int32_t npatches = 0, next;
  component *all = NULL;
  if (!MS_NEW(alloc, all, n)) return 0;
  for (int32_t r = 0; r < n; r++) of[r] = r;
  join_neighbours(model, of, all);
  join_corners(model, of);
  for (int32_t r = 0; r < n; r++) {
    component *c = &all[ms_disjoint_sets_find_root(of, r)];
    c->size++;
    c->crosses |= all[r].crosses;
    all[r].patch = -1;
  }
  while (npatches < MS_MOST_BODIES && (next = find_largest(n, all, 1)) >= 0)
    all[next].patch = npatches++;
  for (int32_t r = 0; r < n; r++) /* the other ones share the last patch */
    if (all[r].size > 0 && all[r].crosses && all[r].patch < 0) all[r].patch = MS_MOST_BODIES - 1;
  if (npatches == 0 && (next = find_largest(n, all, 0)) >= 0) all[next].patch = 0;
  for (int32_t r = 0; r < n; r++) of[r] = ms_disjoint_sets_find_root(of, r);
  for (int32_t r = 0; r < n; r++) of[r] = all[of[r]].patch;
  ms_memory_free(alloc, all);
  return npatches > 0 ? npatches : 1;
}

/*------------------------------------- splitting ------------------------------------------------*/

/* The number of items of a patch along an axis, their bounds and the sum of their coordinates */
typedef struct extent {
  int32_t n;
  double low, high, sum;
} extent;

static double coordinate(const ms_rank_places *at, int32_t item, size_t axis) {
  return at->x[3 * (size_t)at->particle[item] + axis];
}

static extent find_extent(const ms_rank_places *at, const int32_t *of, int32_t patch, size_t axis) {
  extent e = {.low = INFINITY, .high = -INFINITY};
  for (int32_t i = 0; i < at->n; i++) {
    if (of[i] != patch) continue;
    const double x = coordinate(at, i, axis);
    e.n++, e.low = fmin(e.low, x), e.high = fmax(e.high, x), e.sum += x;
  }
  return e;
}

static int32_t find_most_items(int32_t npatches, const ms_rank_places *at, const int32_t *of) {
  int32_t items[MS_MOST_PATCHES] = {0}, most = 0;
  for (int32_t i = 0; i < at->n; i++)
    if (of[i] >= 0) items[of[i]]++;
  for (int32_t p = 1; p < npatches; p++)
    if (items[p] > items[most]) most = p;
  return most;
}

/* Patches up to which those of `items` items are split: of a rank, and of all. In small scenes the
 * matrix of all patches would take more time than it saves. */
static int32_t most_patches(int32_t items, int32_t nranks) {
  enum { LEAST = 8, LARGE = 48 };
  const int32_t most = items < LARGE ? 16 : MS_MOST_PATCHES, of_all = items < LARGE ? 128 : 256;
  return items < LEAST ? 0 : most < of_all / nranks ? most : of_all / nranks;
}

int32_t ms_rank_patches_split(int32_t npatches, int32_t nranks, ms_rank_places at, int32_t *of) {
  for (; npatches < MS_MOST_PATCHES; npatches++) {
    const int32_t split = find_most_items(npatches, &at, of);
    extent longest = find_extent(&at, of, split, 0);
    size_t axis = 0;
    for (size_t c = 1; c < 3; c++) {
      const extent e = find_extent(&at, of, split, c);
      if (e.high - e.low > longest.high - longest.low) longest = e, axis = c;
    }
    if (npatches >= most_patches(longest.n, nranks) || !(longest.high > longest.low)) break;
    /* below the highest one also where the mean is rounded up */
    const double cut = fmin(longest.sum / longest.n, nextafter(longest.high, longest.low));
    for (int32_t i = 0; i < at.n; i++)
      if (of[i] == split && coordinate(&at, i, axis) > cut) of[i] = npatches;
  }
  return npatches;
}

/*------------------------------------- functions ------------------------------------------------*/

void ms_rank_patches_orthonormalise(int32_t npatches, const int32_t *of, int32_t each, int32_t n,
                                    double (*v)[MS_MODES], double (*room)[MS_MODES]) {
  for (int32_t p = -1; p < npatches; p++) {
    int32_t count = 0;
    for (int32_t i = 0; i < n; i++)
      if (of[i / each] == p) memcpy(room[count++], v[i], sizeof *v);
    const int known = p < 0 || count == 0 ? 0 : ms_modes_orthonormalise_coordinates(count, room);
    count = 0;
    for (int32_t i = 0; i < n; i++) {
      if (of[i / each] != p) continue;
      for (int k = 0; k < MS_MODES; k++) v[i][k] = k < known ? room[count][k] : 0;
      count++;
    }
  }
}
