/* recording - what a recorder gets when it opens or resumes a file */
#ifndef MS_RECORDING_H
#define MS_RECORDING_H

#include "msim/recorder.h"
#include "sim/sim.h"

typedef struct ms_recording_source {
  const msim_sim *sim;
  const ms_scene *scene; /* the whole one; its arrays only for ms_recording_create */
  const msim_recorder_type *type;
  const char *path;
  size_t checkpoint_capacity;
} ms_recording_source;

typedef struct ms_recording {
  msim_recording what;
  double *times;
  ms_text scene;
} ms_recording;

/* All but times, the text of the scene, and arrays of particles, springs and faces; these are NULL.
 */
msim_status ms_recording_describe(const ms_recording_source *source, msim_recording *what,
                                  msim_error *err);

/* All; on failure nothing is left to be freed. */
msim_status ms_recording_create(const ms_recording_source *source, ms_recording *recording,
                                msim_error *err);
void ms_recording_free(const msim_allocator *alloc, ms_recording *recording);

#endif
