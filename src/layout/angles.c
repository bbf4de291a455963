#include "layout/angles.h"

#include "layout/rank_order.h"
#include "scene/angles.h"

/*------------------------------------- order ----------------------------------------------------*/

/* The row of corner q of the island's angle e */
static int32_t corner_row(const ms_scene *scene, const ms_island *island, int32_t e, int q) {
  return island->row_scratch[scene->angles.ijk[3 * (size_t)island->angle[e] + (size_t)q]];
}

/* By their index among the angles of their vertex, which are sorted by the rows of i, then by
 * rows */
int ms_angles_sort(const ms_scene *scene, const ms_island *island, const ms_unknowns *rows,
                   int32_t *angle) {
  const msim_allocator *alloc = &scene->alloc;
  const int32_t n = island->nangles;
  ms_buckets by_end = {0}, by_vertex = {0}, by_index = {0};
  int32_t *to = ms_memory_allocate(alloc, (size_t)n, sizeof *to), indices = 0;
  int fits = to != NULL;
  for (int32_t e = 0; e < n && fits; e++) to[e] = corner_row(scene, island, e, 0);
  fits = fits && ms_buckets_create(alloc, n, to, rows->stride, &by_end);
  for (int32_t e = 0; e < n && fits; e++) to[e] = corner_row(scene, island, by_end.item[e], 1);
  fits = fits && ms_buckets_create(alloc, n, to, rows->stride, &by_vertex);
  for (int32_t r = 0; r < rows->stride && fits; r++)
    for (int32_t at = by_vertex.first[r]; at < by_vertex.first[r + 1]; at++) {
      to[at] = at - by_vertex.first[r];
      if (to[at] >= indices) indices = to[at] + 1;
    }
  fits = fits && ms_buckets_create(alloc, n, to, indices, &by_index);
  for (int32_t e = 0; e < n && fits; e++)
    angle[e] = island->angle[by_end.item[by_vertex.item[by_index.item[e]]]];
  ms_buckets_destroy(alloc, &by_end);
  ms_buckets_destroy(alloc, &by_vertex);
  ms_buckets_destroy(alloc, &by_index);
  ms_memory_free(alloc, to);
  return fits;
}

/* The order of one process, for a part of the scene. Positions of different islands may be equal,
 * but no unknown has angular springs of both. */
static int sort_by_positions(const ms_scene *scene, const ms_island *island, int32_t *angle) {
  const msim_allocator *alloc = &scene->alloc;
  const ms_rank_order *order = island->order;
  ms_buckets by_position = {0};
  int32_t *to = ms_memory_allocate(alloc, (size_t)island->nangles, sizeof *to);
  for (int32_t e = 0; e < island->nangles && to; e++)
    to[e] = order->angle_position[island->angle[e]];
  const int fits =
      to && ms_buckets_create(alloc, island->nangles, to, order->nangles, &by_position);
  for (int32_t e = 0; e < island->nangles && fits; e++)
    angle[e] = island->angle[by_position.item[e]];
  ms_buckets_destroy(alloc, &by_position);
  ms_memory_free(alloc, to);
  return fits;
}

static void copy_angles(const ms_scene *scene, const ms_island *island, ms_angles *g) {
  const ms_scene_angles *from = &scene->angles;
  for (size_t e = 0; e < (size_t)g->n; e++) {
    const int32_t a = g->angle[e];
    for (size_t c = 0; c < 3; c++)
      g->row[3 * e + c] = island->row_scratch[from->ijk[3 * (size_t)a + c]];
    g->k[e] = from->k[a], g->bend[e] = MS_PI - from->rest[a], g->damping[e] = from->damping[a];
    g->is_damped |= g->damping[e] > 0;
    ms_scene_angles_weigh(scene, a, g->weight + 2 * e);
  }
}

/* Padding continues the rows of the last angle, where there are such rows. */
static void list_ends(const ms_unknowns *rows, ms_angles *g) {
  for (int32_t c = 0; c < 3; c++) {
    int32_t *end = g->end[c];
    for (int32_t e = 0; e < g->nslots; e++)
      end[e] = e < g->n                        ? g->row[3 * e + c]
               : end[e - 1] + 1 < rows->stride ? end[e - 1] + 1
                                               : end[e - 1];
    for (int32_t s = 0; s < g->nslots / MS_SLICE; s++) {
      const int32_t *of = end + MS_SLICE * s;
      g->start[c][s] = of[0];
      for (int32_t lane = 1; lane < MS_SLICE; lane++)
        if (of[lane] != of[0] + lane) g->start[c][s] = -1;
    }
  }
}

