#include "layout/spring_values.h"

#include <string.h>

#include "scene/laws.h"

/* The values of an entry, lane by lane */
typedef struct entry_values {
  double k[MS_SLICE], rest[MS_SLICE], damping[MS_SLICE], stiffness[MS_SLICE];
} entry_values;

/* Empty lanes have zeros, one by one: GCC would clear the whole entry by a string instruction, and
 * that takes longer than the rest. */
static void read_entry(const ms_scene *scene, const ms_springs *springs,
                       const ms_half_edges *half_edges, int32_t entry, entry_values *to) {
  const int32_t *spring = half_edges->spring + MS_SLICE * (size_t)entry;
  for (int lane = 0; lane < MS_SLICE; lane++) {
    const int is_there = spring[lane] >= 0;
    const int32_t e = is_there ? ms_springs_number(springs, spring[lane]) : 0;
    to->stiffness[lane] = is_there ? ms_scene_stiffness(scene, e) : 0;
    to->k[lane] = ms_scene_law(scene, e) ? 0 : to->stiffness[lane];
    to->rest[lane] = is_there ? scene->rest[e] : 0;
    to->damping[lane] = is_there ? ms_scene_damping(scene, e) : 0;
  }
}

enum { HASH_BITS = 12, HASHES = 1 << HASH_BITS };

/* Multiplicative hashing (Knuth 1998, 6.4), word by word; array by array, so that a processor works
 * at the multiplications of all four at once */
static uint32_t hash_entry(const entry_values *v) {
  enum { ARRAYS = sizeof *v / sizeof v->k };
  const uint64_t MULTIPLIER = UINT64_C(0x9E3779B97F4A7C15);
  uint64_t word[ARRAYS][MS_SLICE], hash[ARRAYS] = {0}, all = 0;
  memcpy(word, v, sizeof *v);
  for (int lane = 0; lane < MS_SLICE; lane++) {
    for (int a = 0; a < ARRAYS; a++) {
      hash[a] = (hash[a] ^ word[a][lane]) * MULTIPLIER;
      hash[a] ^= hash[a] >> 32;
    }
  }
  for (int a = 0; a < ARRAYS; a++) all = (all ^ hash[a]) * MULTIPLIER;
  return (uint32_t)(all >> (64 - HASH_BITS));
}

/* Set the index of each entry's values, in the order of the first of those that are alike. Returns
 * how many are distinct. */
static size_t find_distinct_entries(const ms_scene *scene, const ms_springs *springs,
                                    ms_half_edges *half_edges) {
  int32_t last[HASHES];
  size_t count = 0;
  memset(last, -1, sizeof last);
  for (int32_t entry = 0; entry < half_edges->nentries; entry++) {
    entry_values own, other;
    read_entry(scene, springs, half_edges, entry, &own);
    int32_t *alike = &last[hash_entry(&own)];
    if (*alike >= 0) read_entry(scene, springs, half_edges, *alike, &other);
    if (*alike >= 0 && memcmp(&own, &other, sizeof own) == 0) {
      half_edges->entry[entry].value = half_edges->entry[*alike].value;
    } else {
      half_edges->entry[entry].value = (int32_t)(MS_SLICE * count++);
      *alike = entry;
    }
  }
  return count;
}

static void store_distinct_entries(const ms_scene *scene, const ms_springs *springs,
                                   ms_half_edges *half_edges) {
  half_edges->nvalues = 0;
  for (int32_t entry = 0; entry < half_edges->nentries; entry++) {
    const size_t to = (size_t)half_edges->entry[entry].value;
    entry_values v;
    if (to < half_edges->nvalues) continue;
    read_entry(scene, springs, half_edges, entry, &v);
    memcpy(half_edges->k + to, v.k, sizeof v.k);
    memcpy(half_edges->stiffness + to, v.stiffness, sizeof v.stiffness);
    memcpy(half_edges->rest + to, v.rest, sizeof v.rest);
    memcpy(half_edges->damping + to, v.damping, sizeof v.damping);
    half_edges->nvalues += MS_SLICE;
  }
}

void ms_spring_values_update(const ms_scene *scene, const ms_springs *springs,
                             ms_half_edges *half_edges) {
  find_distinct_entries(scene, springs, half_edges);
  store_distinct_entries(scene, springs, half_edges);
}

/*------------------------------------- memory ---------------------------------------------------*/

void ms_spring_values_destroy(const ms_scene *scene, ms_half_edges *half_edges) {
  if (half_edges->stiffness != half_edges->k) ms_memory_free(&scene->alloc, half_edges->stiffness);
  MS_FREE(&scene->alloc, half_edges->k, half_edges->rest, half_edges->damping);
}

/* Replace the arrays by ones for that many entries, and set their values. On failure they stay. */
static msim_status replace_arrays(const ms_scene *scene, const ms_springs *springs, size_t entries,
                                  ms_half_edges *half_edges, msim_error *err) {
  const msim_allocator *alloc = &scene->alloc;
  const size_t room = MS_SLICE * entries;
  ms_half_edges to = *half_edges;
  to.k = to.rest = to.damping = to.stiffness = NULL;
  if (!MS_NEW(alloc, to.k, room) || !MS_NEW(alloc, to.rest, room) ||
      !MS_NEW(alloc, to.damping, room) || (scene->law && !MS_NEW(alloc, to.stiffness, room))) {
    ms_spring_values_destroy(scene, &to);
    return ms_error_set_memory(err, "the half-edges of the springs");
  }
  if (!to.stiffness) to.stiffness = to.k;
  to.room = room;
  ms_spring_values_destroy(scene, half_edges);
  *half_edges = to;
  store_distinct_entries(scene, springs, half_edges);
  return MSIM_OK;
}

msim_status ms_spring_values_reserve(const ms_scene *scene, const ms_springs *springs,
                                     ms_half_edges *half_edges, msim_error *err) {
  const size_t most = (size_t)half_edges->nentries;
  if (half_edges->room == MS_SLICE * most) return MSIM_OK;
  return replace_arrays(scene, springs, most, half_edges, err);
}

msim_status ms_spring_values_create(const ms_scene *scene, const ms_springs *springs,
                                    ms_half_edges *half_edges, msim_error *err) {
  const size_t distinct = find_distinct_entries(scene, springs, half_edges);
  const size_t entries = ms_scene_breaks(scene) ? (size_t)half_edges->nentries : distinct;
  return replace_arrays(scene, springs, entries, half_edges, err);
}
