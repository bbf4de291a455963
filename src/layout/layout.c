#include "layout/layout.h"

#include "layout/order.h"

msim_status ms_layout_create(const ms_scene *scene, const ms_island *island, ms_rows *rows,
                             ms_springs *springs, ms_halves *halves, msim_error *err) {
  ms_adjacency a = {0};
  msim_status status = ms_rows_create(scene, island, rows, err);
  if (!status) status = ms_springs_create(scene, island, rows, springs, err);
  if (!status) status = ms_adjacency_create(scene, rows, springs, &a, err);
  if (!status) status = ms_order_rows(scene, rows, springs, &a, err);
  if (!status) status = ms_halves_create(scene, rows, springs, &a, halves, err);
  ms_adjacency_destroy(scene, &a);
  return status;
}

void ms_layout_destroy(const ms_scene *scene, ms_rows *rows, ms_springs *springs,
                       ms_halves *halves) {
  ms_halves_destroy(scene, halves);
  ms_springs_destroy(scene, springs);
  ms_rows_destroy(scene, rows);
}
