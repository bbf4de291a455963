#include "layout/adjacency.h"

#include <string.h>

#include "layout/incidence.h"

/* Rows in ascending order are appended to those of their neighbours, so that each row lists its
 * neighbours in ascending order. next: the next position of each row */
static void list_neighbours(const ms_buckets *by_row, const ms_springs *springs, int32_t nrows,
                            int32_t *next, ms_half_edge *half_edges) {
  for (int32_t r = 0; r < nrows; r++)
    for (int32_t k = by_row->first[r]; k < by_row->first[r + 1]; k++) {
      const int32_t h = by_row->item[k], e = h / 2, other = h % 2 ? springs->i[e] : springs->j[e];
      half_edges[next[other]++] = (ms_half_edge){r, e};
    }
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
  ms_incidence by_spring;
  int32_t *next = NULL;
  int fits = ms_incidence_create(alloc, springs, rows->stride, &by_spring);
  ms_memory_free(alloc, by_spring.row); /* before the half-edges take as much memory */
  by_spring.row = NULL;
  fits = fits && MS_NEW(alloc, next, nrows) && MS_NEW(alloc, a->half_edges, nhalves);
  if (fits) {
    memcpy(next, by_spring.of.first, nrows * sizeof *next);
    list_neighbours(&by_spring.of, springs, rows->stride, next, a->half_edges);
    a->first = by_spring.of.first;
    by_spring.of.first = NULL;
  }
  ms_memory_free(alloc, next);
  ms_incidence_destroy(alloc, &by_spring);
  return fits ? MSIM_OK : ms_error_set_memory(err, "the half-edges of the springs");
}

void ms_adjacency_destroy(const ms_scene *scene, ms_adjacency *a) {
  MS_FREE(&scene->alloc, a->first, a->half_edges, a->is_split);
  *a = (ms_adjacency){0};
}
