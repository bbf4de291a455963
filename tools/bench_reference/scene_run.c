#include "scene_run.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../common/clock.h"
#include "../common/interrupt.h"

enum { RUN_FRAMES = 64 }; /* frames in a run, at which `see` is called and limits are checked */

int run_result_create(int32_t n, run_result *e) {
  *e = (run_result){.x = malloc(3 * (size_t)n * sizeof *e->x),
                    .v = malloc(3 * (size_t)n * sizeof *e->v)};
  return e->x && e->v;
}

void run_result_free(run_result *e) {
  free(e->x);
  free(e->v);
  *e = (run_result){.x = NULL};
}

/* Called at each frame; a nonzero result ends the run. */
static int check_frame(msim_sim *sim, void *user) {
  const scene_run *t = user;
  if (t->on_frame) t->on_frame(sim, t->data);
  return is_interrupted() || clock_seconds() > t->until;
}

/* Frames are spaced in steps: frames at given times would need an interpolant under error
 * control. */
static msim_options options_of(const scene_run *t) {
  msim_options options;
  msim_options_init(&options, sizeof options);
  options.integrator = t->integrator;
  options.threads = t->threads;
  options.collision = t->collision;
  options.precision = t->precision;
  options.t_end = t->t_end;
  options.every = RUN_FRAMES;
  if (t->tol > 0) {
    options.tol = t->tol;
    return options;
  }
  options.steps = t->steps;
  options.h = t->t_end / (double)t->steps;
  options.every = t->steps / RUN_FRAMES > 0 ? t->steps / RUN_FRAMES : 1;
  return options;
}

static void copy_run_state(msim_sim *sim, run_result *e) {
  msim_state state = {.size = sizeof state};
  msim_stats stats = {.size = sizeof stats};
  msim_sim_state(sim, &state);
  msim_sim_stats(sim, &stats);
  memcpy(e->x, state.x, 3 * (size_t)state.n * sizeof *e->x);
  memcpy(e->v, state.v, 3 * (size_t)state.n * sizeof *e->v);
  e->evaluations = stats.force_evaluations;
}

int scene_run_execute(const scene_run *t, run_result *e) {
  const msim_options options = options_of(t);
  scene_run own = *t;
  msim_sim *sim = NULL;
  msim_error err;
  const double start = clock_seconds();
  msim_status status = msim_sim_create(t->scene, &options, &sim, &err);
  if (!status && t->start) status = msim_sim_set_state(sim, t->start, &err);
  if (!status) status = msim_sim_run(sim, check_frame, &own, &err);
  if (!status) copy_run_state(sim, e);
  e->seconds = clock_seconds() - start;
  e->refused = status < 0;
  if (status) snprintf(e->reason, sizeof e->reason, "%s", err.text);
  if (status == MSIM_STOPPED)
    snprintf(e->reason, sizeof e->reason, "aborted after %.3g s (time limit)", e->seconds);
  msim_sim_destroy(sim);
  return status == MSIM_OK;
}

double longest_step(const msim_scene *scene, const char *integrator, msim_error *err) {
  msim_options options;
  msim_plan plan = {.size = sizeof plan};
  msim_sim *sim = NULL;
  msim_options_init(&options, sizeof options);
  options.integrator = integrator;
  options.steps = 1;
  options.h = MSIM_H_AUTO;
  if (msim_sim_create(scene, &options, &sim, err) != MSIM_OK) return NAN;
  msim_sim_plan(sim, &plan);
  msim_sim_destroy(sim);
  return plan.h / 0.9;
}
