#include "layout/angles.h"

#include "scene/angles.h"

static void copy_angles(const ms_scene *scene, const ms_island *island, ms_angles *g) {
  const ms_scene_angles *from = &scene->angles;
  for (size_t e = 0; e < (size_t)g->n; e++) {
    const int32_t a = g->angle[e] = island->angle[e];
    for (size_t c = 0; c < 3; c++)
      g->row[3 * e + c] = island->row_scratch[from->ijk[3 * (size_t)a + c]];
    g->k[e] = from->k[a], g->bend[e] = MS_PI - from->rest[a], g->damping[e] = from->damping[a];
    ms_scene_angles_weigh(scene, a, g->weight + 2 * e);
  }
}

/* The corners at unknowns; rows of pinned particles come behind */
static int list_corners(const ms_scene *scene, int32_t nfree, ms_angles *g) {
  const size_t n = 3 * (size_t)g->n;
  int32_t *to = ms_memory_allocate(&scene->alloc, n, sizeof *to);
  if (!to) return 0;
  for (size_t c = 0; c < n; c++) to[c] = g->row[c] < nfree ? g->row[c] : -1;
  const int fits = ms_buckets_create(&scene->alloc, (int32_t)n, to, nfree, &g->of);
  ms_memory_free(&scene->alloc, to);
  return fits;
}

msim_status ms_angles_create(const ms_scene *scene, const ms_island *island,
                             const ms_unknowns *rows, ms_angles *g, msim_error *err) {
  const msim_allocator *alloc = &scene->alloc;
  const size_t n = (size_t)island->nangles;
  *g = (ms_angles){.n = island->nangles};
  if (n == 0) return MSIM_OK;
  int fits = MS_NEW(alloc, g->row, 3 * n) && MS_NEW(alloc, g->angle, n) && MS_NEW(alloc, g->k, n) &&
             MS_NEW(alloc, g->bend, n) && MS_NEW(alloc, g->damping, n) &&
             MS_NEW(alloc, g->weight, 2 * n) && MS_NEW(alloc, g->corner, 9 * n) &&
             MS_NEW(alloc, g->sum, n / MS_ANGLE_CHUNK + 1);
  if (fits) {
    ms_unknowns_find_rows(rows, island->row_scratch);
    copy_angles(scene, island, g);
    fits = list_corners(scene, rows->nfree, g);
  }
  return fits ? MSIM_OK : ms_error_set_memory(err, "the angular springs");
}

void ms_angles_destroy(const ms_scene *scene, ms_angles *g) {
  ms_buckets_destroy(&scene->alloc, &g->of);
  MS_FREE(&scene->alloc, g->row, g->angle, g->k, g->bend, g->damping, g->weight, g->corner, g->sum);
  *g = (ms_angles){0};
}

double ms_angles_sum_row(const ms_angles *g, int32_t nfree, const double *by, int32_t row) {
  double sum = 0;
  if (g->n == 0) return 0;
  for (int32_t at = g->of.first[row]; at < g->of.first[row + 1]; at++) {
    const int32_t e = g->of.item[at] / 3, corner = g->of.item[at] % 3;
    const int32_t *end = g->row + 3 * e;
    const double *w = g->weight + 2 * e;
    if (corner != 2) sum += (end[1 - corner] < nfree ? 2 : 1) * w[0] * by[e];
    if (corner != 0) sum += (end[3 - corner] < nfree ? 2 : 1) * w[1] * by[e];
  }
  return sum;
}
