#include "sim/rank_distribute.h"

#include "layout/rank_order.h"
#include "scene/scene_data.h"
#include "sim/rank_fetch.h"

static int is_root(const ms_ranks *ranks) { return ranks->rank == 0; }

static msim_status agree(ms_ranks *ranks, int fits, msim_error *err) {
  return ms_ranks_agree_on_memory(ranks, fits, "the part of this rank", err);
}

/*------------------------------------- on rank 0 ------------------------------------------------*/

/* The whole scene with what rank 0 needs of it; the others have its counts. */
static ms_scene *create_topology(const msim_scene *scene, const ms_ranks *ranks) {
  const ms_scene_part *part = scene->part;
  ms_scene *t = ms_scene_data_create_like(scene->data, 0, 0, 0, NULL);
  if (!t) return NULL;
  t->nparticles = part->nparticles, t->nsprings = part->nsprings;
  const size_t n = (size_t)part->nparticles;
  if (!is_root(ranks) || (MS_NEW(&t->alloc, t->x, 3 * n) && MS_NEW(&t->alloc, t->pinned, n)))
    return t;
  ms_scene_release(t);
  return NULL;
}

/* An array of slices to the same one of the topology on rank 0 */
static void gather_array(ms_ranks *ranks, const ms_rank_scene *kept, ms_element of, size_t size,
                         void *mine, void *all) {
  ms_rank_gather_field(ranks, kept, 0, &(ms_field){of, size, mine, 0}, NULL, all);
}

/* Owners by the positions of all particles, of which each slice gets those of its own ones */
static msim_status assign_owners(ms_ranks *ranks, ms_scene *t, ms_rank_load *load,
                                 msim_error *err) {
  ms_rank_scene *kept = load->kept;
  const ms_scene *slice = kept->slice;
  gather_array(ranks, kept, MS_PARTICLES, 3 * sizeof *t->x, slice->x, t->x);
  gather_array(ranks, kept, MS_PARTICLES, sizeof *t->pinned, slice->pinned, t->pinned);
  msim_status status = ms_ranks_agree(ranks, MSIM_OK, err);
  if (!status) status = ms_rank_part_create_on_root(t, ranks, &load->part, err);
  ms_memory_free(&t->alloc, t->x);
  t->x = NULL;
  if (!status) status = agree(ranks, !!MS_NEW(&t->alloc, kept->owner, kept->in_whole.n), err);
  if (status) return status;
  for (int32_t r = 0; r < ranks->n; r++) {
    const ms_section is = ms_section_of_rank(t, r, ranks->n);
    kept->send_bytes[r] = is_root(ranks) ? is.n * (int64_t)sizeof *kept->owner : 0;
    kept->receive_bytes[r] = r == 0 ? kept->in_whole.n * (int64_t)sizeof *kept->owner : 0;
  }
  ms_ranks_all_to_all(ranks, kept->send_bytes, load->part->owner, kept->receive_bytes, kept->owner);
  return ms_ranks_agree(ranks, MSIM_OK, err);
}

/* The order of one process, from the springs of all ranks */
static msim_status find_order(ms_ranks *ranks, ms_scene *t, int islands, ms_rank_load *load,
                              msim_error *err) {
  ms_rank_scene *kept = load->kept;
  int fits = MS_NEW(&t->alloc, kept->order, 1) != NULL;
  if (is_root(ranks)) fits = fits && MS_NEW(&t->alloc, t->ij, 2 * (size_t)t->nsprings);
  const msim_status status = agree(ranks, fits, err);
  if (status) return status;
  gather_array(ranks, kept, MS_SPRINGS, 2 * sizeof *t->ij, kept->slice->ij, t->ij);
  const msim_status gathered = ms_ranks_agree(ranks, MSIM_OK, err);
  return gathered ? gathered : ms_rank_order_create(t, load->part, !islands, kept->order, err);
}

/*------------------------------------- springs --------------------------------------------------*/

/* The ranks that have a spring: those of its free ends, which may be one; returns their number. */
static int list_ranks_of(const ms_scene *t, const int32_t *owner, int32_t e, int32_t rank[2]) {
  const int32_t i = owner[t->ij[2 * (size_t)e]], j = owner[t->ij[2 * (size_t)e + 1]];
  int n = 0;
  if (i >= 0) rank[n++] = i;
  if (j >= 0 && j != i) rank[n++] = j;
  return n;
}

