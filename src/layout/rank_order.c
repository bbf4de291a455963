#include "layout/rank_order.h"

#include <string.h>

#include "layout/bisection.h"
#include "layout/whole_order.h"

/* What rank 0 has of the whole scene; empty on the others */
typedef struct source {
  const ms_scene *scene;
  const int32_t *owner;
  const ms_whole_order *whole;
} source;

static int is_root(const ms_rank_part *part) { return part->ranks->rank == 0; }

/*------------------------------------- messages -------------------------------------------------*/

/* Write items of all ranks, those of rank r from next[r] on. */
typedef void fill_items(const source *from, int64_t *next, void *items);

static int64_t count_unknowns(const source *from) {
  const ms_whole_islands *all = &from->whole->islands;
  return all->first[all->n];
}

static void fill_particles(const source *from, int64_t *next, void *items) {
  for (int64_t k = 0; k < count_unknowns(from); k++) {
    const int32_t p = from->whole->islands.particle[k];
    ((int32_t *)items)[next[from->owner[p]]++] = p;
  }
}

static void fill_places(const source *from, int64_t *next, void *items) {
  for (int64_t k = 0; k < count_unknowns(from); k++)
    ((int32_t *)items)[next[from->owner[from->whole->islands.particle[k]]]++] = (int32_t)k;
}

static void fill_splits(const source *from, int64_t *next, void *items) {
  for (int64_t k = 0; k < count_unknowns(from); k++) {
    const int32_t p = from->whole->islands.particle[k];
    ((uint8_t *)items)[next[from->owner[p]]++] = from->whole->is_split[p];
  }
}

static void fill_positions(const source *from, int64_t *next, void *items) {
  for (size_t h = 0; h < 2 * (size_t)from->scene->nsprings; h++) {
    const int32_t owner = from->owner[from->scene->ij[h]];
    if (owner != MS_NO_OWNER) ((int32_t *)items)[next[owner]++] = from->whole->position[h];
  }
}

/* count: nranks: half-edges of the own particles of each rank */
static void count_half_edges(const source *from, int64_t *count) {
  for (size_t h = 0; h < 2 * (size_t)from->scene->nsprings; h++) {
    const int32_t owner = from->owner[from->scene->ij[h]];
    if (owner != MS_NO_OWNER) count[owner]++;
  }
}

/*------------------------------------- sending --------------------------------------------------*/

/* Rank 0 sends each rank count[r] items of this size, which *own gets; collective. */
static msim_status send_items(const source *from, const ms_rank_part *part, const int64_t *count,
                              size_t size, fill_items *fill, void **own, msim_error *err) {
  const msim_allocator *alloc = &from->scene->alloc;
  ms_ranks *ranks = part->ranks;
  void *items = NULL;
  int64_t sum = 0;
  for (int32_t r = 0; r < ranks->n; r++) {
    part->next[r] = sum, sum += count[r];
    part->send_bytes[r] = is_root(part) ? count[r] * (int64_t)size : 0;
    part->receive_bytes[r] = r == 0 ? count[ranks->rank] * (int64_t)size : 0;
  }
  *own = ms_memory_allocate(alloc, (size_t)count[ranks->rank], size);
  if (is_root(part)) items = ms_memory_allocate(alloc, (size_t)sum, size);
  const int fits = *own && (items || !is_root(part));
  msim_status status = ms_ranks_agree_on_memory(ranks, fits, "the order of the half-edges", err);
  if (!status) {
    if (is_root(part)) fill(from, part->next, items);
    ms_ranks_all_to_all(ranks, part->send_bytes, items, part->receive_bytes, *own);
    status = ms_ranks_agree(ranks, MSIM_OK, err);
  }
  ms_memory_free(alloc, items);
  return status;
}

