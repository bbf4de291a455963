/* fuzz - what every fuzz target includes; README.md tells how they are run */
#ifndef FUZZ_H
#define FUZZ_H

#include <stddef.h>
#include <stdint.h>

#include "msim/msim.h"

/* The target, by the name that libFuzzer and AFL++ know: one call for each input. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* An allocator with no more than so many bytes, so that a large scene is a short test. */
typedef struct fuzz_budget {
  size_t left;
} fuzz_budget;
msim_allocator fuzz_allocator(fuzz_budget *budget, size_t bytes);

/* A broken promise ends the process, as a crash would. */
void fuzz_check(int kept, const char *promise);

/* Every call leaves a sentence where it fails, and none where it does not. */
void fuzz_check_error(msim_status status, const msim_error *err);

/* The state is finite, whatever led to it. */
void fuzz_check_state(msim_sim *sim);

/* A scene that is good: a rope of three that falls, held at one end, by velocity Verlet; steps:
 * what its `run` says besides h. alloc: nullable */
msim_scene *fuzz_rope(const msim_allocator *alloc, const char *steps);

/* One of a good scene, as it asks for. */
msim_sim *fuzz_make_sim(const msim_scene *scene);

/* A few steps of what was read, and its explanation. */
void fuzz_run(const msim_scene *scene, const msim_options *options);

/* The same as the scene asks for, or by `integrator` where it names none. So many bytes are there
 * for the run, and as many for what comes after it. */
void fuzz_run_scene(const msim_scene *scene, const char *integrator, fuzz_budget *budget,
                    size_t bytes);

/* The one file of an input that needs one, in a folder of its own that goes with the process. */
const char *fuzz_path(const char *name);
void fuzz_write(const uint8_t *data, size_t size);
uint8_t *fuzz_read(size_t *size); /* all of it, to be freed */

#endif
