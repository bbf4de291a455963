/* Fuzz target: .vtkhdf files from which a run is to be resumed. Any bytes are refused with a
 * message, and file and sim stay as they were, or the run goes on from a checkpoint and writes its
 * frames. */
#include <stdlib.h>
#include <string.h>

#include "../../backends/hdf5/hash.h"
#include "../../backends/hdf5/layout.h"
#include "fuzz.h"
#include "input.h"
#include "checkpoint_layout.h"

enum { MOST_BYTES = 4 << 20, NX = 9 };

static const char steps[] = "\"steps\": 8, \"every\": 2";

/*------------------------------------- the run --------------------------------------------------*/

/* x: the positions three steps on. */
static void follow(msim_sim *sim, double *x) {
  msim_error err;
  msim_state state = {.size = sizeof state};
  fuzz_check(msim_sim_step(sim, 3, &err) == MSIM_OK, err.text);
  msim_sim_state(sim, &state);
  memcpy(x, state.x, NX * sizeof *x);
}

typedef struct writer {
  msim_recorder *recorder;
  int frames; /* to be written */
} writer;

static int write_frame(msim_sim *sim, void *user) {
  writer *w = user;
  msim_error err;
  fuzz_check_state(sim);
  const msim_status status = msim_recorder_write(w->recorder, &err);
  fuzz_check_error(status, &err);
  return status || --w->frames == 0;
}

/* All frames of the run, or the given number of them. */
static void record(msim_sim *sim, msim_recorder *recorder, int frames) {
  msim_error err;
  writer w = {recorder, frames};
  fuzz_check_error(msim_sim_run(sim, write_frame, &w, &err), &err);
  fuzz_check_error(msim_recorder_close(recorder, &err), &err);
}

/*------------------------------------- the file -------------------------------------------------*/

/* The file of an interrupted run, and the positions of its checkpoint slots. */
typedef struct sample_trajectory {
  uint8_t *file;
  size_t size, slot[NSLOTS], slot_size;
  double x[NX];
} sample_trajectory;

static uint64_t *word(uint8_t *slot, int i) { return (uint64_t *)(void *)(slot + 8 * i); }

/* A slot is found by the name at the start of a checkpoint; a header precedes it. */
static void find_slots(sample_trajectory *s) {
  int found = 0;
  for (size_t i = 8 * SLOT_BYTES; i + 8 <= s->size && found < NSLOTS; i += 8)
    if (memcmp(s->file + i, "msimsave", 8) == 0) s->slot[found++] = i - 8 * SLOT_BYTES;
  fuzz_check(found == NSLOTS, "the file has its checkpoint slots");
  s->slot_size = 8 * h5_slot_words(*word(s->file + s->slot[0], SLOT_LENGTH));
}

/* Created on first use, and never freed. */
static const sample_trajectory *find_sample(const char *path) {
  static sample_trajectory s;
  msim_error err;
  msim_recorder *recorder;
  if (s.file) return &s;
  msim_scene *scene = fuzz_rope(NULL, steps);
  msim_sim *sim = fuzz_make_sim(scene);
  fuzz_check(msim_recorder_open(sim, path, &recorder, &err) == MSIM_OK, err.text);
  record(sim, recorder, 3);
  s.file = fuzz_read(&s.size);
  find_slots(&s);
  msim_sim_destroy(sim);
  sim = fuzz_make_sim(scene);
  follow(sim, s.x);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return &s;
}

/* Recompute the hashes. */
static void mend(const sample_trajectory *s, uint8_t *file) {
  for (int i = 0; i < NSLOTS; i++) {
    uint8_t *slot = file + s->slot[i];
    const uint64_t length = *word(slot, SLOT_LENGTH);
    if (length > s->slot_size - 8 * SLOT_BYTES) continue;
    checkpoint_layout_rehash(slot + 8 * SLOT_BYTES, length);
    *word(slot, SLOT_HASH) = h5_slot_hash(word(slot, 0));
  }
}

/* The first byte selects what is forged. Bit 0: the input is the file. Otherwise bit 1: the slots,
 * with their hashes recomputed; else bit 2: the first kilobytes, which hold the groups; else
 * anything. */
static uint8_t *make_file(const sample_trajectory *s, size_t *size) {
  enum { GROUPS = 8192 };
  const unsigned how = input_next();
  const uint8_t *rest = input_rest(size);
  if (!(how & 1)) *size = s->size;
  uint8_t *file = malloc(*size + 1);
  fuzz_check(file != NULL, "memory");
  memcpy(file, how & 1 ? rest : s->file, *size);
  if (how & 1) return file;
  if (how & 2) {
    const size_t end = s->slot[0] + s->slot_size; /* metadata follow */
    input_corrupt(file + s->slot[0], s->slot[1] + s->slot_size - s->slot[0]);
    memcpy(file + end, s->file + end, s->slot[1] - end);
    mend(s, file);
  } else input_corrupt(file, how & 4 ? GROUPS : s->size);
  return file;
}

static void check_unchanged(const uint8_t *file, size_t size) {
  size_t now;
  uint8_t *there = fuzz_read(&now);
  fuzz_check(now == size && memcmp(there, file, size) == 0, "a refused file is unchanged");
  free(there);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  fuzz_budget budget;
  const msim_allocator alloc = fuzz_allocator(&budget, MOST_BYTES);
  const char *path = fuzz_path("run.vtkhdf");
  const sample_trajectory *s = find_sample(path);
  msim_error err;
  msim_recorder *recorder;
  double x[NX];
  input_begin(data, size);
  uint8_t *file = make_file(s, &size);
  fuzz_write(file, size);
  msim_scene *scene = fuzz_rope(&alloc, steps);
  msim_sim *sim = fuzz_make_sim(scene);
  const msim_status status = msim_recorder_resume(sim, path, &recorder, &err);
  fuzz_check_error(status, &err);
  fuzz_check(status != MSIM_ERR_PLUGIN && status != MSIM_ERR_NAME, err.text);
  if (status) {
    check_unchanged(file, size);
    follow(sim, x);
    fuzz_check(memcmp(x, s->x, sizeof x) == 0, "a refused checkpoint leaves the sim unchanged");
  } else record(sim, recorder, 8);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  free(file);
  return 0;
}
