/* checkpoint - save a run to memory, and continue it from there with identical results
 *
 *   header       magic, byte order, version, lengths, a hash of everything
 *   fingerprint  of scene and options (fingerprint.h), as lines "name=value"
 *   run          step and time, with its rounding error; the step controller: next h, last error;
 *                length of the run, to which its tolerance refers; frames shown; stats; what
 *                integrator = auto has chosen; which axis is left out; the h that solvers were
 *                chosen for; the bounds of the energy monitor
 *   changes      gravity, drag, forces, pins and motions, if they were changed; an edited scene;
 *                broken springs (saved_scene.h)
 *   springs      that solvers were chosen for, if msim_sim_set_springs has set others since
 *   islands      at rest or not; the stepper (integrate/method_state.h), its error scales, the
 *                solver (linear/solver_state.c); the last good state, if it is another one
 *
 * Ranks have the same bytes as one process but for counts and bounds of their own: islands and rows
 * are those of one process (rank_rows.h), and there is no solver, whose factors depend on N.
 * Everything else is computed anew: models, the order of their unknowns, split springs, analyses
 * and aggregates follow from scene and options; so do bounds, and the plan except its end. */
#include "checkpoint/checkpoint.h"

#include <string.h>

#include "checkpoint/fingerprint.h"
#include "checkpoint/rank_rows.h"
#include "checkpoint/restore.h"
#include "checkpoint/saved_scene.h"

#define MAGIC   "msimsave"
#define ORDER   0x01020304u
#define VERSION 10u

typedef struct header {
  char magic[8];
  uint32_t order, version;
  uint64_t length, hash; /* hash: of all bytes, with 0 in its place */
  uint64_t fingerprint;  /* bytes of the fingerprint */
} header;

/* The hash of all bytes, where h replaces the header. */
static uint64_t hash_of(const header *h, const void *from) {
  header without = *h;
  without.hash = 0;
  return ms_archive_hash(ms_archive_hash(0, &without, sizeof without),
                         (const char *)from + sizeof without, (size_t)h->length - sizeof without);
}

/*------------------------------------- fingerprint ----------------------------------------------*/

/* Write one line per entry. MS_ARCHIVE_COUNT reserves room for the longest number, as values may
 * change. */
static void write_entry(void *data, const char *name, const char *value, int is_hash) {
  enum { LONGEST_NUMBER = 24 };
  ms_archive *b = data;
  const void *const parts[] = {name, "=", value, "\n"};
  (void)is_hash;
  if (ms_fingerprint_is_implied(name, value)) return;
  for (int i = 0; i < 4; i++) ms_archive_transfer(b, (void *)(uintptr_t)parts[i], strlen(parts[i]));
  if (b->direction == MS_ARCHIVE_COUNT && strlen(value) < LONGEST_NUMBER)
    b->position += LONGEST_NUMBER - strlen(value);
}

/*------------------------------------- save -----------------------------------------------------*/

/* For MS_ARCHIVE_COUNT and MS_ARCHIVE_WRITE; ms_restore_run() reads and checks part by part. */
static void write_sim(ms_archive *b, msim_sim *sim, ms_saved_run *r) {
  ms_saved_run_archive(b, sim, r);
  ms_saved_scene_write_changes(b, sim);
  if (r->other_springs) ms_saved_scene_write_springs(b, sim);
  ms_saved_run_archive_islands(b, sim, r, NULL);
}

/* Bytes that a method for impacts, chosen once planes count, may need beyond those of the present
 * one: for carried vectors, and for particles at rest on planes. */
static size_t reserve_for_impacts(const msim_sim *sim) {
  enum { VECTORS = 4, REST = 64 };
  return (size_t)sim->scene->nparticles * 3 * VECTORS * sizeof(double) +
         (size_t)sim->nislands * REST;
}

size_t msim_sim_save_size(const msim_sim *sim) {
  ms_rank_rows rows;
  ms_archive b = {.direction = MS_ARCHIVE_COUNT,
                  .position = sizeof(header),
                  .rows = ms_rank_rows_begin(&rows, sim->part)};
  ms_saved_run r = ms_saved_run_collect(sim);
  r.saves_last_step = ms_options_have_frame_times(&sim->config.opt);
  ms_fingerprint_list(sim, write_entry, &b);
  write_sim(&b, (msim_sim *)(uintptr_t)sim, &r);
  if (sim->config.choice.verification.planes_far) b.position += reserve_for_impacts(sim);
  return b.position;
}

