#include "layout/rank_part.h"

#include "layout/bisection.h"
#include "layout/rank_order.h"

enum { NONE = -1 };

static int is_own(const ms_rank_part *part, int32_t p) {
  return part->owner[p] == part->ranks->rank;
}

/*------------------------------------- division -------------------------------------------------*/

static ms_rank_part *create_empty(const msim_allocator *alloc, ms_ranks *ranks) {
  const size_t n = (size_t)ranks->n;
  ms_rank_part *p = ms_memory_allocate(alloc, 1, sizeof *p);
  if (!p) return NULL;
  p->ranks = ranks;
  if (MS_NEW(alloc, p->bytes, n) && MS_NEW(alloc, p->next, n) && MS_NEW(alloc, p->send_bytes, n) &&
      MS_NEW(alloc, p->receive_bytes, n) && MS_NEW(alloc, p->bounds, n + 1))
    return p;
  ms_rank_part_destroy(alloc, p);
  return NULL;
}

static int assign_owners(const ms_scene *scene, ms_rank_part *p) {
  int32_t *scratch = NULL;
  const int fits = MS_NEW(&scene->alloc, p->owner, scene->nparticles) &&
                   MS_NEW(&scene->alloc, scratch, scene->nparticles);
  if (fits) ms_bisection_assign(scene, p->ranks->n, p->owner, scratch);
  for (int32_t i = 0; i < scene->nparticles && fits; i++)
    if (p->owner[i] >= 0) p->bytes[p->owner[i]] += (int64_t)sizeof(double);
  ms_memory_free(&scene->alloc, scratch);
  return fits;
}

static int64_t count_free(const ms_rank_part *part) {
  int64_t n = 0;
  for (int32_t r = 0; r < part->ranks->n; r++) n += ms_rank_part_count(part, r);
  return n;
}

static int create_scratch(const msim_allocator *alloc, ms_rank_part *part) {
  const int64_t own = ms_rank_part_count(part, part->ranks->rank);
  part->most_received = (int32_t)(count_free(part) / part->ranks->n) + 1;
  return MS_NEW(alloc, part->own, own) && MS_NEW(alloc, part->send, own + part->ranks->n) &&
         MS_NEW(alloc, part->receive, part->most_received);
}

static msim_status refuse_memory(msim_error *err) {
  return ms_error_set_memory(err, "the parts of the ranks");
}

msim_status ms_rank_part_create(const ms_scene *scene, ms_ranks *ranks, ms_rank_part **part,
                                msim_error *err) {
  const msim_allocator *alloc = &scene->alloc;
  ms_rank_part *p = *part = create_empty(alloc, ranks);
  const int fits = p && assign_owners(scene, p) && create_scratch(alloc, p) &&
                   MS_NEW(alloc, p->all, count_free(p));
  return fits ? MSIM_OK : refuse_memory(err);
}

msim_status ms_rank_part_create_on_root(const ms_scene *scene, ms_ranks *ranks, ms_rank_part **part,
                                        msim_error *err) {
  const msim_allocator *alloc = &scene->alloc;
  ms_rank_part *p = *part = create_empty(alloc, ranks);
  int fits = p && (ranks->rank > 0 || assign_owners(scene, p));
  msim_status status = ms_ranks_agree(ranks, fits ? MSIM_OK : refuse_memory(err), err);
  if (status) return status;
  ms_ranks_broadcast(ranks, 0, ranks->n * (int64_t)sizeof *p->bytes, p->bytes);
  fits = ranks->failed || create_scratch(alloc, p);
  return ms_ranks_agree(ranks, fits ? MSIM_OK : refuse_memory(err), err);
}

void ms_whole_islands_destroy(const msim_allocator *alloc, ms_whole_islands *islands) {
  MS_FREE(alloc, islands->first, islands->particle, islands->hash);
  *islands = (ms_whole_islands){0};
}

void ms_rank_part_forget_whole(const msim_allocator *alloc, ms_rank_part *part) {
  MS_FREE(alloc, part->owner, part->all);
  part->owner = NULL, part->all = NULL, part->number = NULL;
}

int ms_rank_part_provide_whole(const ms_scene *scene, ms_rank_part *part) {
  return MS_NEW(&scene->alloc, part->owner, scene->nparticles) &&
         MS_NEW(&scene->alloc, part->all, count_free(part));
}

void ms_rank_part_keep_order(const msim_allocator *alloc, ms_rank_part *part,
                             ms_rank_order *order) {
  ms_whole_islands_destroy(alloc, &part->whole);
  ms_memory_free(alloc, part->place);
  part->place = order->place, part->whole = order->islands;
  order->place = NULL, order->islands = (ms_whole_islands){0};
}

void ms_rank_part_destroy(const msim_allocator *alloc, ms_rank_part *part) {
  if (!part) return;
  ms_whole_islands_destroy(alloc, &part->whole);
  MS_FREE(alloc, part->owner, part->bytes, part->next, part->send_bytes, part->receive_bytes,
          part->bounds, part->own, part->all, part->place, part->send, part->receive, part);
}

