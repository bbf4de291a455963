#include "layout/halves.h"

#include <stdlib.h>

/* One half of a spring, seen from the row at hand. */
typedef struct half {
  int32_t neighbour, spring;
} half;

/* The halves of every unknown row, by neighbour. */
typedef struct adjacency {
  int32_t *first; /* nfree + 1 */
  half *halves;   /* first[nfree] */
} adjacency;

static int by_neighbour(const void *a, const void *b) {
  const half *p = a, *q = b;
  if (p->neighbour != q->neighbour) return p->neighbour < q->neighbour ? -1 : 1;
  return (p->spring > q->spring) - (p->spring < q->spring);
}

static msim_status list_halves(const ms_scene *scene, const ms_rows *rows,
                               const ms_springs *springs, adjacency *a, msim_error *err) {
  const int32_t nfree = rows->nfree;
  /* one more: first[r + 1] is where row r is being filled */
  a->first = ms_new(&scene->alloc, (size_t)nfree + 2, sizeof *a->first);
  a->halves = ms_new(&scene->alloc, 2 * (size_t)springs->n, sizeof *a->halves);
  if (!a->first || !a->halves) return ms_fail_memory(err, "the springs of each row");
  for (int32_t e = 0; e < springs->n; e++) {
    if (springs->i[e] < nfree) a->first[springs->i[e] + 2]++;
    if (springs->j[e] < nfree) a->first[springs->j[e] + 2]++;
  }
  for (int32_t r = 0; r < nfree; r++) a->first[r + 2] += a->first[r + 1];
  for (int32_t e = 0; e < springs->n; e++) {
    const int32_t i = springs->i[e], j = springs->j[e];
    if (i < nfree) a->halves[a->first[i + 1]++] = (half){j, e};
    if (j < nfree) a->halves[a->first[j + 1]++] = (half){i, e};
  }
  for (int32_t r = 0; r < nfree; r++)
    qsort(a->halves + a->first[r], (size_t)(a->first[r + 1] - a->first[r]), sizeof(half),
          by_neighbour);
  return MSIM_OK;
}

/*------------------------------------- one group ------------------------------------------------*/

/* The halves of a group's lanes that are still to be placed. */
typedef struct heads {
  const half *next[MS_GROUP], *end[MS_GROUP];
  int32_t row; /* of lane 0 */
} heads;

static heads begin(const adjacency *a, int32_t nfree, int32_t group) {
  heads h = {.row = group * MS_GROUP};
  for (int32_t lane = 0; lane < MS_GROUP && h.row + lane < nfree; lane++) {
    h.next[lane] = a->halves + a->first[h.row + lane];
    h.end[lane] = a->halves + a->first[h.row + lane + 1];
  }
  return h;
}

/* The least distance from a lane's row to its next neighbour; 0: all are placed. */
static int32_t least_offset(const heads *h) {
  int32_t least = INT32_MAX, any = 0;
  for (int32_t lane = 0; lane < MS_GROUP; lane++) {
    if (h->next[lane] == h->end[lane]) continue;
    const int32_t offset = h->next[lane]->neighbour - (h->row + lane);
    if (offset < least) least = offset;
    any = 1;
  }
  return any ? least : 0;
}

/* Slots of equal offset leave lanes empty where the mesh is irregular: take them while they are not
 * much more than the longest row needs. */
static int by_offset(heads h) {
  ptrdiff_t longest = 0, slots = 0;
  for (int32_t lane = 0; lane < MS_GROUP; lane++)
    if (h.end[lane] - h.next[lane] > longest) longest = h.end[lane] - h.next[lane];
  for (int32_t offset; (offset = least_offset(&h)) != 0; slots++)
    for (int32_t lane = 0; lane < MS_GROUP; lane++)
      if (h.next[lane] != h.end[lane] && h.next[lane]->neighbour == h.row + lane + offset)
        h.next[lane]++;
  return 2 * slots <= 3 * longest;
}

/* Take one slot's halves from the heads. NULL in empty lanes. */
static void take_slot(heads *h, int aligned, const half *slot[MS_GROUP]) {
  const int32_t offset = least_offset(h);
  for (int32_t lane = 0; lane < MS_GROUP; lane++) {
    const int takes = h->next[lane] != h->end[lane] &&
                      (!aligned || h->next[lane]->neighbour == h->row + lane + offset);
    slot[lane] = takes ? h->next[lane]++ : NULL;
  }
}

/*------------------------------------- all groups -----------------------------------------------*/

