#include "layout/rows.h"

static int32_t whole_groups(int32_t n) { return (n + MS_GROUP - 1) / MS_GROUP * MS_GROUP; }

msim_status ms_rows_create(const ms_scene *scene, ms_rows *rows, msim_error *err) {
  int32_t n = scene->nparticles, npinned = 0;
  for (int32_t p = 0; p < n; p++) npinned += scene->pinned[p];
  *rows = (ms_rows){.dims = 3, .axis = {0, 1, 2}, .left_out = -1, .n = n, .nfree = n - npinned};
  rows->first_pinned = whole_groups(rows->nfree);
  rows->stride = rows->first_pinned + whole_groups(npinned);
  rows->row = ms_new(&scene->alloc, (size_t)n, sizeof *rows->row);
  rows->particle = ms_new(&scene->alloc, (size_t)rows->stride, sizeof *rows->particle);
  if (!rows->row || !rows->particle) return ms_fail_memory(err, "the order of rows");
  for (int32_t r = 0; r < rows->stride; r++) rows->particle[r] = -1;
  int32_t next_free = 0, next_pinned = rows->first_pinned;
  for (int32_t p = 0; p < n; p++) {
    int32_t r = scene->pinned[p] ? next_pinned++ : next_free++;
    rows->row[p] = r;
    rows->particle[r] = p;
  }
  return MSIM_OK;
}

void ms_rows_leave_out(ms_rows *rows, int32_t axis) {
  rows->dims = 0, rows->left_out = axis;
  for (int32_t c = 0; c < 3; c++)
    if (c != axis) rows->axis[rows->dims++] = c;
}

void ms_rows_destroy(const ms_scene *scene, ms_rows *rows) {
  ms_delete(&scene->alloc, rows->row);
  ms_delete(&scene->alloc, rows->particle);
  *rows = (ms_rows){0};
}

double *ms_rows_vector(const ms_scene *scene, const ms_rows *rows) {
  return ms_new(&scene->alloc, (size_t)rows->dims * (size_t)rows->stride, sizeof(double));
}

void ms_rows_gather(const ms_rows *rows, const double *flat, double *vec) {
  for (int32_t c = 0; c < rows->dims; c++) {
    const double *from = flat + rows->axis[c];
    double *to = vec + (size_t)c * (size_t)rows->stride;
    for (int32_t p = 0; p < rows->n; p++) to[rows->row[p]] = from[3 * (size_t)p];
  }
}

void ms_rows_scatter(const ms_rows *rows, const double *vec, double *flat) {
  for (int32_t c = 0; c < rows->dims; c++) {
    const double *from = vec + (size_t)c * (size_t)rows->stride;
    double *to = flat + rows->axis[c];
    for (int32_t p = 0; p < rows->n; p++) to[3 * (size_t)p] = from[rows->row[p]];
  }
}

/*------------------------------------- springs --------------------------------------------------*/

static int both_pinned(const ms_scene *s, int32_t e) {
  return s->pinned[s->ij[2 * (size_t)e]] && s->pinned[s->ij[2 * (size_t)e + 1]];
}

msim_status ms_springs_create(const ms_scene *scene, const ms_rows *rows, ms_springs *springs,
                              msim_error *err) {
  const msim_allocator *alloc = &scene->alloc;
  int32_t n = 0;
  for (int32_t e = 0; e < scene->nsprings; e++) n += !both_pinned(scene, e);
  size_t count = (size_t)n;
  *springs = (ms_springs){.n = n,
                          .i = ms_new(alloc, count, sizeof(int32_t)),
                          .j = ms_new(alloc, count, sizeof(int32_t)),
                          .k = ms_new(alloc, count, sizeof(double)),
                          .rest = ms_new(alloc, count, sizeof(double)),
                          .damping = ms_new(alloc, count, sizeof(double)),
                          .spring = ms_new(alloc, count, sizeof(int32_t))};
  if (!springs->i || !springs->j || !springs->k || !springs->rest || !springs->damping ||
      !springs->spring)
    return ms_fail_memory(err, "the springs");
  for (int32_t e = 0, to = 0; e < scene->nsprings; e++) {
    if (both_pinned(scene, e)) continue;
    springs->i[to] = rows->row[scene->ij[2 * (size_t)e]];
    springs->j[to] = rows->row[scene->ij[2 * (size_t)e + 1]];
    springs->spring[to++] = e;
  }
  ms_springs_update(scene, springs);
  return MSIM_OK;
}

void ms_springs_update(const ms_scene *scene, ms_springs *springs) {
  for (int32_t to = 0; to < springs->n; to++) {
    const int32_t e = springs->spring[to];
    springs->k[to] = scene->k[e];
    springs->rest[to] = scene->rest[e];
    springs->damping[to] = scene->damping[e];
  }
}

void ms_springs_destroy(const ms_scene *scene, ms_springs *springs) {
  void *arrays[] = {springs->i,    springs->j,       springs->k,
                    springs->rest, springs->damping, springs->spring};
  for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) ms_delete(&scene->alloc, arrays[i]);
  *springs = (ms_springs){0};
}
