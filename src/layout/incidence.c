#include "layout/incidence.h"

int ms_incidence_create(const msim_allocator *alloc, const ms_springs *springs, int32_t nrows,
                        ms_incidence *a) {
  *a = (ms_incidence){0};
  if (!MS_NEW(alloc, a->row, 2 * (size_t)springs->n)) return 0;
  for (int32_t e = 0; e < springs->n; e++) {
    const int32_t i = springs->i[e], j = springs->j[e];
    const int listed = i < nrows && j < nrows;
    a->row[2 * e] = listed ? i : -1, a->row[2 * e + 1] = listed ? j : -1;
  }
  return ms_buckets_create(alloc, 2 * springs->n, a->row, nrows, &a->of);
}

void ms_incidence_destroy(const msim_allocator *alloc, ms_incidence *a) {
  ms_memory_free(alloc, a->row);
  ms_buckets_destroy(alloc, &a->of);
  *a = (ms_incidence){0};
}
