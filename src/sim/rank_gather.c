#include "sim/rank_gather.h"

#include <string.h>

int ms_rank_gather_list(const ms_scene *s, ms_field f[MS_MOST_FIELDS]) {
  const size_t real = sizeof(double), number = sizeof(int32_t);
  const ms_field list[MS_MOST_FIELDS] = {
      {MS_SPRINGS, 2 * number, s->ij, 1}, {MS_FACES, 3 * number, s->faces, 1},
      {MS_PARTICLES, 1, s->pinned, 0},    {MS_PARTICLES, 3 * real, s->x, 0},
      {MS_PARTICLES, 3 * real, s->v, 0},  {MS_PARTICLES, real, s->mass, 0},
      {MS_SPRINGS, real, s->k, 0},        {MS_SPRINGS, real, s->rest, 0},
      {MS_SPRINGS, real, s->damping, 0},  {MS_PARTICLES, 3 * real, s->force, 0}};
  memcpy(f, list, sizeof list);
  return s->force ? MS_MOST_FIELDS : MS_MOST_FIELDS - 1;
}

static int64_t count_elements(const ms_section *s, ms_element of) {
  return of == MS_PARTICLES ? s->n : of == MS_SPRINGS ? s->nsprings : s->nfaces;
}

/* Numbers of particles in the slice become those in the whole scene. */
static const void *number_ends(const ms_rank_scene *kept, const ms_field *f, int32_t *scratch) {
  const int64_t n = count_elements(&kept->in_whole, f->of) * (int64_t)(f->size / sizeof *scratch);
  const int32_t *end = f->data;
  if (!kept->has_rows || !f->has_numbers) return end;
  for (int64_t i = 0; i < n; i++) scratch[i] = ms_section_particle(&kept->in_whole, (size_t)end[i]);
  return scratch;
}

void ms_rank_gather_field(ms_ranks *ranks, const ms_rank_scene *kept, int32_t root,
                          const ms_field *f, int32_t *scratch, void *all) {
  const int32_t n = ranks->n, rank = ranks->rank;
  const void *mine = number_ends(kept, f, scratch);
  for (int32_t r = 0; r < n; r++) {
    const ms_section s = ms_rank_scene_section(kept, r, n);
    const int64_t bytes = count_elements(&s, f->of) * (int64_t)f->size;
    kept->receive_bytes[r] = root == MS_ALL_RANKS || rank == root ? bytes : 0;
    kept->lengths[r] = bytes;
  }
  if (root == MS_ALL_RANKS) {
    ms_ranks_gather_parts(ranks, kept->receive_bytes, mine, all);
    return;
  }
  for (int32_t r = 0; r < n; r++) kept->send_bytes[r] = r == root ? kept->lengths[rank] : 0;
  ms_ranks_all_to_all(ranks, kept->send_bytes, mine, kept->receive_bytes, all);
}

msim_status ms_rank_gather_fields(ms_ranks *ranks, const ms_rank_scene *kept, int32_t root,
                                  ms_scene *to, int fits, msim_error *err) {
  const msim_allocator *alloc = &kept->slice->alloc;
  const int64_t ends = 2 * (int64_t)kept->in_whole.nsprings,
                corners = 3 * (int64_t)kept->in_whole.nfaces;
  ms_field mine[MS_MOST_FIELDS], all[MS_MOST_FIELDS];
  int32_t *scratch = NULL;
  fits = fits && MS_NEW(alloc, scratch, ends > corners ? ends : corners);
  msim_status status = fits ? MSIM_OK : ms_error_set_memory(err, "the whole scene");
  status = ms_ranks_agree(ranks, status, err);
  if (!status) {
    const int count = ms_rank_gather_list(kept->slice, mine);
    ms_rank_gather_list(to, all);
    for (int i = 0; i < count; i++)
      ms_rank_gather_field(ranks, kept, root, &mine[i], scratch, all[i].data);
    status = ms_ranks_agree(ranks, MSIM_OK, err);
  }
  ms_memory_free(alloc, scratch);
  return status;
}
