/* fuzz - helpers that every fuzz target includes; README.md says how to run them */
#ifndef FUZZ_H
#define FUZZ_H

#include <stddef.h>
#include <stdint.h>

#include "msim/msim.h"

/* The entry point of libFuzzer and AFL++: one call for each input. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* An allocator limited to a number of bytes, so that tests of large scenes are short. */
typedef struct fuzz_budget {
  size_t left;
} fuzz_budget;
msim_allocator fuzz_allocator(fuzz_budget *budget, size_t bytes);

/* End the process, as a crash would, unless `kept`. */
void fuzz_check(int kept, const char *property);

/* Every failed call leaves a message, every other one none. */
void fuzz_check_error(msim_status status, const msim_error *err);

/* The state is finite. */
void fuzz_check_state(msim_sim *sim);

/* A valid scene: a falling rope of three particles, pinned at one end, with velocity Verlet; steps:
 * the keys of its `run` besides h. alloc: nullable */
msim_scene *fuzz_rope(const msim_allocator *alloc, const char *steps);

/* A sim of a valid scene, with the options of its `run`. */
msim_sim *fuzz_make_sim(const msim_scene *scene);

/* A few steps of a scene that was read, and its explanation. */
void fuzz_run(const msim_scene *scene, const msim_options *options);

/* The same with the options of the scene, by `integrator` if it names none. `bytes` are available
 * for the run, and as many again afterwards. */
void fuzz_run_scene(const msim_scene *scene, const char *integrator, fuzz_budget *budget,
                    size_t bytes);

/* The only file of an input that needs one, in a folder that is removed when the process ends. */
const char *fuzz_path(const char *name);
void fuzz_write(const uint8_t *data, size_t size);
uint8_t *fuzz_read(size_t *size); /* all of it; the caller frees it */

#endif
