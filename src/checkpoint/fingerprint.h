/* fingerprint - fingerprint of everything that affects the bits of a run: scene, options, version
 * of msim and instruction set, as pairs of name and value. The value of an array is a hash. */
#ifndef MS_FINGERPRINT_H
#define MS_FINGERPRINT_H

#include <stdint.h>

#include "msim/msim.h"

/* Called for each entry. is_hash: the value is a hash, for comparison only. */
typedef void ms_fingerprint_visitor(void *data, const char *name, const char *value, int is_hash);

/* Hash the arrays of the scene, unless that is done; changed springs need new hashes. Collective
 * where ranks have slices; a failure of the communicator is kept for the next agreement. */
void ms_fingerprint_hash_scene(msim_sim *sim);

/* Pass all entries to `mark`. Call ms_fingerprint_hash_scene() before: these hashes are listed,
 * too. */
void ms_fingerprint_list(const msim_sim *sim, ms_fingerprint_visitor *mark, void *data);

/* 1: checkpoints have no line for this value of an option, which older versions of msim lack. */
int ms_fingerprint_is_implied(const char *name, const char *value);

/* Compare the sim's fingerprint with the one of a checkpoint, `size` bytes of lines "name=value".
 * MSIM_ERR_ARG names the first entry that differs. */
msim_status ms_fingerprint_compare(const msim_sim *sim, const char *there, size_t size,
                                   msim_error *err);

#endif
