#include "layout/whole_order.h"

#include "layout/angles.h"
#include "layout/half_edges.h"
#include "layout/order.h"

/* The index of a half-edge of row r in ms_whole_order.position */
static size_t half_edge_index(const ms_springs *springs, int32_t r, ms_half_edge h) {
  return 2 * (size_t)ms_springs_number(springs, h.spring) + (springs->i[h.spring] != r);
}

static msim_status record_split_rows(const ms_scene *scene, const ms_unknowns *rows,
                                     const ms_adjacency *a, ms_whole_order *order,
                                     msim_error *err) {
  ms_half_edges h = {.nslices = rows->first_pinned / MS_SLICE};
  if (!MS_NEW(&scene->alloc, h.first_part, rows->first_pinned))
    return ms_error_set_memory(err, "the order of the half-edges");
  ms_half_edges_find_split_rows(a, rows->nfree, &h);
  for (int32_t r = 0; r < rows->nfree; r++)
    order->is_split[rows->particle[r]] = h.first_part[r] >= 0;
  ms_memory_free(&scene->alloc, h.first_part);
  return MSIM_OK;
}

/* The positions are allocated after the first adjacency, which takes most memory. */
static msim_status record_order(const ms_scene *scene, const ms_unknowns *rows,
                                const ms_springs *springs, const ms_adjacency *a,
                                ms_whole_order *order, msim_error *err) {
  ms_whole_islands *all = &order->islands;
  if (!order->position && !MS_NEW(&scene->alloc, order->position, 2 * (size_t)scene->nsprings))
    return ms_error_set_memory(err, "the order of the half-edges");
  int32_t *particle = all->particle + all->first[all->n];
  for (int32_t r = 0; r < rows->nfree; r++) {
    particle[r] = rows->particle[r];
    for (int32_t k = a->first[r]; k < a->first[r + 1]; k++)
      order->position[half_edge_index(springs, r, a->half_edges[k])] = k - a->first[r];
  }
  all->hash[all->n] = ms_unknowns_hash(rows);
  all->first[all->n + 1] = all->first[all->n] + rows->nfree;
  all->n++;
  return MSIM_OK;
}

static msim_status record_angles(const ms_scene *scene, const ms_island *island,
                                 const ms_unknowns *rows, ms_whole_order *order, msim_error *err) {
  int32_t *angle = NULL;
  if (island->nangles == 0) return MSIM_OK;
  ms_unknowns_find_rows(rows, island->row_scratch);
  const int fits =
      MS_NEW(&scene->alloc, angle, island->nangles) && ms_angles_sort(scene, island, rows, angle);
  for (int32_t e = 0; e < island->nangles && fits; e++) order->angle_position[angle[e]] = e;
  ms_memory_free(&scene->alloc, angle);
  return fits ? MSIM_OK : ms_error_set_memory(err, "the order of the angular springs");
}

/* The steps of ms_layout_create up to the order of half-edges, and the order of angular springs */
static msim_status add_island(const ms_scene *scene, const ms_island *island, ms_whole_order *order,
                              msim_error *err) {
  ms_unknowns rows = {0};
  ms_springs springs = {0};
  ms_adjacency a = {0};
  msim_status status = ms_unknowns_create(scene, island, &rows, err);
  if (!status) status = ms_springs_create(scene, island, &rows, &springs, err);
  if (!status) status = ms_adjacency_create(scene, &rows, &springs, &a, err);
  if (!status) status = ms_order_unknowns(scene, &rows, &springs, &a, err);
  if (!status) status = record_split_rows(scene, &rows, &a, order, err);
  if (!status) status = record_order(scene, &rows, &springs, &a, order, err);
  if (!status) status = record_angles(scene, island, &rows, order, err);
  ms_adjacency_destroy(scene, &a);
  ms_springs_destroy(scene, &springs);
  ms_unknowns_destroy(scene, &rows);
  return status;
}

msim_status ms_whole_order_create(const ms_scene *scene, int whole, ms_whole_order *order,
                                  msim_error *err) {
  const msim_allocator *alloc = &scene->alloc;
  ms_whole_islands *all = &order->islands;
  ms_islands islands;
  *order = (ms_whole_order){0};
  msim_status status = ms_islands_create(scene, whole, &islands, err);
  if (status) return status;
  if (!MS_NEW(alloc, all->particle, scene->nparticles) ||
      !MS_NEW(alloc, all->first, (size_t)islands.n + 1) || !MS_NEW(alloc, all->hash, islands.n) ||
      !MS_NEW(alloc, order->is_split, scene->nparticles) ||
      !MS_NEW(alloc, order->angle_position, scene->angles.n))
    status = ms_error_set_memory(err, "the order of the half-edges");
  for (int32_t i = 0; i < islands.n && !status; i++) {
    const ms_island island = ms_islands_get(&islands, i);
    status = add_island(scene, &island, order, err);
  }
  ms_islands_destroy(scene, &islands);
  return status;
}

void ms_whole_order_destroy(const ms_scene *scene, ms_whole_order *order) {
  ms_whole_islands_destroy(&scene->alloc, &order->islands);
  MS_FREE(&scene->alloc, order->position, order->is_split, order->angle_position);
  *order = (ms_whole_order){0};
}
