#include "linear/restriction.h"

/* last: of each aggregate, and of none, the last part so far; -1: none yet. of_part: the aggregate
 * of each part. Returns their number. */
static int32_t number_parts_of_rows(const ms_aggregates *a, int32_t nrows, int32_t *last,
                                    ms_restriction *parts, int32_t *of_part) {
  int32_t n = 0, first = 0;
  for (int32_t k = 0; k <= a->n; k++) last[k] = -1;
  for (int32_t r = 0; r < nrows; r++) {
    int32_t *own = &last[a->of[r] < 0 ? a->n : a->of[r]];
    if (r % MS_RESTRICTION_ROWS == 0) first = parts->first[r / MS_RESTRICTION_ROWS] = n;
    if (*own < first) of_part[n] = a->of[r], *own = n++;
    parts->part[r] = (uint16_t)(*own - first);
  }
  return n;
}

msim_status ms_restriction_create(const ms_model *model, const ms_aggregates *a, ms_restriction *r,
                                  msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const int32_t rows = model->unknowns.first_pinned;
  int32_t *last = NULL, *of_part = NULL;
  *r = (ms_restriction){0};
  int fits = MS_NEW(alloc, last, (size_t)a->n + 1) && MS_NEW(alloc, of_part, rows) &&
             MS_NEW(alloc, r->part, rows) &&
             MS_NEW(alloc, r->first, rows / MS_RESTRICTION_ROWS + 1);
  if (fits) {
    const int32_t n = number_parts_of_rows(a, rows, last, r, of_part);
    fits = ms_buckets_create(alloc, n, of_part, a->n, &r->of) &&
           MS_NEW(alloc, r->sums, MS_MODES * (size_t)model->unknowns.dims * (size_t)n);
  }
  MS_FREE(alloc, last, of_part);
  return fits ? MSIM_OK : ms_error_set_memory(err, "the coarse matrix");
}

void ms_restriction_destroy(const ms_model *model, ms_restriction *r) {
  MS_FREE(&model->scene->alloc, r->first, r->part, r->sums);
  ms_buckets_destroy(&model->scene->alloc, &r->of);
  *r = (ms_restriction){0};
}
