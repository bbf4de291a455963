#include "layout/islands.h"

#include "layout/components.h"

enum { NONE = -1 };

/*------------------------------------- connected components -------------------------------------*/

/* The free end of a spring, the first one if both are free; NONE: both are pinned. */
static int32_t free_end(const ms_scene *s, int32_t e) {
  const int32_t i = s->ij[2 * (size_t)e], j = s->ij[2 * (size_t)e + 1];
  return !s->pinned[i] ? i : !s->pinned[j] ? j : NONE;
}

/* The pinned end of a spring with one free end; NONE: any other spring. */
static int32_t pinned_end(const ms_scene *s, int32_t e) {
  const int32_t i = s->ij[2 * (size_t)e], j = s->ij[2 * (size_t)e + 1];
  return s->pinned[i] == s->pinned[j] ? NONE : s->pinned[i] ? i : j;
}

/* The first free corner of an angular spring; NONE: all are pinned. */
static int32_t free_corner(const ms_scene *s, int32_t e) {
  const int32_t *ijk = s->angles.ijk + 3 * (size_t)e;
  for (int c = 0; c < 3; c++)
    if (!s->pinned[ijk[c]]) return ijk[c];
  return NONE;
}

static void join_corners(const ms_scene *s, int32_t e, int32_t *of) {
  const int32_t *ijk = s->angles.ijk + 3 * (size_t)e, first = free_corner(s, e);
  for (int c = 0; c < 3; c++) {
    if (s->pinned[ijk[c]]) continue;
    if (of[ijk[c]] == NONE) of[ijk[c]] = ijk[c];
    ms_disjoint_sets_join(of, first, ijk[c]);
  }
}

/* of[p]: the first particle of p's component; NONE if p is pinned. */
static void find_components(const ms_scene *s, int32_t *of) {
  int32_t first_loose = NONE;
  for (int32_t p = 0; p < s->nparticles; p++) of[p] = NONE;
  for (int32_t e = 0; e < s->nsprings; e++) {
    const int32_t i = s->ij[2 * (size_t)e], j = s->ij[2 * (size_t)e + 1];
    if (!s->pinned[i] && of[i] == NONE) of[i] = i;
    if (!s->pinned[j] && of[j] == NONE) of[j] = j;
    if (!s->pinned[i] && !s->pinned[j]) ms_disjoint_sets_join(of, i, j);
  }
  for (int32_t e = 0; e < s->angles.n; e++) join_corners(s, e, of);
  for (int32_t p = 0; p < s->nparticles; p++) {
    if (s->pinned[p]) continue;
    if (of[p] == NONE && first_loose == NONE) first_loose = p;
    of[p] = of[p] == NONE ? first_loose : ms_disjoint_sets_find_root(of, p);
  }
}

/*------------------------------------- components to islands ------------------------------------*/

/* of[p]: in, the first particle of p's component; out, its island. size: scratch, n zeros. Returns
 * the number of islands. Small components open a new island only if enough are left to fill it. */
static int32_t number_islands(int32_t n, int32_t *of, int32_t *size) {
  int32_t islands = 0, open = NONE, held = 0, left = 0;
  for (int32_t p = 0; p < n; p++)
    if (of[p] != NONE) size[of[p]]++;
  for (int32_t p = 0; p < n; p++)
    if (size[p] < MS_MIN_ISLAND) left += size[p];
  for (int32_t p = 0; p < n; p++) {
    if (of[p] == NONE) continue;
    if (of[p] != p) {
      of[p] = of[of[p]];
    } else if (size[p] >= MS_MIN_ISLAND) {
      of[p] = islands++;
    } else {
      if (open == NONE) open = islands++, held = 0;
      of[p] = open;
      held += size[p], left -= size[p];
      if (held >= MS_MIN_ISLAND && left >= MS_MIN_ISLAND) open = NONE;
    }
  }
  return islands;
}

/* At most so many links, springs or angular springs */
static size_t count_connections(const ms_scene *s) {
  return (size_t)s->nsprings + 2 * (size_t)s->angles.n;
}

/*------------------------------------- contents of islands --------------------------------------*/

/* A pinned particle and a free one that a spring connects */
typedef struct link {
  int32_t pinned, free;
} link;

/* link: nsprings + 2 for each angular spring. Returns their number. */
static int32_t list_links(const ms_scene *s, link *to) {
  int32_t n = 0;
  for (int32_t e = 0; e < s->nsprings; e++)
    if (pinned_end(s, e) != NONE) to[n++] = (link){pinned_end(s, e), free_end(s, e)};
  for (int32_t e = 0; e < s->angles.n; e++) {
    const int32_t *ijk = s->angles.ijk + 3 * (size_t)e, other = free_corner(s, e);
    for (int c = 0; c < 3 && other != NONE; c++)
      if (s->pinned[ijk[c]]) to[n++] = (link){ijk[c], other};
  }
  return n;
}

