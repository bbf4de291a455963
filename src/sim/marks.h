/* marks - what a scene and options are told by, as far as they decide on the bits of a run: names
 * and values, as texts. Arrays have a hash for a value. */
#ifndef MS_MARKS_H
#define MS_MARKS_H

#include <stdint.h>

#include "msim/msim.h"

enum { MS_SCENE_MARKS = 8 }; /* arrays of a scene */

/* Told of each. is_hash: only whether values are the same says anything. */
typedef void ms_mark(void *data, const char *name, const char *value, int is_hash);

/* The hashes are made once, and again where springs have changed. */
void ms_sim_hash_scene(msim_sim *sim);

/* All marks; those of arrays are right after ms_sim_hash_scene(). */
void ms_sim_marks(const msim_sim *sim, ms_mark *mark, void *data);

#endif
