/* checkpoint - save a run to memory, for recorders: each rank has a part of the bytes */
#ifndef MS_CHECKPOINT_H
#define MS_CHECKPOINT_H

#include "msim/msim.h"

/* The part of a checkpoint that a rank has; in one process all of it */
typedef struct ms_checkpoint_part {
  unsigned char *bytes;
  size_t first, size; /* `size` bytes of all, from `first` on, a multiple of 8 */
  size_t length;      /* of all parts */
} ms_checkpoint_part;

/* An upper bound of `size`, as msim_sim_save_size() is of `length` */
size_t ms_checkpoint_part_capacity(const msim_sim *sim);

/* As msim_sim_save(), to memory for this rank's part */
msim_status ms_checkpoint_save_part(msim_sim *sim, void *to, size_t capacity,
                                    ms_checkpoint_part *part, msim_error *err);

#endif