/* Write all but the header. */
static void write_bytes(ms_archive *b, msim_sim *sim, header *h) {
  ms_saved_run_prepare_islands(sim);
  ms_saved_run r = ms_saved_run_collect(sim);
  ms_ranks_broadcast(sim->ranks, 0, sizeof r.stats, &r.stats); /* some are of each rank */
  MS_ARCHIVE_TRANSFER(b, *h);
  ms_fingerprint_hash_scene(sim);
  ms_fingerprint_list(sim, write_entry, b);
  h->fingerprint = b->position - sizeof *h;
  write_sim(b, sim, &r);
  h->length = b->position;
}

msim_status ms_checkpoint_save(msim_sim *sim, void *to, size_t capacity, size_t *length,
                               msim_error *err) {
  ms_rank_rows rows;
  ms_archive b = {.direction = MS_ARCHIVE_WRITE,
                  .data = to,
                  .size = to ? capacity : 0,
                  .rows = ms_rank_rows_begin(&rows, sim->part)};
  header h = {.magic = MAGIC, .order = ORDER, .version = VERSION};
  msim_status status = MSIM_OK;
  write_bytes(&b, sim, &h);
  if (to && b.position > capacity)
    status =
        ms_error_set(err, MSIM_ERR_ARG,
                     "the checkpoint needs %zu bytes, but capacity is %zu; use msim_sim_save_size",
                     b.position, capacity);
  status = ms_ranks_agree(sim->ranks, status, err);
  if (status) return status;
  *length = b.position;
  if (to) {
    h.hash = hash_of(&h, to);
    memcpy(to, &h, sizeof h);
  }
  return ms_error_clear(err);
}

msim_status msim_sim_save(msim_sim *sim, void *to, size_t capacity, size_t *length,
                          msim_error *err) {
  if (!sim || !to || !length) return ms_error_set(err, MSIM_ERR_ARG, "sim, to or length is NULL");
  return ms_checkpoint_save(sim, to, capacity, length, err);
}

/*------------------------------------- load -----------------------------------------------------*/

/* Check that the bytes are a complete, undamaged checkpoint of this version. */
static msim_status check_bytes(const void *from, size_t length, header *h, msim_error *err) {
  if (length < sizeof *h || memcmp(from, MAGIC, sizeof h->magic) != 0)
    return ms_error_set(err, MSIM_ERR_ARG, "the %zu bytes are not a checkpoint of msim", length);
  memcpy(h, from, sizeof *h);
  if (h->order != ORDER)
    return ms_error_set(
        err, MSIM_ERR_ARG,
        "the checkpoint was saved on a machine with another byte order; load it on such a machine");
  if (h->version != VERSION)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "the checkpoint has format version %u, but msim %s reads version %u; use "
                        "the msim that saved it",
                        h->version, msim_version(), VERSION);
  if (h->length != length)
    return ms_error_set(
        err, MSIM_ERR_ARG,
        "the checkpoint has %llu bytes, but %zu were given; give exactly those that were saved",
        (unsigned long long)h->length, length);
  if (h->fingerprint > length - sizeof *h || hash_of(h, from) != h->hash)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "the checkpoint is damaged: its hash does not match its content");
  return MSIM_OK;
}

/* Check that the bytes are a checkpoint of this scene and options, and the same on all ranks. */
static msim_status check_checkpoint(msim_sim *sim, const void *from, size_t length, header *h,
                                    msim_error *err) {
  msim_status status = check_bytes(from, length, h, err);
  ms_fingerprint_hash_scene(sim);
  if (!status)
    status =
        ms_fingerprint_compare(sim, (const char *)from + sizeof *h, (size_t)h->fingerprint, err);
  status = ms_ranks_agree(sim->ranks, status, err);
  if (status || !sim->ranks || ms_ranks_have_same(sim->ranks, h->hash)) return status;
  return ms_error_set(err, MSIM_ERR_ARG,
                      "the %d ranks load different checkpoints; give all of them the same bytes",
                      sim->ranks->n);
}

msim_status msim_sim_load(msim_sim *sim, const void *from, size_t length, msim_error *err) {
  if (!sim || !from) return ms_error_set(err, MSIM_ERR_ARG, "sim or from is NULL");
  header h;
  ms_rank_rows rows;
  msim_status status = check_checkpoint(sim, from, length, &h, err);
  if (status) return status;
  ms_archive b = {.direction = MS_ARCHIVE_READ,
                  .data = (unsigned char *)(uintptr_t)from,
                  .size = length,
                  .position = sizeof h + (size_t)h.fingerprint,
                  .rows = ms_rank_rows_begin(&rows, sim->part)};
  status = ms_restore_run(sim, &b, err);
  if (status) return status;
  ms_step_limit_warn(sim);
  return ms_error_clear(err);
}
