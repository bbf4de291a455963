/* sample_recording - what the tests of recorders share: a synthetic trajectory and a temporary
 * folder */
#ifndef SAMPLE_RECORDING_H
#define SAMPLE_RECORDING_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "counting_host.h"
#include "msim/recorder.h"

/*------------------------------------- trajectory -----------------------------------------------*/

/* n particles and springs i/2 -- i/2 + 1 + i%2: a chain, and a spring between next-nearest
 * neighbours. A face between each particle of even number and the next two. */
enum { SAMPLE_CHECKPOINT = 1003 };

typedef struct sample_trajectory {
  msim_recording what;
  char checkpoint[SAMPLE_CHECKPOINT];
  int32_t *ij, *faces;
  uint8_t *pinned;
  double *mass, *k, *rest, *damping, *times, *x, *v;
  float *strain, *tension, *reaction;
} sample_trajectory;

static inline double *doubles(int64_t count) { return calloc((size_t)count + 1, sizeof(double)); }

static inline void sample_init(sample_trajectory *s, const char *path, int32_t n, int32_t nsprings,
                               int64_t nframes) {
  static const char scene[] = "{\"msim\": 1, \"name\": \"made up\"}";
  static const msim_plane planes[] = {{{0, 0, 1}, -0.5, 0.25, 0.125}, {{1, 0, 0}, 3, 1, 0}};
  const int32_t nfaces = n > 2 ? (n - 1) / 2 : 0;
  const size_t ncells = (size_t)(nsprings + nfaces);
  *s = (sample_trajectory){.ij = calloc(2 * (size_t)nsprings + 1, sizeof(int32_t)),
                           .faces = calloc(3 * (size_t)nfaces + 1, sizeof(int32_t)),
                           .pinned = calloc((size_t)n + 1, 1),
                           .damping = doubles(nsprings),
                           .strain = calloc(ncells + 1, sizeof(float)),
                           .tension = calloc(ncells + 1, sizeof(float)),
                           .reaction = calloc(3 * (size_t)n + 1, sizeof(float)),
                           .mass = doubles(n),
                           .k = doubles(nsprings),
                           .rest = doubles(nsprings),
                           .times = doubles(nframes),
                           .x = doubles(3 * (int64_t)n),
                           .v = doubles(3 * (int64_t)n)};
  for (int32_t i = 0; i < n; i++) s->mass[i] = 1 + sin(i);
  for (int32_t i = 0; i < n; i++) s->pinned[i] = i % 5 == 0;
  for (int32_t i = 0; i < 3 * nfaces; i++) s->faces[i] = i / 3 * 2 + i % 3;
  for (int32_t i = 0; i < nsprings; i++) {
    s->ij[2 * i] = i / 2;
    s->ij[2 * i + 1] = i / 2 + 1 + i % 2;
    s->k[i] = 100 / (1.0 + i);
    s->rest[i] = sqrt(i);
    s->damping[i] = 0.5 * i;
  }
  for (int64_t i = 0; i < nframes; i++) s->times[i] = (double)i * 0.1;
  s->what = (msim_recording){.size = sizeof s->what,
                             .path = path,
                             .n = n,
                             .nsprings = nsprings,
                             .ij = s->ij,
                             .mass = s->mass,
                             .k = s->k,
                             .rest = s->rest,
                             .nframes = nframes,
                             .times = s->times,
                             .scene = scene,
                             .scene_length = sizeof scene - 1,
                             .checkpoint_capacity = SAMPLE_CHECKPOINT,
                             .pinned = s->pinned,
                             .damping = s->damping,
                             .nfaces = nfaces,
                             .faces = s->faces,
                             .nplanes = 2,
                             .planes = planes};
}

static inline void sample_free(sample_trajectory *s) {
  void *arrays[] = {s->ij,    s->faces, s->pinned, s->mass,   s->k,       s->rest,    s->damping,
                    s->times, s->x,     s->v,      s->strain, s->tension, s->reaction};
  for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
}

/* Frame i: values with many digits and magnitudes, and some that are easily lost (-0.0, denormal
 * numbers). */
