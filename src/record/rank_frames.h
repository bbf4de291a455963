/* rank_frames - frames whose rows several ranks write to one file, each those of its section of the
 * scene (scene/section.h), whatever particles it computes */
#ifndef MS_RANK_FRAMES_H
#define MS_RANK_FRAMES_H

#include "base/plugin.h"
#include "msim/recorder.h"
#include "scene/section.h"
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

/* Write a frame, which has the rows of the section of this rank; collective. self: of the
 * recorder on this rank. */
msim_status ms_rank_frames_write(ms_rank_frames *frames, const msim_recorder_type *type, void *self,
                                 ms_plugin_host *host, const ms_section *section,
                                 const msim_frame *frame, msim_error *err);

#endif
