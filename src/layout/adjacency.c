#include "layout/adjacency.h"

#include <string.h>

/* Half-edges of each row in the order of the springs. next: the next position of each row. */
static void list_by_spring(const ms_springs *springs, int32_t *next, ms_half_edge *half_edges) {
  for (int32_t e = 0; e < springs->n; e++) {
    const int32_t i = springs->i[e], j = springs->j[e];
    half_edges[next[i]++] = (ms_half_edge){j, e};
    half_edges[next[j]++] = (ms_half_edge){i, e};
  }
}

/* The transpose of `from`: rows in ascending order are appended to those of their neighbours, so
 * that each row lists its neighbours in ascending order. */
static void transpose_half_edges(const int32_t *first, int32_t nrows, const ms_half_edge *from,
                                 int32_t *next, ms_half_edge *half_edges) {
  for (int32_t r = 0; r < nrows; r++)
    for (int32_t e = first[r]; e < first[r + 1]; e++)
      half_edges[next[from[e].neighbour]++] = (ms_half_edge){r, from[e].spring};
}

msim_status ms_adjacency_create(const ms_scene *scene, const ms_unknowns *rows,
                                const ms_springs *springs, ms_adjacency *a, msim_error *err) {
  const msim_allocator *alloc = &scene->alloc;
  const size_t nrows = (size_t)rows->stride, nhalves = 2 * (size_t)springs->n;
  *a = (ms_adjacency){0};
  if (nhalves > INT32_MAX)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "%d connected springs exceed the limit of %d; reduce the number of springs",
                        springs->n, INT32_MAX / 2);
  int32_t *next = ms_memory_allocate(alloc, nrows, sizeof *next);
  ms_half_edge *unsorted = ms_memory_allocate(alloc, nhalves, sizeof *unsorted);
  a->first = ms_memory_allocate(alloc, nrows + 1, sizeof *a->first);
  a->half_edges = ms_memory_allocate(alloc, nhalves, sizeof *a->half_edges);
  const int fits = next && unsorted && a->first && a->half_edges;
  if (fits) {
    for (int32_t e = 0; e < springs->n; e++)
      a->first[springs->i[e] + 1]++, a->first[springs->j[e] + 1]++;
    for (size_t r = 0; r < nrows; r++) a->first[r + 1] += a->first[r];
    memcpy(next, a->first, nrows * sizeof *next);
    list_by_spring(springs, next, unsorted);
    memcpy(next, a->first, nrows * sizeof *next);
    transpose_half_edges(a->first, rows->stride, unsorted, next, a->half_edges);
  }
  ms_memory_free(alloc, next);
  ms_memory_free(alloc, unsorted);
  return fits ? MSIM_OK : ms_error_set_memory(err, "the half-edges of the springs");
}

msim_status ms_adjacency_renumber(const ms_scene *scene, int32_t nrows, const int32_t *new_row,
                                  ms_adjacency *a, msim_error *err) {
  const msim_allocator *alloc = &scene->alloc;
  const size_t n = (size_t)nrows;
  int32_t *old = ms_memory_allocate(alloc, n, sizeof *old),
          *next = ms_memory_allocate(alloc, n, sizeof *next);
  ms_adjacency b = {ms_memory_allocate(alloc, n + 1, sizeof *b.first),
                    ms_memory_allocate(alloc, (size_t)a->first[n], sizeof *b.half_edges)};
  const int fits = old && next && b.first && b.half_edges;
  if (fits) {
    for (int32_t r = 0; r < nrows; r++) old[new_row[r]] = r;
    for (size_t r = 0; r < n; r++) b.first[r + 1] = b.first[r] + ms_adjacency_degree(a, old[r]);
    memcpy(next, b.first, n * sizeof *next);
    for (int32_t r = 0; r < nrows; r++)
      for (int32_t e = a->first[old[r]]; e < a->first[old[r] + 1]; e++)
        b.half_edges[next[new_row[a->half_edges[e].neighbour]]++] =
            (ms_half_edge){r, a->half_edges[e].spring};
    ms_adjacency_destroy(scene, a);
    *a = b;
  } else {
    ms_adjacency_destroy(scene, &b);
  }
  ms_memory_free(alloc, old);
  ms_memory_free(alloc, next);
  return fits ? MSIM_OK : ms_error_set_memory(err, "the half-edges of the springs");
}

void ms_adjacency_destroy(const ms_scene *scene, ms_adjacency *a) {
  ms_memory_free(&scene->alloc, a->first);
  ms_memory_free(&scene->alloc, a->half_edges);
  *a = (ms_adjacency){0};
}
