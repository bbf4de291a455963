#include "batch.h"

#include <math.h>
#include <stdlib.h>

#include "../common/clock.h"
#include "background_load.h"
#include "cases.h"

typedef struct batch {
  msim_sim **sims;
  int n;
  int64_t steps;   /* of each sim in a run */
  int32_t threads; /* 0: all cores */
} batch;

static int run_batch(timing_candidate *c, timing_sample *sample) {
  const batch *b = c->data;
  msim_error err;
  const double start = clock_seconds();
  const msim_status status = msim_sim_step_many(b->sims, b->n, b->steps, b->threads, NULL, &err);
  sample->whole = clock_seconds() - start;
  return status ? candidate_fail(c, err.text) : 1;
}

static msim_options options_of(const moving_scene *m, int implicit) {
  msim_options options = implicit_options(MAIN_STEP, 1e-6, "pcg", 1);
  if (implicit) return options;
  options.integrator = "velocity-verlet";
  options.h = 0.1 * sqrt(m->view.mass[0] / m->k);
  return options;
}

static int fill(const moving_scene *m, const msim_options *options, batch *b) {
  for (int i = 0; i < b->n; i++)
    if (msim_sim_create(m->scene, options, &b->sims[i], NULL) ||
        msim_sim_set_state(b->sims[i], &m->state, NULL))
      return 0;
  return 1;
}

double batch_measure_efficiency(const moving_scene *m, int n, int implicit,
                                const timing_limits *p) {
  const msim_options options = options_of(m, implicit);
  batch alone = {.n = n, .steps = implicit ? 2 : 50, .threads = 1}, together;
  timing_candidate a, b, pair[2];
  double efficiency = NAN;
  alone.sims = calloc((size_t)n, sizeof *alone.sims);
  together = alone;
  together.threads = 0;
  candidate_init(&a, "one thread", "batch", run_batch, &alone);
  candidate_init(&b, "all cores", "batch", run_batch, &together);
  if (alone.sims && fill(m, &options, &alone))
    efficiency = time_pair(&a, whole_seconds, &b, whole_seconds, p, pair) / usable_cores();
  for (int i = 0; i < n && alone.sims; i++) msim_sim_destroy(alone.sims[i]);
  free(alone.sims);
  return efficiency;
}
