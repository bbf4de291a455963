#include "layout/rank_order.h"

#include <string.h>

#include "layout/bisection.h"
#include "layout/whole_order.h"

/* What rank 0 sends, in the order of ranks; empty on the others */
typedef struct messages {
  int32_t *position;
  uint8_t *is_split;
} messages;

static int is_root(const ms_rank_part *part) { return part->ranks->rank == 0; }

/*------------------------------------- lengths --------------------------------------------------*/

/* count: nranks: half-edges of the own particles of each rank. Returns their sum. */
static int64_t count_half_edges(const ms_scene *s, const ms_rank_part *part, int64_t *count) {
  int64_t sum = 0;
  for (int32_t r = 0; r < part->ranks->n; r++) count[r] = 0;
  for (size_t h = 0; h < 2 * (size_t)s->nsprings; h++) {
    const int32_t owner = part->owner[s->ij[h]];
    if (owner != MS_NO_OWNER) count[owner]++, sum++;
  }
  return sum;
}

/* count: nranks: own particles. Returns their sum. */
static int64_t count_particles(const ms_rank_part *part, int64_t *count) {
  int64_t sum = 0;
  for (int32_t r = 0; r < part->ranks->n; r++) sum += count[r] = ms_rank_part_count(part, r);
  return sum;
}

static int allocate(const ms_scene *s, const ms_rank_part *part, ms_rank_order *order,
                    messages *m) {
  const msim_allocator *alloc = &s->alloc;
  const int32_t rank = part->ranks->rank;
  ms_whole_islands *all = &order->islands;
  int64_t *count = part->next;
  const int64_t free = count_particles(part, count);
  if (!MS_NEW(alloc, order->is_split, count[rank]) ||
      !MS_NEW(alloc, m->is_split, is_root(part) ? free : 0))
    return 0;
  const int64_t half_edges = count_half_edges(s, part, count);
  if (!MS_NEW(alloc, order->position, count[rank]) ||
      !MS_NEW(alloc, m->position, is_root(part) ? half_edges : 0))
    return 0;
  return is_root(part) ||
         (MS_NEW(alloc, all->particle, free) && MS_NEW(alloc, all->first, (size_t)all->n + 1) &&
          MS_NEW(alloc, all->hash, all->n) && MS_NEW(alloc, order->angle_position, order->nangles));
}

/*------------------------------------- sending --------------------------------------------------*/

/* next: of each rank, where its part begins, from the lengths of all. */
static void find_beginnings(const ms_rank_part *part, int64_t *next) {
  int64_t at = 0;
  for (int32_t r = 0; r < part->ranks->n; r++) {
    const int64_t n = next[r];
    next[r] = at, at += n;
  }
}

static void fill_messages(const ms_scene *s, const ms_rank_part *part, const ms_whole_order *whole,
                          messages *m) {
  int64_t *next = part->next;
  const int64_t n = count_particles(part, next);
  find_beginnings(part, next);
  for (int64_t k = 0; k < n; k++) {
    const int32_t p = whole->islands.particle[k];
    m->is_split[next[part->owner[p]]++] = whole->is_split[p];
  }
  count_half_edges(s, part, next);
  find_beginnings(part, next);
  for (size_t h = 0; h < 2 * (size_t)s->nsprings; h++) {
    const int32_t owner = part->owner[s->ij[h]];
    if (owner != MS_NO_OWNER) m->position[next[owner]++] = whole->position[h];
  }
}

/* Rank 0 sends each rank its part, count[r] items; collective. */
static void send_parts(const ms_rank_part *part, const int64_t *count, size_t size,
                       const void *parts, void *own) {
  const int32_t n = part->ranks->n;
  for (int32_t r = 0; r < n; r++) {
    part->send_bytes[r] = is_root(part) ? count[r] * (int64_t)size : 0;
    part->receive_bytes[r] = r == 0 ? count[part->ranks->rank] * (int64_t)size : 0;
  }
  ms_ranks_all_to_all(part->ranks, part->send_bytes, parts, part->receive_bytes, own);
}

static void send_order(const ms_scene *s, const ms_rank_part *part, const messages *m,
                       ms_rank_order *order) {
  ms_whole_islands *all = &order->islands;
  int64_t *count = part->next;
  const int64_t free = count_particles(part, count);
  send_parts(part, count, sizeof *m->is_split, m->is_split, order->is_split);
  count_half_edges(s, part, count);
  send_parts(part, count, sizeof *m->position, m->position, order->position);
  const struct {
    void *data;
    size_t bytes;
  } shared[] = {{all->particle, (size_t)free * sizeof *all->particle},
                {all->first, ((size_t)all->n + 1) * sizeof *all->first},
                {all->hash, (size_t)all->n * sizeof *all->hash},
                {order->angle_position, (size_t)order->nangles * sizeof *order->angle_position}};
  for (size_t i = 0; i < sizeof shared / sizeof *shared; i++)
    ms_ranks_broadcast(part->ranks, 0, (int64_t)shared[i].bytes, shared[i].data);
}

/*------------------------------------- creation -------------------------------------------------*/

/* What all ranks have becomes that of `order`, the rest messages. */
static void take_whole(const ms_scene *s, const ms_rank_part *part, ms_whole_order *whole,
                       ms_rank_order *order, messages *m) {
  fill_messages(s, part, whole, m);
  order->islands = whole->islands, whole->islands = (ms_whole_islands){0};
  order->angle_position = whole->angle_position, whole->angle_position = NULL;
}

static msim_status share_order(const ms_scene *s, const ms_rank_part *part, ms_whole_order *whole,
                               ms_rank_order *order, messages *m, msim_error *err) {
  ms_ranks *ranks = part->ranks;
  int32_t n = whole->islands.n;
  ms_ranks_broadcast(ranks, 0, sizeof n, &n);
  order->islands.n = n;
  const int fits = ranks->failed || allocate(s, part, order, m);
  const msim_status status = ms_ranks_agree(
      ranks, fits ? MSIM_OK : ms_error_set_memory(err, "the order of the half-edges"), err);
  if (status) return status;
  if (is_root(part)) take_whole(s, part, whole, order, m);
  send_order(s, part, m, order);
  return ms_ranks_agree(ranks, MSIM_OK, err);
}

msim_status ms_rank_order_create(const ms_scene *scene, const ms_rank_part *part, int whole,
                                 ms_rank_order *order, msim_error *err) {
  ms_whole_order found = {0};
  messages m = {0};
  *order = (ms_rank_order){.nangles = scene->angles.n};
  msim_status status = is_root(part) ? ms_whole_order_create(scene, whole, &found, err) : MSIM_OK;
  status = ms_ranks_agree(part->ranks, status, err);
  if (!status) status = share_order(scene, part, &found, order, &m, err);
  ms_whole_order_destroy(scene, &found);
  MS_FREE(&scene->alloc, m.position, m.is_split);
  return status;
}

void ms_rank_order_destroy(const ms_scene *scene, ms_rank_order *order) {
  ms_whole_islands_destroy(&scene->alloc, &order->islands);
  MS_FREE(&scene->alloc, order->position, order->is_split, order->angle_position);
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
