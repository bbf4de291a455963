#include "sim/rank_rest.h"

#include <math.h>

#include "sim/rank_fetch.h"

/* The positions of n particles of ascending numbers */
typedef struct positions {
  int32_t n, *number;
  double *x;
} positions;

static int list_ends(const ms_scene *rows, positions *at) {
  const int64_t n = 2 * (int64_t)rows->nsprings;
  if (!MS_NEW(&rows->alloc, at->number, n)) return 0;
  for (int64_t k = 0; k < n; k++) at->number[k] = rows->ij[k];
  at->n = ms_rank_fetch_sort(n, at->number);
  return MS_NEW(&rows->alloc, at->x, 3 * (size_t)at->n) != NULL;
}

static const double *find_position(const positions *at, int32_t particle) {
  return at->x + 3 * (size_t)ms_section_search(at->n, at->number, particle);
}

static msim_status measure(const ms_scene *rows, const ms_section *is, const positions *at,
                           msim_error *err) {
  for (size_t e = 0; e < (size_t)rows->nsprings; e++) {
    rows->rest[e] = ms_scene_distance(find_position(at, rows->ij[2 * e]),
                                      find_position(at, rows->ij[2 * e + 1]));
    if (!isfinite(rows->rest[e])) return ms_scene_refuse_length(is->first_spring + (int64_t)e, err);
  }
  return MSIM_OK;
}

msim_status ms_rank_rest_compute(const ms_scene_part *part, ms_ranks *ranks, msim_error *err) {
  const ms_scene *rows = part->rows;
  ms_rank_scene *slices = ms_rank_scene_create_from(part);
  ms_rank_fetch f = {0};
  positions at = {0};
  const int fits = slices && list_ends(rows, &at);
  msim_status status = ms_ranks_agree_on_memory(ranks, fits, "the lengths of the springs", err);
  if (!status) status = ms_rank_fetch_create(ranks, slices, MS_PARTICLES, at.n, at.number, &f, err);
  if (!status) {
    ms_rank_fetch_rows(&f, 3 * sizeof *at.x, rows->x, at.x);
    if (!ranks->failed) status = measure(rows, &slices->in_whole, &at, err);
    status = ms_ranks_agree(ranks, status, err);
  }
  ms_rank_fetch_destroy(&f);
  ms_rank_scene_destroy(&rows->alloc, slices);
  MS_FREE(&rows->alloc, at.number, at.x);
  return status;
}
