#include "record/rank_frames.h"

#include "record/recorders.h"

/* Parts of equal size begin at these of n rows, for rank n of n at the end. */
static int64_t first_row(const ms_ranks *ranks, int64_t n, int32_t rank) {
  return n / ranks->n * rank + n % ranks->n * rank / ranks->n;
}

msim_status ms_rank_frames_init(ms_rank_frames *f, const msim_recorder_type *type,
                                const msim_sim *sim, msim_error *err) {
  ms_ranks *ranks = sim->ranks;
  const int64_t n = sim->scene->nparticles, ncells = ms_cell_range_all(sim->scene).n;
  *f = (ms_rank_frames){0};
  if (!ranks || !MS_RECORDERS_HAS(type, commit)) return MSIM_OK;
  const int64_t first = first_row(ranks, n, ranks->rank),
                cell = first_row(ranks, ncells, ranks->rank);
  f->part = (msim_frame_part){.size = sizeof f->part,
                              .first = (int32_t)first,
                              .n = (int32_t)(first_row(ranks, n, ranks->rank + 1) - first),
                              .first_cell = cell,
                              .ncells = first_row(ranks, ncells, ranks->rank + 1) - cell};
  if (!MS_NEW(&sim->alloc, f->hashes, ranks->n)) return ms_error_set_memory(err, "a recorder");
  f->ranks = ranks;
  return MSIM_OK;
}

void ms_rank_frames_free(ms_rank_frames *f, const msim_allocator *alloc) {
  ms_memory_free(alloc, f->hashes);
}

ms_cell_range ms_rank_frames_cells(const ms_rank_frames *f, const ms_scene *scene) {
  if (!f->ranks) return ms_cell_range_all(scene);
  return (ms_cell_range){f->part.first_cell, f->part.ncells};
}

/* All agree on the status of a step of writing on each rank. */
static msim_status agree(const ms_rank_frames *f, const msim_recorder_type *type,
                         ms_plugin_host *host, msim_status status, msim_error *err) {
  if (status) ms_plugin_fail(host, type->name, status, err);
  return ms_ranks_agree(f->ranks, status, err);
}

msim_status ms_rank_frames_write(ms_rank_frames *f, const msim_recorder_type *type, void *self,
                                 ms_plugin_host *host, const msim_frame *frame, msim_error *err) {
  const int is_first = f->ranks->rank == 0;
  msim_frame part = *frame;
  msim_frame_hash hash = {0, 0}, sum = {0, 0};
  part.x += 3 * (size_t)f->part.first, part.v += 3 * (size_t)f->part.first;
  msim_status status = agree(f, type, host, is_first ? type->begin(self) : MSIM_OK, err);
  if (!status) status = agree(f, type, host, type->write_part(self, &part, &f->part, &hash), err);
  if (status) return status;
  ms_ranks_gather(f->ranks, sizeof hash, &hash, f->hashes);
  for (int32_t r = 0; r < f->ranks->n; r++)
    sum.rows += f->hashes[r].rows, sum.checkpoint += f->hashes[r].checkpoint;
  status =
      agree(f, type, host, is_first ? type->commit(self, frame, &f->part, &sum) : MSIM_OK, err);
  if (!status) f->part.frame++;
  return status;
}
