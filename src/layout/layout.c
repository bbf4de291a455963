#include "layout/layout.h"

#include "layout/order.h"
#include "layout/rank_order.h"

msim_status ms_layout_create(const ms_scene *scene, const ms_island *island, ms_unknowns *rows,
                             ms_springs *springs, ms_half_edges *half_edges, msim_error *err) {
  ms_adjacency a = {0};
  msim_status status = ms_unknowns_create(scene, island, rows, err);
  if (!status) status = ms_springs_create(scene, island, rows, springs, err);
  if (!status) status = ms_adjacency_create(scene, rows, springs, &a, err);
  if (!status && island->order) status = ms_rank_order_apply(scene, island, rows, springs, &a, err);
  else if (!status) status = ms_order_unknowns(scene, rows, springs, &a, err);
  if (!status) status = ms_half_edges_create(scene, rows, springs, &a, half_edges, err);
  ms_adjacency_destroy(scene, &a);
  return status;
}

void ms_layout_destroy(const ms_scene *scene, ms_unknowns *rows, ms_springs *springs,
                       ms_half_edges *half_edges) {
  ms_half_edges_destroy(scene, half_edges);
  ms_springs_destroy(scene, springs);
  ms_unknowns_destroy(scene, rows);
}