static inline msim_frame sample_frame(sample_trajectory *s, int64_t i) {
  for (int32_t p = 0; p < s->what.n; p++)
    for (int c = 0; c < 3; c++) {
      double angle = 0.7 * (3.0 * p + c) + 0.1 * (double)i;
      s->x[3 * p + c] = sin(angle) * pow(10, p % 7 - 3);
      s->v[3 * p + c] = cos(angle) / 3;
    }
  if (s->what.n > 1) {
    const double odd[] = {-0.0, 5e-324, -1.7976931348623157e308, 1.0 / 3, 1e16 + 2, -1e-310};
    memcpy(s->x, odd, sizeof odd);
  }
  for (int32_t c = 0; c < s->what.nsprings + s->what.nfaces; c++) {
    s->strain[c] = (float)(0.25 * c + (double)i);
    s->tension[c] = (float)sin(c + (double)i);
  }
  for (int32_t c = 0; c < 3 * s->what.n; c++)
    s->reaction[c] = s->pinned[c / 3] ? (float)(0.5 * c - (double)i) : 0;
  for (int b = 0; b < SAMPLE_CHECKPOINT; b++) s->checkpoint[b] = (char)(7 * i + b * (i + 1));
  return (msim_frame){.size = sizeof(msim_frame),
                      .step = 10 * i,
                      .t = (double)i * 0.1,
                      .x = s->x,
                      .v = s->v,
                      .kinetic = 1 + sin((double)i),
                      .potential = -cos((double)i),
                      .checkpoint = s->checkpoint,
                      .checkpoint_length = SAMPLE_CHECKPOINT - (size_t)i % 9,
                      .elastic = 0.5 * (double)i,
                      .gravitational = -cos((double)i) - 0.5 * (double)i,
                      .strain = s->strain,
                      .tension = s->tension,
                      .reaction = s->reaction};
}

static inline msim_status record_rest(const msim_recorder_type *type, void *self,
                                      sample_trajectory *s, int64_t first, int64_t written) {
  msim_status status = MSIM_OK;
  for (int64_t i = first; i < written && status == MSIM_OK; i++) {
    msim_frame frame = sample_frame(s, i);
    status = type->write(self, &frame);
  }
  msim_status closed = type->close(self);
  return status != MSIM_OK ? status : closed;
}

/* Open, write the first `written` frames, close; returns the first status that is not MSIM_OK. */
static inline msim_status record(const msim_recorder_type *type, const msim_host *host,
                                 sample_trajectory *s, int64_t written) {
  void *self = NULL;
  msim_status status = type->open(host, &s->what, &self);
  return status != MSIM_OK ? status : record_rest(type, self, s, 0, written);
}

/* Resume the file and write until it has `written` frames; *kept: the frames it had. */
static inline msim_status record_resumed(const msim_recorder_type *type, const msim_host *host,
                                         sample_trajectory *s, int64_t written, int64_t *kept) {
  void *self = NULL;
  msim_resumption from = {.size = sizeof from};
  msim_status status = type->resume(host, &s->what, &from, &self);
  *kept = from.frames;
  return status != MSIM_OK ? status : record_rest(type, self, s, from.frames, written);
}

/*------------------------------------- files ----------------------------------------------------*/

/* Work in a new temporary folder, so that tests can run in parallel. */
static inline int enter_folder(void **state) {
  static char folder[] = "/tmp/msim_test_XXXXXX";
  *state = folder;
  return mkdtemp(folder) && chdir(folder) == 0 ? 0 : -1;
}

static inline int leave_folder(void **state) {
  return chdir("/") == 0 && rmdir(*state) == 0 ? 0 : -1;
}

/* The content of a file, with a terminating 0; the caller frees it. */
static inline char *read_file(const char *path, size_t *length) {
  FILE *file = fopen(path, "rb");
  if (!file) return NULL;
  char *text = NULL;
  size_t used = 0, room = 0, count = 1;
  while (count > 0) {
    if (used + 1 >= room) text = realloc(text, room = 2 * room + 4096);
    count = fread(text + used, 1, room - used - 1, file);
    used += count;
  }
  fclose(file);
  text[used] = '\0';
  if (length) *length = used;
  return text;
}

#endif
