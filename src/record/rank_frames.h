/* rank_frames - frames whose rows several ranks write to one file, each an equal part of the
 * particles and of the cells, whatever particles it computes */
#ifndef MS_RANK_FRAMES_H
#define MS_RANK_FRAMES_H

#include "base/plugin.h"
#include "msim/recorder.h"
#include "record/strain.h"
#include "sim/sim.h"

typedef struct ms_rank_frames {
  ms_ranks *ranks;         /* NULL: one process, or rank 0, writes whole frames */
  msim_frame_part part;    /* of this rank, in the next frame */
  msim_frame_hash *hashes; /* of the parts of all ranks */
} ms_rank_frames;

/* For a sim of several ranks whose recorder writes parts; else frames->ranks is NULL. */
msim_status ms_rank_frames_init(ms_rank_frames *frames, const msim_recorder_type *type,
                                const msim_sim *sim, msim_error *err);
void ms_rank_frames_free(ms_rank_frames *frames, const msim_allocator *alloc);

/* The cells of this rank; all of them where frames->ranks is NULL. */
ms_cell_range ms_rank_frames_cells(const ms_rank_frames *frames, const ms_scene *scene);

/* Write a frame, of which x and v are those of all particles, strain and tension those of this
 * rank's cells; collective. self: of the recorder on this rank. */
msim_status ms_rank_frames_write(ms_rank_frames *frames, const msim_recorder_type *type, void *self,
                                 ms_plugin_host *host, const msim_frame *frame, msim_error *err);

#endif
