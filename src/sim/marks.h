/* marks - fingerprint of everything that affects the bits of a run: scene, options, version of msim
 * and instruction set, as pairs of name and value. The value of an array is a hash. */
#ifndef MS_MARKS_H
#define MS_MARKS_H

#include <stdint.h>

#include "msim/msim.h"

enum { MS_SCENE_MARKS = 8 }; /* hashed arrays of a scene */

/* Called for each entry. is_hash: the value is a hash, for comparison only. */
typedef void ms_mark(void *data, const char *name, const char *value, int is_hash);

/* Hash the arrays of the scene, unless that is done; changed springs need new hashes. */
void ms_sim_hash_scene(msim_sim *sim);

/* Pass all entries to `mark`. Call ms_sim_hash_scene() before: these hashes are listed, too. */
void ms_sim_marks(const msim_sim *sim, ms_mark *mark, void *data);

#endif
