#include "layout/unknowns.h"

#include "base/archive.h"

static int32_t round_up_to_slices(int32_t n) { return (n + MS_SLICE - 1) / MS_SLICE * MS_SLICE; }

msim_status ms_unknowns_create(const ms_scene *scene, const ms_island *island, ms_unknowns *rows,
                               msim_error *err) {
  *rows = (ms_unknowns){.dims = 3,
                        .axis = {0, 1, 2},
                        .dropped_axis = -1,
                        .n = island->nfree + island->npinned,
                        .nfree = island->nfree,
                        .first_pinned = round_up_to_slices(island->nfree)};
  rows->first_fixed = rows->first_pinned + island->nghosts;
  rows->stride = rows->first_pinned + round_up_to_slices(island->npinned);
  if (!MS_NEW(&scene->alloc, rows->particle, rows->stride))
    return ms_error_set_memory(err, "the numbering of the particles");
  for (int32_t r = 0; r < rows->stride; r++) rows->particle[r] = -1;
  for (int32_t k = 0; k < island->nfree; k++) rows->particle[k] = island->free[k];
  for (int32_t k = 0; k < island->npinned; k++)
    rows->particle[rows->first_pinned + k] = island->pinned[k];
  return MSIM_OK;
}

void ms_unknowns_drop_axis(ms_unknowns *rows, int32_t axis) {
  rows->dims = 0, rows->dropped_axis = axis;
  for (int32_t c = 0; c < 3; c++)
    if (c != axis) rows->axis[rows->dims++] = c;
}

void ms_unknowns_destroy(const ms_scene *scene, ms_unknowns *rows) {
  ms_memory_free(&scene->alloc, rows->particle);
  *rows = (ms_unknowns){0};
}

double *ms_unknowns_new_vector(const ms_scene *scene, const ms_unknowns *rows) {
  return ms_memory_allocate(&scene->alloc, (size_t)rows->dims * (size_t)rows->stride,
                            sizeof(double));
}

int ms_unknowns_new_vectors(const ms_scene *scene, const ms_unknowns *rows, size_t n,
                            double **const vectors[]) {
  for (size_t i = 0; i < n; i++)
    if (!(*vectors[i] = ms_unknowns_new_vector(scene, rows))) return 0;
  return 1;
}

void ms_unknowns_find_rows(const ms_unknowns *rows, int32_t *row) {
  for (int32_t r = 0; r < rows->stride; r++)
    if (rows->particle[r] >= 0) row[rows->particle[r]] = r;
}

uint64_t ms_unknowns_hash(const ms_unknowns *rows) {
  return ms_archive_hash(0, rows->particle, (size_t)rows->stride * sizeof *rows->particle);
}

void ms_unknowns_gather(const ms_unknowns *rows, const double *array, double *vec) {
  for (int32_t c = 0; c < rows->dims; c++) {
    const double *from = array + rows->axis[c];
    double *to = vec + (size_t)c * (size_t)rows->stride;
    for (int32_t r = 0; r < rows->stride; r++)
      if (rows->particle[r] >= 0) to[r] = from[3 * (size_t)rows->particle[r]];
  }
}

void ms_unknowns_scatter(const ms_unknowns *rows, const double *vec, double *array) {
  for (int32_t c = 0; c < rows->dims; c++) {
    const double *from = vec + (size_t)c * (size_t)rows->stride;
    double *to = array + rows->axis[c];
    for (int32_t r = 0; r < rows->stride; r++)
      if (rows->particle[r] >= 0) to[3 * (size_t)rows->particle[r]] = from[r];
  }
}

/*------------------------------------- springs --------------------------------------------------*/

/* 1: the island has the first springs of the scene, as a single one does. */
static int has_first_springs(const ms_island *island) {
  int32_t e = 0;
  while (e < island->nsprings && island->spring[e] == e) e++;
  return e == island->nsprings;
}

msim_status ms_springs_create(const ms_scene *scene, const ms_island *island,
                              const ms_unknowns *rows, ms_springs *springs, msim_error *err) {
  const msim_allocator *alloc = &scene->alloc;
  const size_t count = (size_t)island->nsprings;
  *springs = (ms_springs){.n = island->nsprings};
  if (!MS_NEW(alloc, springs->i, count) || !MS_NEW(alloc, springs->j, count) ||
      (!has_first_springs(island) && !MS_NEW(alloc, springs->number, count)))
    return ms_error_set_memory(err, "a copy of the springs");
  ms_unknowns_find_rows(rows, island->row_scratch);
  for (size_t to = 0; to < count; to++) {
    const int32_t e = island->spring[to];
    if (springs->number) springs->number[to] = e;
    springs->i[to] = island->row_scratch[scene->ij[2 * (size_t)e]];
    springs->j[to] = island->row_scratch[scene->ij[2 * (size_t)e + 1]];
  }
  return MSIM_OK;
}

void ms_springs_destroy(const ms_scene *scene, ms_springs *springs) {
  MS_FREE(&scene->alloc, springs->i, springs->j, springs->number);
  *springs = (ms_springs){0};
}