static void count_springs(const ms_scene *t, const int32_t *owner, int64_t *count) {
  int32_t rank[2];
  for (int32_t e = 0; e < t->nsprings; e++)
    for (int n = list_ranks_of(t, owner, e, rank); n > 0; n--) count[rank[n - 1]]++;
}

static void list_springs(const ms_scene *t, const int32_t *owner, int64_t *next, int32_t *number) {
  int32_t rank[2];
  for (int32_t e = 0; e < t->nsprings; e++)
    for (int n = list_ranks_of(t, owner, e, rank); n > 0; n--) number[next[rank[n - 1]]++] = e;
}

/* kept->spring: the springs at own particles, *n of them */
static msim_status send_springs(ms_ranks *ranks, const ms_scene *t, const ms_rank_load *load,
                                int32_t *n, msim_error *err) {
  ms_rank_scene *kept = load->kept;
  const int64_t size = sizeof *kept->spring;
  int32_t *all = NULL;
  int64_t sum = 0;
  for (int32_t r = 0; r < ranks->n; r++) kept->lengths[r] = 0;
  if (is_root(ranks)) count_springs(t, load->part->owner, kept->lengths);
  ms_ranks_broadcast(ranks, 0, ranks->n * (int64_t)sizeof *kept->lengths, kept->lengths);
  *n = ranks->failed ? 0 : (int32_t)kept->lengths[ranks->rank];
  for (int32_t r = 0; r < ranks->n && !ranks->failed; r++) {
    kept->send_bytes[r] = is_root(ranks) ? size * kept->lengths[r] : 0;
    kept->receive_bytes[r] = r == 0 ? size * *n : 0;
    const int64_t begin = sum;
    sum += kept->lengths[r], kept->lengths[r] = begin;
  }
  const int fits =
      MS_NEW(&t->alloc, kept->spring, *n) && (!is_root(ranks) || MS_NEW(&t->alloc, all, sum));
  msim_status status = agree(ranks, fits, err);
  if (!status && all) list_springs(t, load->part->owner, kept->lengths, all);
  if (!status) {
    ms_ranks_all_to_all(ranks, kept->send_bytes, all, kept->receive_bytes, kept->spring);
    status = ms_ranks_agree(ranks, MSIM_OK, err);
  }
  ms_memory_free(&t->alloc, all);
  return status;
}

/*------------------------------------- the part -------------------------------------------------*/

/* kept->particle: own particles and the ends of nsprings springs, each once, ascending, *n of them.
 * Returns 0 without memory. */
static int list_particles(const msim_allocator *alloc, ms_rank_scene *kept, int64_t nown,
                          int64_t nsprings, const int32_t *end, int32_t *n) {
  const int64_t most = nown + 2 * nsprings;
  int32_t *all = NULL;
  if (!MS_NEW(alloc, all, most)) return 0;
  for (int64_t k = 0; k < most; k++) all[k] = k < nown ? kept->order->own[k] : end[k - nown];
  *n = ms_rank_fetch_sort(most, all);
  const int fits = MS_NEW(alloc, kept->particle, *n) != NULL;
  for (int32_t k = 0; k < *n && fits; k++) kept->particle[k] = all[k];
  ms_memory_free(alloc, all);
  return fits;
}

static void number_locally(const ms_rank_scene *kept, int32_t nparticles, int64_t n,
                           int32_t *particle) {
  for (int64_t k = 0; k < n; k++)
    particle[k] = ms_section_search(nparticles, kept->particle, particle[k]);
}

/* Arrays of particles or springs, but the ends of springs, which the part has */
static void fetch_fields(const ms_rank_fetch *f, ms_element of, const ms_scene *slice,
                         const ms_scene *own) {
  ms_field from[MS_MOST_FIELDS], to[MS_MOST_FIELDS];
  const int count = ms_rank_gather_list(slice, from);
  ms_rank_gather_list(own, to);
  for (int i = 0; i < count; i++)
    if (from[i].of == of && !from[i].has_numbers)
      ms_rank_fetch_rows(f, from[i].size, from[i].data, to[i].data);
}

