#include "record/rank_frames.h"

#include "record/recorders.h"

msim_status ms_rank_frames_init(ms_rank_frames *f, const msim_recorder_type *type,
                                const msim_sim *sim, msim_error *err) {
  *f = (ms_rank_frames){.part.size = sizeof f->part};
  if (!sim->ranks || !MS_RECORDERS_HAS(type, commit)) return MSIM_OK;
  if (!MS_NEW(&sim->alloc, f->hashes, sim->ranks->n)) return ms_error_set_memory(err, "a recorder");
  f->ranks = sim->ranks;
  return MSIM_OK;
}

void ms_rank_frames_free(ms_rank_frames *f, const msim_allocator *alloc) {
  ms_memory_free(alloc, f->hashes);
}

/* All agree on the status of a step of writing on each rank. */
static msim_status agree(const ms_rank_frames *f, const msim_recorder_type *type,
                         ms_plugin_host *host, msim_status status, msim_error *err) {
  if (status) ms_plugin_fail(host, type->name, status, err);
  return ms_ranks_agree(f->ranks, status, err);
}

msim_status ms_rank_frames_write(ms_rank_frames *f, const msim_recorder_type *type, void *self,
                                 ms_plugin_host *host, const ms_section *section,
                                 const msim_frame *frame, msim_error *err) {
  const int is_first = f->ranks->rank == 0;
  msim_frame_hash hash = {0, 0}, sum = {0, 0};
  f->part.first = section->first, f->part.n = section->n;
  f->part.first_cell = ms_section_first_cell(section);
  f->part.ncells = ms_section_count_cells(section);
  msim_status status = agree(f, type, host, is_first ? type->begin(self) : MSIM_OK, err);
  if (!status) status = agree(f, type, host, type->write_part(self, frame, &f->part, &hash), err);
  if (status) return status;
  ms_ranks_gather(f->ranks, sizeof hash, &hash, f->hashes);
  for (int32_t r = 0; r < f->ranks->n; r++)
    sum.rows += f->hashes[r].rows, sum.checkpoint += f->hashes[r].checkpoint;
  status =
      agree(f, type, host, is_first ? type->commit(self, frame, &f->part, &sum) : MSIM_OK, err);
  if (!status) f->part.frame++;
  return status;
}
