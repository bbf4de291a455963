/* checkpoint - save a run to memory, for recorders */
#ifndef MS_CHECKPOINT_H
#define MS_CHECKPOINT_H

#include "msim/msim.h"

/* As msim_sim_save(); with to = NULL a rank takes part, and gets no bytes. */
msim_status ms_checkpoint_save(msim_sim *sim, void *to, size_t capacity, size_t *length,
                               msim_error *err);

#endif