/* The particles of the part, once its springs have their ends in numbers of the whole scene */
static msim_status fetch_particles(const msim_scene *scene, ms_ranks *ranks, ms_rank_load *load,
                                   msim_error *err) {
  const int32_t nparticles = load->scene->nparticles;
  ms_rank_scene *kept = load->kept;
  ms_rank_part *part = load->part;
  ms_rank_fetch f = {0};
  msim_status status = agree(ranks, !!MS_NEW(&scene->data->alloc, part->owner, nparticles), err);
  if (!status)
    status = ms_rank_fetch_create(ranks, kept, MS_PARTICLES, nparticles, kept->particle, &f, err);
  if (!status) {
    fetch_fields(&f, MS_PARTICLES, kept->slice, load->scene);
    ms_rank_fetch_rows(&f, sizeof *part->owner, kept->owner, part->owner);
    status = ms_ranks_agree(ranks, MSIM_OK, err);
  }
  ms_rank_fetch_destroy(&f);
  if (status) return status;
  number_locally(kept, nparticles, 2 * (int64_t)load->scene->nsprings, load->scene->ij);
  number_locally(kept, nparticles, ms_rank_part_count(part, ranks->rank), kept->order->own);
  part->number = kept->particle;
  return MSIM_OK;
}

/* load->scene, with springs whose ends have their numbers in the whole scene, and room for the
 * particles. end: 2 nsprings; f: of the springs */
static msim_status fetch_springs(const msim_scene *scene, const ms_rank_fetch *f, int32_t nsprings,
                                 int32_t *end, ms_rank_load *load, msim_error *err) {
  ms_rank_scene *kept = load->kept;
  ms_ranks *ranks = f->ranks;
  int32_t n;
  ms_rank_fetch_rows(f, 2 * sizeof *end, kept->slice->ij, end);
  msim_status status = ms_ranks_agree(ranks, MSIM_OK, err);
  if (status) return status;
  if (list_particles(&scene->data->alloc, kept, ms_rank_part_count(load->part, ranks->rank),
                     nsprings, end, &n))
    load->scene = ms_scene_data_create_like(scene->data, n, nsprings, 0, NULL);
  status = agree(ranks, load->scene != NULL, err);
  if (status) return status;
  for (size_t k = 0; k < 2 * (size_t)nsprings; k++) load->scene->ij[k] = end[k];
  fetch_fields(f, MS_SPRINGS, kept->slice, load->scene);
  return ms_ranks_agree(ranks, MSIM_OK, err);
}

static msim_status fetch_part(const msim_scene *scene, ms_ranks *ranks, int32_t nsprings,
                              ms_rank_load *load, msim_error *err) {
  const msim_allocator *alloc = &scene->data->alloc;
  const ms_rank_scene *kept = load->kept;
  ms_rank_fetch f = {0};
  int32_t *end = NULL;
  msim_status status = agree(ranks, !!MS_NEW(alloc, end, 2 * (size_t)nsprings), err);
  if (!status)
    status = ms_rank_fetch_create(ranks, kept, MS_SPRINGS, nsprings, kept->spring, &f, err);
  if (!status) status = fetch_springs(scene, &f, nsprings, end, load, err);
  ms_rank_fetch_destroy(&f);
  ms_memory_free(alloc, end);
  return status ? status : fetch_particles(scene, ranks, load, err);
}

/*------------------------------------- the whole ------------------------------------------------*/

msim_status ms_rank_distribute(const msim_scene *scene, ms_ranks *ranks, int islands,
                               ms_rank_load *load, msim_error *err) {
  int32_t nsprings = 0;
  load->kept = ms_rank_scene_create_from(scene->part);
  ms_scene *t = load->kept ? create_topology(scene, ranks) : NULL;
  msim_status status = agree(ranks, t != NULL, err);
  if (!status) status = assign_owners(ranks, t, load, err);
  if (!status) status = find_order(ranks, t, islands, load, err);
  if (!status) status = send_springs(ranks, t, load, &nsprings, err);
  ms_scene_release(t);
  if (status) return status;
  ms_memory_free(&scene->data->alloc, load->part->owner);
  load->part->owner = NULL;
  return fetch_part(scene, ranks, nsprings, load, err);
}
