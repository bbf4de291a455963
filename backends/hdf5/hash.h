/* hash - of what a trajectory holds, as layout.h tells */
#ifndef HDF5_HASH_H
#define HDF5_HASH_H

#include "msim/recorder.h"

typedef struct hash {
  uint64_t sum, count;
} hash;

/* Go on with `count` words of 8 bytes. */
void h5_hash_words(hash *h, size_t count, const void *words);

/* Of all words but the first. */
uint64_t h5_slot_hash(const uint64_t *slot);
uint64_t h5_frame_hash(int64_t n, const msim_frame *frame);
uint64_t h5_static_hash(const msim_recording *what);

#endif
