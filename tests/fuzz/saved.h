/* saved - a checkpoint as src/sim/checkpoint.c lays it out, to get behind its hash */
#ifndef FUZZ_SAVED_H
#define FUZZ_SAVED_H

#include <stddef.h>
#include <stdint.h>

/* Where the run begins, behind the header and the marks. */
size_t saved_run(const uint8_t *saved);

/* Say that there are so many bytes, and whose hash it is. */
void saved_mend(uint8_t *saved, size_t length);

#endif
