/* saved - access to the parts of a checkpoint (src/sim/checkpoint.c), to forge them and recompute
 * the hash */
#ifndef FUZZ_SAVED_H
#define FUZZ_SAVED_H

#include <stddef.h>
#include <stdint.h>

/* The offset of the run, after the header and the fingerprint. */
size_t saved_run(const uint8_t *saved);

/* Set the length, and recompute the hash. */
void saved_mend(uint8_t *saved, size_t length);

#endif
