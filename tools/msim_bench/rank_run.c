#include "rank_run.h"

#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>

#include "../common/clock.h"

typedef msim_status rank_function(struct ranked_sim *s);

/* The sim of one rank */
typedef struct ranked_sim {
  const rank_run *run;
  counting_comm comm;
  msim_sim *sim;
  timing_sample sample;
  pthread_t thread;
  rank_function *function; /* that the thread calls */
  msim_status status;      /* of it */
  msim_error err;
} ranked_sim;

/*------------------------------------- ranks ----------------------------------------------------*/

static void *call_function(void *data) {
  ranked_sim *s = data;
  s->status = s->function(s);
  return NULL;
}

/* Each rank of this process calls the function, all at once. Other ranks would wait for one without
 * a thread. */
static msim_status call_on_ranks(rank_run *r, rank_function *function, msim_error *err) {
  int32_t started = 0;
  for (; started < r->here && r->here > 1; started++) {
    ranked_sim *s = &r->sims[started];
    s->function = function;
    if (pthread_create(&s->thread, NULL, call_function, s)) break;
  }
  if (started < r->here && r->here > 1 && !r->independent)
    msim_comm_threads_fail(r->comms[0], "a thread could not be started");
  for (int32_t i = 0; i < started; i++) pthread_join(r->sims[i].thread, NULL);
  for (int32_t i = started; i < r->here; i++) r->sims[i].status = function(&r->sims[i]);
  for (int32_t i = 0; i < r->here; i++)
    if (r->sims[i].status) {
      *err = r->sims[i].err;
      return r->sims[i].status;
    }
  return MSIM_OK;
}

static msim_status create_ranked_sim(ranked_sim *s) {
  msim_options options = s->run->options;
  if (s->run->n != ALONE && !s->run->independent) options.comm = &s->comm.table;
  return msim_sim_create(s->run->scene, &options, &s->sim, &s->err);
}

static int make_ranks(rank_run *r, msim_error *err) {
  const int are_threads = r->n != ALONE && !r->processes;
  r->here = are_threads ? r->n : r->processes && r->n == ALONE && r->processes->rank > 0 ? 0 : 1;
  r->comms = calloc((size_t)r->here + 1, sizeof *r->comms);
  r->sims = calloc((size_t)r->here + 1, sizeof *r->sims);
  snprintf(err->text, sizeof err->text, "out of memory for %d ranks", (int)r->n);
  if (!r->comms || !r->sims) return 0;
  if (are_threads && !r->independent && msim_comm_threads_create(r->n, NULL, r->comms, err))
    return 0;
  if (!are_threads && r->n != ALONE) r->comms[0] = r->processes;
  for (int32_t i = 0; i < r->here; i++) {
    r->sims[i].run = r;
    if (r->comms[i]) counting_comm_make(r->comms[i], &r->sims[i].comm);
  }
  return 1;
}

int rank_run_create(rank_run *r, msim_error *err) {
  return make_ranks(r, err) && call_on_ranks(r, create_ranked_sim, err) == MSIM_OK;
}

void rank_run_free(rank_run *r) {
  for (int32_t i = 0; r->sims && i < r->here; i++) msim_sim_destroy(r->sims[i].sim);
  if (r->comms && !r->processes) msim_comm_threads_destroy(r->comms[0]);
  free(r->comms);
  free(r->sims);
  r->here = 0, r->comms = NULL, r->sims = NULL;
}

/*------------------------------------- samples --------------------------------------------------*/

/* Setting the state and gathering it are not timed. */
static msim_status time_ranked_steps(ranked_sim *s) {
  const int steps = s->run->steps;
  msim_stats before = {.size = sizeof before}, after = {.size = sizeof after};
  msim_state state = {.size = sizeof state};
  msim_status status = msim_sim_set_state(s->sim, s->run->start, &s->err);
  msim_sim_stats(s->sim, &before);
  s->comm.counts = (comm_counts){0};
  const double start = clock_seconds();
  if (!status) status = msim_sim_step(s->sim, steps, &s->err);
  s->sample.whole = (clock_seconds() - start) / steps;
  msim_sim_stats(s->sim, &after);
  s->sample.solve = (after.solve_s - before.solve_s) / steps;
  s->sample.iterations = (after.iterations - before.iterations) / steps;
  return status ? status : msim_sim_state(s->sim, &state);
}

int rank_run_sample(timing_candidate *c, timing_sample *s) {
  rank_run *r = c->data;
  msim_error err = {0, ""};
  if (call_on_ranks(r, time_ranked_steps, &err)) return candidate_fail(c, err.text);
  if (r->here > 0) *s = r->sims[0].sample;
  return 1;
}

comm_counts rank_run_counts(const rank_run *r) {
  comm_counts most = {0};
  for (int32_t i = 0; i < r->here; i++) {
    const comm_counts *c = &r->sims[i].comm.counts;
    if (c->bytes > most.bytes) most.bytes = c->bytes;
    if (c->exchanges > most.exchanges) most.exchanges = c->exchanges;
    if (c->collectives > most.collectives) most.collectives = c->collectives;
    most.largest_over_mean = fmax(most.largest_over_mean, c->largest_over_mean);
  }
  return most;
}