double ms_rank_part_imbalance(const ms_scene *scene, const ms_rank_part *part) {
  int64_t most = 0, all = 0;
  for (int32_t r = 0; r < part->ranks->n; r++) {
    int64_t own = 0;
    for (int32_t p = 0; p < scene->nparticles; p++) own += part->owner[p] == r;
    all += own;
    if (own > most) most = own;
  }
  return all ? (double)most * part->ranks->n / (double)all : 1;
}

/* One component of all free particles */
static void gather_component(ms_rank_part *part, int32_t nparticles, double *component) {
  int64_t at = 0;
  double *to = part->own;
  for (int32_t p = 0; p < nparticles; p++)
    if (is_own(part, p)) *to++ = component[3 * (size_t)p];
  ms_ranks_gather_parts(part->ranks, part->bytes, part->own, part->all);
  if (part->ranks->failed) return;
  for (int32_t r = 0; r < part->ranks->n; r++) {
    part->next[r] = at;
    at += part->bytes[r] / (int64_t)sizeof(double);
  }
  for (int32_t p = 0; p < nparticles; p++)
    if (part->owner[p] >= 0) component[3 * (size_t)p] = part->all[part->next[part->owner[p]]++];
}

void ms_rank_part_gather(ms_rank_part *part, int32_t nparticles, double *array) {
  for (int c = 0; c < 3; c++) gather_component(part, nparticles, array + c);
}

/*------------------------------------- the island of a rank -------------------------------------*/

/* Ends of own springs that are not own go to the bucket of their owner, pinned ones to the last. */
static int mark_end(const ms_rank_part *part, int32_t n, const int32_t *end, int32_t *bucket) {
  int own = 0;
  for (int32_t c = 0; c < n; c++) own |= is_own(part, end[c]);
  for (int32_t c = 0; c < n && own; c++) {
    const int32_t owner = part->owner[end[c]];
    if (!is_own(part, end[c])) bucket[end[c]] = owner == MS_NO_OWNER ? part->ranks->n : owner;
  }
  return own;
}

/* to: scratch for each spring and angular spring; bucket: as mark_end, NONE at first */
static int list_springs(const ms_scene *s, const ms_rank_part *part, int32_t *to, int32_t *bucket,
                        ms_islands *out) {
  for (int32_t e = 0; e < s->nsprings; e++)
    to[e] = mark_end(part, 2, s->ij + 2 * (size_t)e, bucket) ? 0 : NONE;
  if (!ms_buckets_create(&s->alloc, s->nsprings, to, 1, &out->springs)) return 0;
  for (int32_t e = 0; e < s->angles.n; e++)
    to[e] = mark_end(part, 3, s->angles.ijk + 3 * (size_t)e, bucket) ? 0 : NONE;
  return ms_buckets_create(&s->alloc, s->angles.n, to, 1, &out->angles);
}

static int list_free(const ms_scene *s, const ms_rank_part *part, const ms_rank_order *order,
                     int32_t *to, ms_islands *out) {
  const int32_t n = (int32_t)ms_rank_part_count(part, part->ranks->rank);
  for (int32_t k = 0; k < n; k++) to[k] = 0;
  if (!ms_buckets_create(&s->alloc, n, to, 1, &out->free)) return 0;
  for (int32_t k = 0; k < n; k++) out->free.item[k] = order->own[k];
  return 1;
}

/* Ghosts, by owner, and pinned particles */
static int list_pinned(const ms_scene *s, const ms_rank_part *part, const int32_t *bucket,
                       ms_islands *out) {
  const int32_t n = part->ranks->n;
  ms_buckets *b = &out->pinned;
  if (!ms_buckets_create(&s->alloc, s->nparticles, bucket, n + 1, b)) return 0;
  out->nghosts = b->first[n];
  b->first[1] = b->first[n + 1]; /* the only island has all of them */
  return 1;
}

static int fill_island(const ms_scene *s, const ms_rank_part *part, const ms_rank_order *order,
                       int32_t *to, int32_t *bucket, ms_islands *out) {
  for (int32_t p = 0; p < s->nparticles; p++) bucket[p] = NONE;
  return list_free(s, part, order, to, out) && list_springs(s, part, to, bucket, out) &&
         list_pinned(s, part, bucket, out);
}

static int32_t largest_of(int32_t a, int32_t b, int32_t c) {
  const int32_t ab = a > b ? a : b;
  return ab > c ? ab : c;
}

msim_status ms_rank_part_create_island(const ms_scene *scene, const ms_rank_part *part,
                                       const ms_rank_order *order, ms_islands *islands,
                                       msim_error *err) {
  const msim_allocator *alloc = &scene->alloc;
  const int32_t most = largest_of(scene->nparticles, scene->nsprings, scene->angles.n);
  int32_t *to = NULL, *bucket = NULL;
  *islands = (ms_islands){.n = 1, .order = order};
  const int fits = MS_NEW(alloc, islands->row_scratch, scene->nparticles) &&
                   MS_NEW(alloc, to, most) && MS_NEW(alloc, bucket, scene->nparticles) &&
                   fill_island(scene, part, order, to, bucket, islands);
  MS_FREE(alloc, to, bucket);
  if (fits) return MSIM_OK;
  ms_islands_destroy(scene, islands);
  return ms_error_set_memory(err, "the part of this rank");
}