/* The links are sorted by their pinned end first: so each island gets its pinned particles in
 * ascending order, and duplicates, which are dropped, follow each other. last: scratch, one for
 * each island. */
static int sort_links(const ms_scene *s, const int32_t *of, int32_t nlinks, const link *links,
                      int32_t *to, int32_t *last, ms_islands *out) {
  ms_buckets held;
  for (int32_t k = 0; k < nlinks; k++) to[k] = links[k].pinned;
  int fits = ms_buckets_create(&s->alloc, nlinks, to, s->nparticles, &held);
  if (fits) {
    for (int32_t i = 0; i < out->n; i++) last[i] = NONE;
    for (int32_t k = 0; k < nlinks; k++) {
      const link *at = &links[held.item[k]];
      const int32_t island = of[at->free];
      held.item[k] = at->pinned;
      to[k] = last[island] == at->pinned ? NONE : island;
      last[island] = at->pinned;
    }
    fits = ms_buckets_create(&s->alloc, nlinks, to, out->n, &out->pinned);
    for (int32_t k = 0; fits && k < out->pinned.first[out->n]; k++)
      out->pinned.item[k] = held.item[out->pinned.item[k]];
  }
  ms_buckets_destroy(&s->alloc, &held);
  return fits;
}

static int sort_pinned_particles(const ms_scene *s, const int32_t *of, int32_t *to, int32_t *last,
                                 ms_islands *out) {
  link *links = ms_memory_allocate(&s->alloc, count_connections(s), sizeof *links);
  const int fits = links && sort_links(s, of, list_links(s, links), links, to, last, out);
  ms_memory_free(&s->alloc, links);
  return fits;
}

static int sort_contents(const ms_scene *s, const int32_t *of, int32_t *to, int32_t *last,
                         ms_islands *out) {
  for (int32_t e = 0; e < s->nsprings; e++) {
    const int32_t p = free_end(s, e);
    to[e] = p == NONE ? NONE : of[p];
  }
  int fits = ms_buckets_create(&s->alloc, s->nparticles, of, out->n, &out->free) &&
             ms_buckets_create(&s->alloc, s->nsprings, to, out->n, &out->springs);
  for (int32_t e = 0; e < s->angles.n; e++) {
    const int32_t p = free_corner(s, e);
    to[e] = p == NONE ? NONE : of[p];
  }
  fits = fits && ms_buckets_create(&s->alloc, s->angles.n, to, out->n, &out->angles);
  return fits && sort_pinned_particles(s, of, to, last, out);
}

/*------------------------------------- create and destroy ---------------------------------------*/

msim_status ms_islands_create(const ms_scene *scene, int whole, ms_islands *islands,
                              msim_error *err) {
  const msim_allocator *alloc = &scene->alloc;
  const size_t n = (size_t)scene->nparticles;
  int32_t *of = NULL, *size = NULL, *to = NULL;
  *islands = (ms_islands){.n = 1};
  int fits = MS_NEW(alloc, islands->row_scratch, n) && MS_NEW(alloc, of, n) &&
             MS_NEW(alloc, size, n + 1) && MS_NEW(alloc, to, count_connections(scene));
  if (fits && whole) {
    for (size_t p = 0; p < n; p++) of[p] = scene->pinned[p] ? NONE : 0;
  } else if (fits) {
    find_components(scene, of);
    islands->n = number_islands(scene->nparticles, of, size);
    if (islands->n == 0) islands->n = 1; /* all particles are pinned */
  }
  fits = fits && sort_contents(scene, of, to, size, islands);
  MS_FREE(alloc, of, size, to);
  if (fits) return MSIM_OK;
  ms_islands_destroy(scene, islands);
  return ms_error_set_memory(err, "the islands of the scene");
}

void ms_islands_destroy(const ms_scene *scene, ms_islands *islands) {
  ms_buckets_destroy(&scene->alloc, &islands->free);
  ms_buckets_destroy(&scene->alloc, &islands->pinned);
  ms_buckets_destroy(&scene->alloc, &islands->springs);
  ms_buckets_destroy(&scene->alloc, &islands->angles);
  ms_memory_free(&scene->alloc, islands->row_scratch);
  *islands = (ms_islands){0};
}

ms_island ms_islands_get(const ms_islands *islands, int32_t i) {
  const int32_t *free = islands->free.first + i, *pinned = islands->pinned.first + i;
  const int32_t *springs = islands->springs.first + i, *angles = islands->angles.first + i;
  return (ms_island){.nfree = free[1] - free[0],
                     .npinned = pinned[1] - pinned[0],
                     .nsprings = springs[1] - springs[0],
                     .nangles = angles[1] - angles[0],
                     .free = islands->free.item + free[0],
                     .pinned = islands->pinned.item + pinned[0],
                     .spring = islands->springs.item + springs[0],
                     .angle = islands->angles.item + angles[0],
                     .row_scratch = islands->row_scratch,
                     .nghosts = islands->nghosts,
                     .order = islands->order};
}
