#include "layout/adjacency.h"

#include <string.h>

/* Half-edges of each row in the order of the springs. next: the next position of each row. */
static void by_spring(const ms_springs *springs, int32_t *next, ms_half *halves) {
  for (int32_t e = 0; e < springs->n; e++) {
    const int32_t i = springs->i[e], j = springs->j[e];
    halves[next[i]++] = (ms_half){j, e};
    halves[next[j]++] = (ms_half){i, e};
  }
}

/* The transpose of `from`: rows in ascending order are appended to those of their neighbours, so
 * that each row lists its neighbours in ascending order. */
static void by_neighbour(const int32_t *first, int32_t nrows, const ms_half *from, int32_t *next,
                         ms_half *halves) {
  for (int32_t r = 0; r < nrows; r++)
    for (int32_t e = first[r]; e < first[r + 1]; e++)
      halves[next[from[e].neighbour]++] = (ms_half){r, from[e].spring};
}

msim_status ms_adjacency_create(const ms_scene *scene, const ms_rows *rows,
                                const ms_springs *springs, ms_adjacency *a, msim_error *err) {
  const msim_allocator *alloc = &scene->alloc;
  const size_t nrows = (size_t)rows->stride, nhalves = 2 * (size_t)springs->n;
  *a = (ms_adjacency){0};
  if (nhalves > INT32_MAX)
    return ms_fail(err, MSIM_ERR_ARG, "%d springs are more than the limit of %d", springs->n,
                   INT32_MAX / 2);
  int32_t *next = ms_new(alloc, nrows, sizeof *next);
  ms_half *unsorted = ms_new(alloc, nhalves, sizeof *unsorted);
  a->first = ms_new(alloc, nrows + 1, sizeof *a->first);
  a->halves = ms_new(alloc, nhalves, sizeof *a->halves);
  const int fits = next && unsorted && a->first && a->halves;
  if (fits) {
    for (int32_t e = 0; e < springs->n; e++)
      a->first[springs->i[e] + 1]++, a->first[springs->j[e] + 1]++;
    for (size_t r = 0; r < nrows; r++) a->first[r + 1] += a->first[r];
    memcpy(next, a->first, nrows * sizeof *next);
    by_spring(springs, next, unsorted);
    memcpy(next, a->first, nrows * sizeof *next);
    by_neighbour(a->first, rows->stride, unsorted, next, a->halves);
  }
  ms_delete(alloc, next);
  ms_delete(alloc, unsorted);
  return fits ? MSIM_OK : ms_fail_memory(err, "the springs of each row");
}

msim_status ms_adjacency_renumber(const ms_scene *scene, int32_t nrows, const int32_t *new_row,
                                  ms_adjacency *a, msim_error *err) {
  const msim_allocator *alloc = &scene->alloc;
  const size_t n = (size_t)nrows;
  int32_t *old = ms_new(alloc, n, sizeof *old), *next = ms_new(alloc, n, sizeof *next);
  ms_adjacency b = {ms_new(alloc, n + 1, sizeof *b.first),
                    ms_new(alloc, (size_t)a->first[n], sizeof *b.halves)};
  const int fits = old && next && b.first && b.halves;
  if (fits) {
    for (int32_t r = 0; r < nrows; r++) old[new_row[r]] = r;
    for (size_t r = 0; r < n; r++) b.first[r + 1] = b.first[r] + ms_degree(a, old[r]);
    memcpy(next, b.first, n * sizeof *next);
    for (int32_t r = 0; r < nrows; r++)
      for (int32_t e = a->first[old[r]]; e < a->first[old[r] + 1]; e++)
        b.halves[next[new_row[a->halves[e].neighbour]]++] = (ms_half){r, a->halves[e].spring};
    ms_adjacency_destroy(scene, a);
    *a = b;
  } else {
    ms_adjacency_destroy(scene, &b);
  }
  ms_delete(alloc, old);
  ms_delete(alloc, next);
  return fits ? MSIM_OK : ms_fail_memory(err, "the springs of each row");
}

void ms_adjacency_destroy(const ms_scene *scene, ms_adjacency *a) {
  ms_delete(&scene->alloc, a->first);
  ms_delete(&scene->alloc, a->halves);
  *a = (ms_adjacency){0};
}
