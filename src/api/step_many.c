/* step_many - the public function that steps many sims at once, each in one thread of a pool
 * (msim.h) */
#include "base/pool.h"
#include "sim/sim.h"

typedef struct batch {
  msim_sim *const *sims;
  int64_t steps;
  msim_error *errors; /* one of each */
} batch;

static void step_one(void *data, int32_t i) {
  const batch *b = data;
  msim_sim_step(b->sims[i], b->steps, &b->errors[i]);
}

/* Flags the sims, so that none is stepped twice at once. */
static msim_status flag(msim_sim *const *sims, int32_t n, int32_t *flagged, msim_error *err) {
  for (*flagged = 0; *flagged < n; (*flagged)++) {
    msim_sim *sim = sims[*flagged];
    const char *reason = !sim               ? "is NULL"
                         : sim->ranks       ? "is shared by several ranks"
                         : sim->in_observer ? "is in its observer"
                         : sim->is_in_batch ? "is there twice"
                                            : NULL;
    if (reason) return ms_error_set(err, MSIM_ERR_ARG, "sims[%d] %s", (int)*flagged, reason);
    sim->is_in_batch = 1;
  }
  return MSIM_OK;
}

static void clear_flags(msim_sim *const *sims, int32_t n) {
  for (int32_t i = 0; i < n; i++) sims[i]->is_in_batch = 0;
}

/* The first status that is not MSIM_OK */
static msim_status step_all(batch *b, int32_t n, int32_t threads, msim_error *err) {
  ms_pool *pool = NULL;
  if (threads == 0) threads = ms_pool_usable_cores();
  if (threads > n) threads = n;
  if (threads > 1) pool = ms_pool_create(&b->sims[0]->alloc, threads);
  ms_pool_run(pool, step_one, b, n);
  ms_pool_destroy(pool);
  for (int32_t i = 0; i < n; i++)
    if (b->errors[i].status)
      return ms_error_set(err, b->errors[i].status, "sims[%d]: %s", (int)i, b->errors[i].text);
  return ms_error_clear(err);
}

/* Errors are kept in any case: err has the first one. */
static msim_status step_flagged(batch *b, int32_t n, int32_t threads, msim_error *err) {
  const msim_allocator *alloc = &b->sims[0]->alloc;
  msim_error *own = NULL;
  if (!b->errors) b->errors = own = ms_memory_allocate(alloc, (size_t)n, sizeof *own);
  if (!b->errors) return ms_error_set_memory(err, "the errors of the sims");
  const msim_status status = step_all(b, n, threads, err);
  ms_memory_free(alloc, own);
  return status;
}

msim_status msim_sim_step_many(msim_sim *const *sims, int32_t n, int64_t steps, int32_t threads,
                               msim_error *errors, msim_error *err) {
  batch b = {.sims = sims, .steps = steps, .errors = errors};
  int32_t flagged;
  if (n < 0 || (n > 0 && !sims) || steps < 0)
    return ms_error_set(err, MSIM_ERR_ARG, "sims is NULL, or n or steps is negative");
  if (threads < 0 || threads > MS_MAX_THREADS)
    return ms_error_set(err, MSIM_ERR_ARG, "threads must be 0 to %d, not %d", (int)MS_MAX_THREADS,
                        (int)threads);
  msim_status status = flag(sims, n, &flagged, err);
  if (!status && n > 0) status = step_flagged(&b, n, threads, err);
  clear_flags(sims, flagged);
  return status ? status : ms_error_clear(err);
}
