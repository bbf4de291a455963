/* rank_runs - run a scene on 1, 2, ... ranks and compare the states with that of one process */
#ifndef TEST_RANK_RUNS_H
#define TEST_RANK_RUNS_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "rank_scenes.h"
#include "ranks.h"

/* What all ranks do, and what one process has computed */
typedef struct run {
  const msim_scene *scene;
  msim_options opt;
  int32_t steps;
  msim_state expected; /* of one process; x, v, v_half: owned */
  msim_energy energy;
  int64_t broken; /* springs */
} run;

static inline double *copy_numbers(const double *from, int32_t n) {
  double *to = from ? malloc(3 * (size_t)n * sizeof *to) : NULL;
  if (to) memcpy(to, from, 3 * (size_t)n * sizeof *to);
  return to;
}

/* Run in one process */
static inline run run_alone(const msim_scene *scene, msim_options opt, int32_t steps) {
  run r = {.scene = scene, .opt = opt, .steps = steps, .energy.size = sizeof r.energy};
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, steps, err));
  r.expected = state_of(sim);
  r.expected.x = copy_numbers(r.expected.x, r.expected.n);
  r.expected.v = copy_numbers(r.expected.v, r.expected.n);
  r.expected.v_half = copy_numbers(r.expected.v_half, r.expected.n);
  assert_int_equal(msim_sim_energy(sim, &r.energy), MSIM_OK);
  r.broken = stats_of(sim).broken;
  msim_sim_destroy(sim);
  return r;
}

static inline void free_run(run *r) {
  free((void *)(uintptr_t)r->expected.x);
  free((void *)(uintptr_t)r->expected.v);
  free((void *)(uintptr_t)r->expected.v_half);
}

static inline int has_same_bits(const double *a, const double *b, int32_t n) {
  return (!a && !b) || (a && b && memcmp(a, b, 3 * (size_t)n * sizeof *a) == 0);
}

static inline const char *compare_with_run(msim_sim *sim, const run *r) {
  msim_state s = {.size = sizeof s};
  msim_energy e = {.size = sizeof e};
  msim_stats stats = {.size = sizeof stats};
  if (msim_sim_state(sim, &s)) return "no state";
  if (s.step != r->expected.step || s.t != r->expected.t || s.h != r->expected.h)
    return "another step";
  if (!has_same_bits(s.x, r->expected.x, s.n)) return "another x";
  if (!has_same_bits(s.v, r->expected.v, s.n)) return "another v";
  if (!has_same_bits(s.v_half, r->expected.v_half, s.n)) return "another v_half";
  if (msim_sim_energy(sim, &e)) return "no energy";
  if (msim_sim_stats(sim, &stats) || stats.broken != r->broken) return "other broken springs";
  if (e.total != r->energy.total) return "another energy";
  return fabs(e.work - r->energy.work) <= 1e-12 * (fabs(e.work) + fabs(e.total)) ? NULL
                                                                                 : "another work";
}

static inline const char *run_rank(msim_comm *comm, void *data) {
  const run *r = data;
  static _Thread_local msim_error why;
  msim_options opt = r->opt;
  msim_sim *sim = NULL;
  opt.comm = comm;
  if (msim_sim_create(r->scene, &opt, &sim, &why)) return why.text;
  const char *wrong = msim_sim_step(sim, r->steps, &why) ? why.text : compare_with_run(sim, r);
  msim_sim_destroy(sim);
  return wrong;
}

/* The sentence of a rank lasts no longer than its thread. */
static inline const char *run_rank_copied(msim_comm *comm, void *data) {
  const char *wrong = run_rank(comm, data);
  static char text[MOST_RANKS][1024];
  if (!wrong) return NULL;
  snprintf(text[comm->rank], sizeof text[0], "%s", wrong);
  return text[comm->rank];
}

static inline void check_run(const char *name, const msim_scene *scene, msim_options opt,
                             int32_t steps, int32_t most) {
  run r = run_alone(scene, opt, steps);
  for (int32_t n = 1; n <= most; n++) {
    const char *wrong = run_ranks(n, run_rank_copied, &r);
    if (wrong) fail_msg("%s, %s, %d ranks: %s", name, opt.integrator, n, wrong);
  }
  free_run(&r);
}

/* A rank returns its sentence by fail_rank, whose memory outlives the thread. */
static inline const char *fail_rank(const msim_comm *comm, const char *what, const char *why) {
  static char text[MOST_RANKS][1200];
  snprintf(text[comm->rank], sizeof text[0], "rank %d: %s: %s", comm->rank, what, why);
  return text[comm->rank];
}

/* All ranks have these bits. */
static inline int is_common(const msim_comm *comm, double number) {
  double most[2] = {number, -number};
  return comm->maximum(comm->self, 2, most) == MSIM_OK && most[0] == -most[1];
}

/* All ranks have the text of rank 0. */
static inline int has_same_text(const msim_comm *comm, const char *text) {
  char first[1024] = {0};
  snprintf(first, sizeof first, "%s", text);
  return comm->broadcast(comm->self, 0, sizeof first, first) == MSIM_OK && strcmp(first, text) == 0;
}

/* Error control up to t_end */
static inline msim_options controlled(const char *method, double tol, double t_end) {
  msim_options opt = options(method, MSIM_H_AUTO);
  opt.steps = -1, opt.tol = tol, opt.t_end = t_end;
  return opt;
}

#define EXPECT(condition) \
  if (!(condition)) return fail_rank(comm, #condition, why.text)

/* All explicit methods with fixed steps that one process and ranks both take */
static inline int is_tested(const char *method) {
  return !is_implicit(method) && strcmp(method, "respa") != 0;
}

static inline void check_methods(const char *name, const msim_scene *scene, double h, int32_t steps,
                                 int positions_only, int planes) {
  const char *method;
  for (int32_t i = 0; (method = method_at(i)) != NULL; i++) {
    if (!is_tested(method) || (!positions_only && takes_positions_only(method)) ||
        (planes && refuses_planes(method)))
      continue;
    check_run(name, scene, options(method, h), steps, 4);
  }
}

#endif
