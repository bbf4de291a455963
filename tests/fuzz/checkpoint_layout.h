/* checkpoint_layout - access to the parts of a checkpoint (checkpoint/checkpoint.c), to forge them
 * and recompute the hash */
#ifndef FUZZ_CHECKPOINT_LAYOUT_H
#define FUZZ_CHECKPOINT_LAYOUT_H

#include <stddef.h>
#include <stdint.h>

/* The offset of the run, after the header and the fingerprint. */
size_t checkpoint_layout_run(const uint8_t *saved);

/* Set the length, and recompute the hash. */
void checkpoint_layout_rehash(uint8_t *saved, size_t length);

#endif
