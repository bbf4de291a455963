#include "sim/rank_others.h"

#include <string.h>

#include "sim/rank_gather.h"

/* Springs that pass by at a time */
enum { PIECE = 1 << 15 };

/* Marks of particles: pinned, on rank 0 alone, corners of faces of the section, and others that are
 * needed */
enum { PINNED = 1, CORNER = 2, END = 4 };

typedef struct search {
  const msim_sim *sim;
  const ms_section *section;
  uint8_t *mark; /* of all particles of the scene */
  ms_rank_others *found;
  int32_t capacity; /* of found->spring */
  int fits;
} search;

/*------------------------------------- marks ----------------------------------------------------*/

static void mark_pins(const search *s) {
  const msim_sim *sim = s->sim;
  if (sim->kept) {
    const ms_field pinned = {MS_PARTICLES, 1, sim->kept->slice->pinned, 0};
    ms_rank_gather_field(sim->ranks, sim->kept, 0, &pinned, NULL, s->mark);
  } else if (sim->ranks->rank == 0)
    memcpy(s->mark, sim->scene->pinned, (size_t)sim->scene->nparticles);
}

static void mark_corners(const search *s) {
  const int32_t *corner = s->sim->kept ? s->sim->kept->slice->faces
                                       : s->sim->scene->faces + 3 * (size_t)s->section->first_face;
  for (int64_t k = 0; k < 3 * (int64_t)s->section->nfaces; k++) s->mark[corner[k]] |= CORNER;
}

static void mark_ends(const search *s, int32_t n, const int32_t *end) {
  for (int32_t k = 0; k < n; k++) s->mark[end[k]] |= END;
}

/* Ranks that have slices of the scene have no angular springs. */
static void mark_angles(const search *s) {
  const ms_scene_angles *a = &s->sim->scene->angles;
  const int32_t first = s->section->first_angle;
  for (int32_t e = 0; e < a->n; e++) {
    const int32_t *end = a->ijk + 3 * (size_t)e;
    const int is_pinned = (s->mark[end[0]] | s->mark[end[1]] | s->mark[end[2]]) & PINNED;
    if (is_pinned || (e >= first && e - first < s->section->nangles)) mark_ends(s, 3, end);
  }
}

/*------------------------------------- springs --------------------------------------------------*/

static void add_spring(search *s, int32_t e) {
  ms_rank_others *o = s->found;
  s->fits = s->fits && !ms_memory_reserve(&s->sim->alloc, MS_ARRAY(o->spring), o->nsprings,
                                          &s->capacity, (int64_t)o->nsprings + 1, NULL);
  if (s->fits) o->spring[o->nsprings++] = e;
}

/* Check springs from number `first` on. */
static void check_springs(search *s, int32_t first, int32_t n, const int32_t *ij) {
  for (int32_t k = 0; k < n; k++) {
    const int32_t *end = ij + 2 * (size_t)k, at = first + k - s->section->first_spring;
    const uint8_t a = s->mark[end[0]], b = s->mark[end[1]];
    const int is_own = at >= 0 && at < s->section->nsprings;
    if (!is_own && !(a & b & CORNER) && !((a | b) & PINNED)) continue;
    mark_ends(s, 2, end);
    if (!is_own) add_spring(s, first + k);
  }
}

static int32_t lesser(int32_t a, int32_t b) { return a < b ? a : b; }

/* Each rank in turn shows all others its slice. piece: room for PIECE springs, or for all */
static void pass_springs(search *s, int32_t *piece) {
  const ms_rank_scene *kept = s->sim->kept;
  ms_ranks *ranks = s->sim->ranks;
  for (int32_t r = 0; r < ranks->n; r++) {
    const ms_section of = ms_rank_scene_section(kept, r, ranks->n);
    for (int32_t begin = 0; begin < of.nsprings && !ranks->failed; begin += PIECE) {
      const int32_t n = lesser(PIECE, of.nsprings - begin);
      const size_t bytes = 2 * (size_t)n * sizeof *piece;
      if (r == ranks->rank) memcpy(piece, kept->slice->ij + 2 * (size_t)begin, bytes);
      ms_ranks_broadcast(ranks, r, (int64_t)bytes, piece);
      if (!ranks->failed) check_springs(s, of.first_spring + begin, n, piece);
    }
  }
}

/*------------------------------------- all ------------------------------------------------------*/

static msim_status agree(const search *s, int fits, msim_error *err) {
  return ms_ranks_agree_on_memory(s->sim->ranks, fits, "the rows of a frame", err);
}

/* The particles that are marked, without those of the section, and no more room than needed */
static int list_found(search *s, int32_t nparticles) {
  const msim_allocator *alloc = &s->sim->alloc;
  ms_rank_others *o = s->found;
  int32_t *spring = o->spring;
  o->spring = NULL;
  memset(s->mark + s->section->first, 0, (size_t)s->section->n);
  for (int32_t p = 0; p < nparticles; p++) o->n += s->mark[p] != 0;
  const int fits =
      s->fits && MS_NEW(alloc, o->particle, o->n) && MS_NEW(alloc, o->spring, o->nsprings);
  for (int32_t p = 0, k = 0; p < nparticles && fits; p++)
    if (s->mark[p]) o->particle[k++] = p;
  for (int32_t k = 0; k < o->nsprings && fits; k++) o->spring[k] = spring[k];
  ms_memory_free(alloc, spring);
  return fits;
}

msim_status ms_rank_others_find(const msim_sim *sim, const ms_section *section,
                                ms_rank_others *others, msim_error *err) {
  const int32_t n = ms_rank_scene_count_particles(sim);
  search s = {.sim = sim, .section = section, .found = others, .fits = 1};
  int32_t *piece = NULL;
  *others = (ms_rank_others){0};
  const size_t room = sim->kept ? 2 * (size_t)lesser(PIECE, sim->kept->nsprings) : 0;
  msim_status status =
      agree(&s, MS_NEW(&sim->alloc, s.mark, n) && MS_NEW(&sim->alloc, piece, room), err);
  if (!status) {
    mark_pins(&s);
    mark_corners(&s);
    if (sim->kept) pass_springs(&s, piece);
    else check_springs(&s, 0, sim->scene->nsprings, sim->scene->ij);
    mark_angles(&s);
    status = agree(&s, list_found(&s, n), err);
  }
  MS_FREE(&sim->alloc, s.mark, piece);
  return status;
}
