#include "linear/aggregates.h"

#include "linear/clusters.h"
#include "linear/modes.h"

/* Returns 0 if memory is exhausted. */
static int list_members(const ms_model *model, const ms_incidence *graph, int32_t size,
                        ms_aggregates *a) {
  const ms_cluster_size unknowns = {.complete = size, .least = MS_MODES};
  ms_buckets members;
  const int32_t n = ms_clusters_grow(&model->scene->alloc, graph, model->unknowns.nfree, unknowns,
                                     a->of, &members);
  if (n < 0) return 0;
  a->n = n, a->first = members.first, a->unknown = members.item;
  for (int32_t r = model->unknowns.nfree; r < model->unknowns.first_pinned; r++) a->of[r] = -1;
  return 1;
}

msim_status ms_aggregates_create(const ms_model *model, int32_t size, ms_aggregates *a,
                                 msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const size_t n = (size_t)model->unknowns.first_pinned;
  ms_incidence graph = {0};
  *a = (ms_aggregates){0};
  const int fits = MS_NEW(alloc, a->of, n) && MS_NEW(alloc, a->weight, MS_MODES * n) &&
                   ms_incidence_create(alloc, &model->springs, model->unknowns.nfree, &graph);
  msim_status status = fits && list_members(model, &graph, size, a)
                           ? MSIM_OK
                           : ms_error_set_memory(err, "the aggregates");
  if (!status) status = ms_modes_compute(model, &graph, a, err);
  ms_incidence_destroy(alloc, &graph);
  return status;
}

void ms_aggregates_destroy(const ms_model *model, ms_aggregates *a) {
  MS_FREE(&model->scene->alloc, a->of, a->first, a->unknown, a->weight);
  *a = (ms_aggregates){0};
}
