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
#include "sim/rank_scene.h"

#define MAGIC   "msimsave"
#define ORDER   0x01020304u
#define VERSION 18u

typedef struct header {
  char magic[8];
  uint32_t order, version;
  uint64_t length, hash; /* hash: of all bytes, with 0 in its place */
  uint64_t fingerprint;  /* bytes of the fingerprint */
} header;

/* The hash of all bytes begins with that of the header, in which it is 0 itself. */
static uint64_t begin_hash(const header *h) {
  header without = *h;
  without.hash = 0;
  return ms_archive_hash_begin(ms_archive_hash(0, &without, sizeof without),
                               (size_t)h->length - sizeof without);
}

/* ... where h replaces the header */
static uint64_t hash_of(const header *h, const void *from) {
  return ms_archive_hash_last(begin_hash(h), (const char *)from + sizeof *h,
                              (size_t)h->length - sizeof *h);
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
                  .rows = ms_rank_rows_begin(&rows, sim->part, NULL)};
  ms_saved_run r = ms_saved_run_collect(sim);
  r.saves_last_step = ms_options_have_frame_times(&sim->config.opt);
  ms_fingerprint_list(sim, write_entry, &b);
  write_sim(&b, (msim_sim *)(uintptr_t)sim, &r);
  if (sim->config.choice.verification.planes_far) b.position += reserve_for_impacts(sim);
  return b.position;
}

/* Write all but the header; r: of this state */
static void write_bytes(ms_archive *b, msim_sim *sim, ms_saved_run *r, header *h) {
  b->position = sizeof *h;
  ms_fingerprint_list(sim, write_entry, b);
  h->fingerprint = b->position - sizeof *h;
  write_sim(b, sim, r);
  h->length = b->position;
}

/* What the archive writes next, as several ranks write it: whole words to each, the header to the
 * first one. bounds: nranks + 1 */
static void divide_bytes(msim_sim *sim, ms_saved_run *r, header *h) {
  ms_rank_rows rows;
  ms_archive count = {.direction = MS_ARCHIVE_WRITE,
                      .rows = ms_rank_rows_begin(&rows, sim->part, NULL)};
  size_t *bounds = sim->part->bounds;
  const size_t n = (size_t)sim->ranks->n, word = sizeof(uint64_t);
  write_bytes(&count, sim, r, h);
  const size_t words = (count.position - sizeof *h) / word;
  for (size_t k = 0; k <= n; k++)
    bounds[k] = sizeof *h + word * (words / n * k + words % n * k / n);
  bounds[0] = 0, bounds[n] = count.position;
}

size_t ms_checkpoint_part_capacity(const msim_sim *sim) {
  const size_t size = msim_sim_save_size(sim);
  if (!sim->ranks) return size;
  return size / (size_t)sim->ranks->n + sizeof(header) + 2 * sizeof(uint64_t);
}

/* The hash of all bytes passes from rank to rank. */
static uint64_t hash_parts(msim_sim *sim, const header *h, const ms_checkpoint_part *part) {
  const size_t skipped = part->first == 0 ? sizeof *h : 0;
  const unsigned char *bytes = part->bytes + skipped;
  const size_t size = part->size - skipped;
  const int32_t n = sim->ranks ? sim->ranks->n : 1, rank = sim->ranks ? sim->ranks->rank : 0;
  uint64_t hash = begin_hash(h);
  for (int32_t k = 0; k < n; k++) {
    if (k == rank)
      hash = k + 1 < n ? ms_archive_hash_words(hash, bytes, size)
                       : ms_archive_hash_last(hash, bytes, size);
    ms_ranks_broadcast(sim->ranks, k, sizeof hash, &hash);
  }
  return hash;
}

/* Find what this rank writes: all in one process. Returns the archive for it. */
static ms_archive begin_part(msim_sim *sim, ms_saved_run *r, ms_rank_rows *rows,
                             ms_checkpoint_part *part) {
  header h;
  if (!sim->ranks) return (ms_archive){.direction = MS_ARCHIVE_WRITE};
  divide_bytes(sim, r, &h);
  const size_t *bounds = sim->part->bounds + sim->ranks->rank;
  part->first = bounds[0], part->size = bounds[1] - bounds[0];
  return (ms_archive){.direction = MS_ARCHIVE_WRITE,
                      .first = part->first,
                      .rows = ms_rank_rows_begin(rows, sim->part, sim->part->bounds)};
}

