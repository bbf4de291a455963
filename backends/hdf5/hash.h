/* hash - hashes of the contents of a trajectory, as defined in layout.h */
#ifndef HDF5_HASH_H
#define HDF5_HASH_H

#include "msim/recorder.h"

typedef struct hash {
  uint64_t sum, count;
} hash;

/* Add `count` words of 8 bytes. */
void h5_hash_words(hash *h, size_t count, const void *words);

/* Hash of all words but the first. */
uint64_t h5_slot_hash(const uint64_t *slot);
/* Its parts: of the words of a slot between the first one and the bytes, and of some of these, from
 * byte `first` on, a multiple of 8 */
uint64_t h5_slot_head_hash(const uint64_t *head);
uint64_t h5_slot_bytes_hash(size_t first, const void *bytes, size_t size);
/* Hash of a frame of n particles: of the v and x of some, and of what is left */
uint64_t h5_rows_hash(int64_t n, const msim_frame *frame, int64_t first, int64_t rows);
uint64_t h5_frame_rest_hash(int64_t n, const msim_frame *frame);
/* The number of words before the text of the scene, and the hash of all with that of the text */
uint64_t h5_scene_words(const msim_recording *what);
uint64_t h5_static_hash(const msim_recording *what, uint64_t scene_hash);

#endif