/* What all ranks have; `order` takes it from rank 0. */
static msim_status share_islands(const ms_rank_part *part, const msim_allocator *alloc,
                                 ms_whole_order *whole, ms_rank_order *order, msim_error *err) {
  ms_whole_islands *to = &order->islands, *from = &whole->islands;
  int32_t n = from->n;
  ms_ranks_broadcast(part->ranks, 0, sizeof n, &n);
  if (is_root(part)) {
    to->first = from->first, to->hash = from->hash, from->first = NULL, from->hash = NULL;
    order->angle_position = whole->angle_position, whole->angle_position = NULL;
  }
  to->n = part->ranks->failed ? 0 : n;
  const int fits = is_root(part) ||
                   (MS_NEW(alloc, to->first, (size_t)to->n + 1) && MS_NEW(alloc, to->hash, to->n) &&
                    MS_NEW(alloc, order->angle_position, order->nangles));
  const msim_status status =
      ms_ranks_agree_on_memory(part->ranks, fits, "the order of the half-edges", err);
  if (status) return status;
  ms_ranks_broadcast(part->ranks, 0, ((int64_t)n + 1) * (int64_t)sizeof *to->first, to->first);
  ms_ranks_broadcast(part->ranks, 0, n * (int64_t)sizeof *to->hash, to->hash);
  ms_ranks_broadcast(part->ranks, 0, order->nangles * (int64_t)sizeof *order->angle_position,
                     order->angle_position);
  return ms_ranks_agree(part->ranks, MSIM_OK, err);
}

static msim_status send_order(const source *from, const ms_rank_part *part, int64_t *count,
                              ms_rank_order *order, msim_error *err) {
  const size_t number = sizeof(int32_t);
  void *own = NULL;
  for (int32_t r = 0; r < part->ranks->n; r++) count[r] = ms_rank_part_count(part, r);
  msim_status status = send_items(from, part, count, number, fill_particles, &own, err);
  order->own = own, own = NULL;
  if (!status) status = send_items(from, part, count, number, fill_places, &own, err);
  order->place = own, own = NULL;
  if (!status) status = send_items(from, part, count, 1, fill_splits, &own, err);
  order->is_split = own, own = NULL;
  for (int32_t r = 0; r < part->ranks->n; r++) count[r] = 0;
  if (is_root(part) && !status) count_half_edges(from, count);
  if (status) return status;
  ms_ranks_broadcast(part->ranks, 0, part->ranks->n * (int64_t)sizeof *count, count);
  for (int32_t r = 0; r < part->ranks->n && part->ranks->failed; r++) count[r] = 0;
  status = send_items(from, part, count, number, fill_positions, &own, err);
  order->position = own;
  return status;
}

/*------------------------------------- creation -------------------------------------------------*/

msim_status ms_rank_order_create(const ms_scene *scene, const ms_rank_part *part, int whole,
                                 ms_rank_order *order, msim_error *err) {
  ms_whole_order found = {0};
  int64_t *count = NULL;
  *order = (ms_rank_order){.nangles = scene->angles.n};
  msim_status status = is_root(part) ? ms_whole_order_create(scene, whole, &found, err) : MSIM_OK;
  if (!status && !MS_NEW(&scene->alloc, count, part->ranks->n))
    status = ms_error_set_memory(err, "the order of the half-edges");
  status = ms_ranks_agree(part->ranks, status, err);
  const source from = {scene, part->owner, &found};
  if (!status) status = send_order(&from, part, count, order, err);
  if (!status) status = share_islands(part, &scene->alloc, &found, order, err);
  ms_whole_order_destroy(scene, &found);
  ms_memory_free(&scene->alloc, count);
  return status;
}

void ms_rank_order_destroy(const ms_scene *scene, ms_rank_order *order) {
  ms_whole_islands_destroy(&scene->alloc, &order->islands);
  MS_FREE(&scene->alloc, order->own, order->place, order->position, order->is_split,
          order->angle_position);
  *order = (ms_rank_order){0};
}

/*------------------------------------- use ------------------------------------------------------*/

msim_status ms_rank_order_apply(const ms_scene *scene, const ms_island *island,
                                const ms_unknowns *rows, const ms_springs *springs, ms_adjacency *a,
                                msim_error *err) {
  const int32_t *position = island->order->position;
  if (!MS_NEW(&scene->alloc, a->is_split, rows->stride))
    return ms_error_set_memory(err, "the order of the half-edges");
  memcpy(a->is_split, island->order->is_split, (size_t)rows->nfree);
  for (int32_t e = 0; e < springs->n; e++) {
    const int32_t end[2] = {springs->i[e], springs->j[e]};
    for (int k = 0; k < 2; k++)
      if (end[k] < rows->nfree)
        a->half_edges[a->first[end[k]] + *position++] = (ms_half_edge){end[1 - k], e};
  }
  return MSIM_OK;
}