/* to: memory for the part if parts is 1, else for all parts */
static msim_status write_part(msim_sim *sim, unsigned char *to, size_t capacity, int parts,
                              ms_checkpoint_part *part, msim_error *err) {
  ms_rank_rows rows;
  header h = {.magic = MAGIC, .order = ORDER, .version = VERSION};
  ms_saved_run_prepare_islands(sim);
  ms_saved_run r = ms_saved_run_collect(sim);
  ms_ranks_broadcast(sim->ranks, 0, sizeof r.stats, &r.stats); /* some are of each rank */
  ms_fingerprint_hash_scene(sim);
  *part = (ms_checkpoint_part){.bytes = to};
  ms_archive b = begin_part(sim, &r, &rows, part);
  const size_t before = parts ? 0 : part->first;
  b.data = part->bytes = to + before, b.size = capacity > before ? capacity - before : 0;
  write_bytes(&b, sim, &r, &h);
  if (!sim->ranks) part->size = b.position;
  part->length = b.position;
  const size_t needed = parts ? part->size : part->length;
  const msim_status status =
      needed <= capacity ? MSIM_OK
                         : ms_error_set(err, MSIM_ERR_ARG,
                                        "the checkpoint needs %zu bytes, but capacity is %zu; use "
                                        "msim_sim_save_size",
                                        needed, capacity);
  const msim_status agreed = ms_ranks_agree(sim->ranks, status, err);
  if (agreed) return agreed;
  h.hash = hash_parts(sim, &h, part);
  if (part->first == 0) memcpy(part->bytes, &h, sizeof h);
  return MSIM_OK;
}

msim_status ms_checkpoint_save_part(msim_sim *sim, void *to, size_t capacity,
                                    ms_checkpoint_part *part, msim_error *err) {
  const msim_status status = write_part(sim, to, capacity, 1, part, err);
  return status ? status : ms_error_clear(err);
}

msim_status msim_sim_save(msim_sim *sim, void *to, size_t capacity, size_t *length,
                          msim_error *err) {
  if (!sim || !to || !length) return ms_error_set(err, MSIM_ERR_ARG, "sim, to or length is NULL");
  ms_checkpoint_part part;
  msim_status status = write_part(sim, to, capacity, 0, &part, err);
  if (status) return status;
  for (int32_t k = 0; sim->ranks && k < sim->ranks->n; k++) {
    const size_t *bounds = sim->part->bounds + k;
    ms_ranks_broadcast(sim->ranks, k, (int64_t)(bounds[1] - bounds[0]),
                       (unsigned char *)to + bounds[0]);
  }
  status = ms_ranks_agree(sim->ranks, MSIM_OK, err);
  if (status) return status;
  *length = part.length;
  return ms_error_clear(err);
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
  if (sim->ranks->failed) return ms_ranks_agree(sim->ranks, MSIM_OK, err);
  return ms_error_set(err, MSIM_ERR_ARG,
                      "the %d ranks load different checkpoints; give all of them the same bytes",
                      sim->ranks->n);
}

static msim_status load_run(msim_sim *sim, const void *from, size_t length, msim_error *err) {
  header h;
  ms_rank_rows rows;
  msim_status status = check_checkpoint(sim, from, length, &h, err);
  if (status) return status;
  ms_archive b = {.direction = MS_ARCHIVE_READ,
                  .data = (unsigned char *)(uintptr_t)from,
                  .size = length,
                  .position = sizeof h + (size_t)h.fingerprint,
                  .rows = ms_rank_rows_begin(&rows, sim->part, NULL)};
  status = ms_restore_run(sim, &b, err);
  if (!status) ms_step_limit_warn(sim);
  return status;
}

msim_status msim_sim_load(msim_sim *sim, const void *from, size_t length, msim_error *err) {
  if (!sim || !from) return ms_error_set(err, MSIM_ERR_ARG, "sim or from is NULL");
  const int is_divided = sim->kept != NULL;
  msim_status status = ms_rank_scene_gather(sim, err);
  if (!status) status = load_run(sim, from, length, err);
  if (is_divided) ms_rank_scene_divide(sim, NULL);
  return status ? status : ms_error_clear(err);
}