/*------------------------------------- corners --------------------------------------------------*/

/* The corners at unknowns; rows of pinned particles come behind. Buckets are filled in the order of
 * items, so these are sorted by corner, then by angle. */
static int list_corners(const ms_scene *scene, const ms_unknowns *rows, ms_angles *g) {
  const size_t n = 3 * (size_t)g->n;
  int32_t *to = ms_memory_allocate(&scene->alloc, n, sizeof *to), *place = NULL;
  int fits = to && MS_NEW(&scene->alloc, place, n);
  for (size_t c = 0; c < n && fits; c++) {
    const int32_t row = g->row[3 * (c % (size_t)g->n) + c / (size_t)g->n];
    to[c] = row < rows->nfree ? row : -1;
  }
  fits = fits && ms_buckets_create(&scene->alloc, (int32_t)n, to, rows->nfree, &g->of);
  for (int32_t at = 0; fits && at < g->of.first[rows->nfree]; at++)
    g->of.item[at] = 3 * (g->of.item[at] % g->n) + g->of.item[at] / g->n;
  for (int32_t c = 0; c < (int32_t)n && fits; c++) place[c] = 3 * (c % 3) * g->nslots + c / 3;
  fits = fits && ms_corners_create(&scene->alloc, rows, &g->of, place, 9 * g->nslots, &g->corners);
  MS_FREE(&scene->alloc, to, place);
  return fits;
}

static int allocate_angles(const msim_allocator *alloc, ms_angles *g) {
  const size_t n = (size_t)g->n, slots = (size_t)g->nslots;
  int fits = 1;
  for (int c = 0; c < 3; c++)
    fits = fits && MS_NEW(alloc, g->end[c], slots) && MS_NEW(alloc, g->start[c], slots / MS_SLICE);
  return fits && MS_NEW(alloc, g->row, 3 * n) && MS_NEW(alloc, g->angle, n) &&
         MS_NEW(alloc, g->k, slots) && MS_NEW(alloc, g->bend, slots) &&
         MS_NEW(alloc, g->damping, slots) && MS_NEW(alloc, g->weight, 2 * n) &&
         MS_NEW(alloc, g->corner, 12 * slots) && MS_NEW(alloc, g->sum, n / MS_ANGLE_CHUNK + 1);
}

msim_status ms_angles_create(const ms_scene *scene, const ms_island *island,
                             const ms_unknowns *rows, ms_angles *g, msim_error *err) {
  *g = (ms_angles){.n = island->nangles};
  if (g->n == 0) return MSIM_OK;
  g->nslots = (g->n + MS_SLICE - 1) / MS_SLICE * MS_SLICE;
  int fits = allocate_angles(&scene->alloc, g);
  if (fits) {
    ms_unknowns_find_rows(rows, island->row_scratch);
    fits = island->order ? sort_by_positions(scene, island, g->angle)
                         : ms_angles_sort(scene, island, rows, g->angle);
  }
  if (fits) {
    copy_angles(scene, island, g);
    list_ends(rows, g);
    fits = list_corners(scene, rows, g);
  }
  return fits ? MSIM_OK : ms_error_set_memory(err, "the angular springs");
}

void ms_angles_destroy(const ms_scene *scene, ms_angles *g) {
  ms_buckets_destroy(&scene->alloc, &g->of);
  ms_corners_destroy(&scene->alloc, &g->corners);
  for (int c = 0; c < 3; c++) MS_FREE(&scene->alloc, g->end[c], g->start[c]);
  MS_FREE(&scene->alloc, g->row, g->angle, g->k, g->bend, g->damping, g->weight, g->corner, g->sum);
  *g = (ms_angles){0};
}

double ms_angles_sum_row(const ms_angles *g, int32_t first_fixed, const double *by, int32_t row) {
  double sum = 0;
  if (g->n == 0) return 0;
  for (int32_t at = g->of.first[row]; at < g->of.first[row + 1]; at++) {
    const int32_t e = g->of.item[at] / 3, corner = g->of.item[at] % 3;
    const int32_t *end = g->row + 3 * e;
    const double *w = g->weight + 2 * e;
    if (corner != 2) sum += (end[1 - corner] < first_fixed ? 2 : 1) * w[0] * by[e];
    if (corner != 0) sum += (end[3 - corner] < first_fixed ? 2 : 1) * w[1] * by[e];
  }
  return sum;
}