static int32_t count_slots(const adjacency *a, int32_t nfree, int32_t group) {
  heads h = begin(a, nfree, group);
  const int aligned = by_offset(h);
  const half *slot[MS_GROUP];
  int32_t n = 0;
  for (; least_offset(&h) != 0; n++) take_slot(&h, aligned, slot);
  return n;
}

/* The row that lane 0 would have to meet, if the neighbours are consecutive rows; else -1. */
static int32_t run_of(const ms_rows *rows, const half *const slot[MS_GROUP]) {
  int32_t start = -1;
  for (int32_t lane = 0; lane < MS_GROUP; lane++) {
    if (!slot[lane]) continue;
    const int32_t here = slot[lane]->neighbour - lane;
    if (here < 0 || here + MS_GROUP > rows->stride || (start >= 0 && here != start)) return -1;
    start = here;
  }
  return start;
}

static void fill_group(const adjacency *a, const ms_rows *rows, int32_t group, ms_halves *out) {
  heads h = begin(a, rows->nfree, group);
  const int aligned = by_offset(h);
  const half *slot[MS_GROUP];
  for (int32_t s = out->first[group]; s < out->first[group + 1]; s++) {
    take_slot(&h, aligned, slot);
    out->start[s] = run_of(rows, slot);
    for (int32_t lane = 0; lane < MS_GROUP; lane++) {
      const int32_t any = out->start[s] >= 0 ? out->start[s] + lane : h.row + lane;
      out->neighbour[MS_GROUP * s + lane] = slot[lane] ? slot[lane]->neighbour : any;
      out->spring[MS_GROUP * s + lane] = slot[lane] ? slot[lane]->spring : -1;
    }
  }
}

static msim_status fill(const ms_scene *scene, const ms_rows *rows, const adjacency *a,
                        ms_halves *out, msim_error *err) {
  const msim_allocator *alloc = &scene->alloc;
  int64_t slots = 0;
  out->first = ms_new(alloc, (size_t)out->ngroups + 1, sizeof(int32_t));
  if (!out->first) return ms_fail_memory(err, "the springs of each row");
  for (int32_t g = 0; g < out->ngroups; g++) {
    slots += count_slots(a, rows->nfree, g);
    if (slots > INT32_MAX / MS_GROUP)
      return ms_fail(err, MSIM_ERR_ARG, "the springs need more than %d slots of %d lanes",
                     INT32_MAX / MS_GROUP, MS_GROUP);
    out->first[g + 1] = (int32_t)slots;
  }
  out->nslots = (int32_t)slots;
  out->start = ms_new(alloc, (size_t)slots, sizeof(int32_t));
  out->neighbour = ms_new(alloc, MS_GROUP * (size_t)slots, sizeof(int32_t));
  out->spring = ms_new(alloc, MS_GROUP * (size_t)slots, sizeof(int32_t));
  out->k = ms_new(alloc, MS_GROUP * (size_t)slots, sizeof(double));
  out->rest = ms_new(alloc, MS_GROUP * (size_t)slots, sizeof(double));
  out->damping = ms_new(alloc, MS_GROUP * (size_t)slots, sizeof(double));
  if (!out->start || !out->neighbour || !out->spring || !out->k || !out->rest || !out->damping)
    return ms_fail_memory(err, "the springs of each row");
  for (int32_t g = 0; g < out->ngroups; g++) fill_group(a, rows, g, out);
  return MSIM_OK;
}

void ms_halves_update(const ms_springs *springs, ms_halves *halves) {
  for (int32_t at = 0; at < MS_GROUP * halves->nslots; at++) {
    const int32_t e = halves->spring[at];
    if (e < 0) continue;
    halves->k[at] = springs->k[e];
    halves->rest[at] = springs->rest[e];
    halves->damping[at] = springs->damping[e];
  }
}

msim_status ms_halves_create(const ms_scene *scene, const ms_rows *rows, const ms_springs *springs,
                             ms_halves *halves, msim_error *err) {
  adjacency a = {0};
  *halves = (ms_halves){.ngroups = rows->first_pinned / MS_GROUP};
  msim_status status = list_halves(scene, rows, springs, &a, err);
  if (!status) status = fill(scene, rows, &a, halves, err);
  if (!status) ms_halves_update(springs, halves);
  ms_delete(&scene->alloc, a.first);
  ms_delete(&scene->alloc, a.halves);
  return status;
}

void ms_halves_destroy(const ms_scene *scene, ms_halves *halves) {
  void *arrays[] = {halves->first, halves->start, halves->neighbour, halves->spring,
                    halves->k,     halves->rest,  halves->damping};
  for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) ms_delete(&scene->alloc, arrays[i]);
  *halves = (ms_halves){0};
}
