/* checkpoints - saves sims, loads them into new ones, and compares how they continue */
#ifndef TEST_CHECKPOINTS_H
#define TEST_CHECKPOINTS_H

#include <stdlib.h>

#include "scenes.h"

typedef struct checkpoint {
  void *bytes;
  size_t length;
} checkpoint;

static inline checkpoint save(msim_sim *sim) {
  const size_t size = msim_sim_save_size(sim);
  checkpoint c = {malloc(size), 0};
  assert_ok(msim_sim_save(sim, c.bytes, size, &c.length, err));
  return c;
}

static inline msim_sim *resume(const msim_scene *scene, const msim_options *opt,
                               const checkpoint *c) {
  msim_sim *sim = make_sim(scene, opt);
  assert_ok(msim_sim_load(sim, c->bytes, c->length, err));
  return sim;
}

/* The states and all counts of the statistics agree; measured seconds are not compared. */
static inline void expect_same(msim_sim *a, msim_sim *b, const char *label) {
  const msim_state s = state_of(a), t = state_of(b);
  const size_t size = 3 * (size_t)s.n * sizeof *s.x;
  if (s.step != t.step || s.t != t.t || s.h != t.h)
    fail_msg("%s: step %lld, t = %.17g, h = %.17g and %lld, %.17g, %.17g", label, (long long)s.step,
             s.t, s.h, (long long)t.step, t.t, t.h);
  if (memcmp(s.x, t.x, size) || memcmp(s.v, t.v, size)) fail_msg("%s: the states differ", label);
  msim_stats p = stats_of(a), q = stats_of(b);
  double *seconds[] = {&p.total_s, &p.force_s,   &p.assemble_s, &p.factor_s,
                       &p.solve_s, &p.collide_s, &p.output_s};
  for (size_t i = 0; i < sizeof seconds / sizeof *seconds; i++) {
    const ptrdiff_t at = (char *)seconds[i] - (char *)&p;
    memcpy((char *)&q + at, seconds[i], sizeof(double));
  }
  const int64_t *there = &p.steps, *here = &q.steps;
  for (size_t i = 0; i < (sizeof p - offsetof(msim_stats, steps)) / sizeof *there; i++)
    if (there[i] != here[i])
      fail_msg("%s: number %zu of stats is %lld, and %lld resumed", label, i, (long long)there[i],
               (long long)here[i]);
}

/* The next checkpoints agree byte for byte. */
static inline void expect_same_save(msim_sim *a, msim_sim *b, const char *label) {
  const checkpoint c = save(a), d = save(b);
  if (c.length != d.length || memcmp(c.bytes, d.bytes, c.length) != 0)
    fail_msg("%s: the next checkpoints differ", label);
  free(c.bytes), free(d.bytes);
}

/* The sim makes the steps that are left, and is then as the whole run is. */
static inline void expect_same_end(msim_sim *whole, msim_sim *sim, int64_t left,
                                   const char *label) {
  assert_ok(msim_sim_step(sim, left, err));
  expect_same(whole, sim, label);
  expect_same_save(whole, sim, label);
}

/* A change of the running sim is part of later checkpoints, not of earlier ones: the sim goes on as
 * one resumed after the change, and that one, returned to before it, as one without the change. */
static inline void expect_change_is_saved(const msim_scene *scene, const msim_options *opt,
                                          void (*change)(msim_sim *, int), int which,
                                          const char *label) {
  msim_sim *sim = make_sim(scene, opt);
  assert_ok(msim_sim_step(sim, 5, err));
  const checkpoint before = save(sim);
  change(sim, which);
  assert_ok(msim_sim_step(sim, 5, err));
  const checkpoint after = save(sim);
  msim_sim *other = resume(scene, opt, &after), *unchanged = resume(scene, opt, &before);
  assert_ok(msim_sim_step(sim, 9, err));
  expect_same_end(sim, other, 9, label);
  assert_ok(msim_sim_load(other, before.bytes, before.length, err));
  assert_ok(msim_sim_step(unchanged, 9, err));
  expect_same_end(unchanged, other, 9, label);
  free(before.bytes), free(after.bytes);
  msim_sim_destroy(sim), msim_sim_destroy(other), msim_sim_destroy(unchanged);
}

/* Steps in one run, and again with a new sim loaded from a checkpoint after each of the n step
 * numbers at[], with that sim after it has returned to the checkpoint, and with a clone: states,
 * counts and next checkpoints agree. Returns the statistics of the whole run. */
static inline msim_stats expect_resumable(const msim_scene *scene, const msim_options *opt,
                                          int64_t steps, int n, const int64_t *at,
                                          const char *label) {
  msim_sim *whole = make_sim(scene, opt), *watched = make_sim(scene, opt);
  assert_ok(msim_sim_step(whole, steps, err));
  for (int i = 0; i < n; i++) {
    assert_ok(msim_sim_step(watched, at[i] - state_of(watched).step, err));
    const checkpoint c = save(watched);
    msim_sim *other = resume(scene, opt, &c), *copy;
    expect_same(watched, other, label);
    expect_same_end(whole, other, steps - at[i], label);
    assert_ok(msim_sim_load(other, c.bytes, c.length, err));
    expect_same(watched, other, label);
    expect_same_save(watched, other, label);
    expect_same_end(whole, other, steps - at[i], label);
    assert_ok(msim_sim_clone(watched, &copy, err));
    expect_same(watched, copy, label);
    expect_same_end(whole, copy, steps - at[i], label);
    msim_sim_destroy(other), msim_sim_destroy(copy);
    free(c.bytes);
  }
  assert_ok(msim_sim_step(watched, steps - at[n - 1], err));
  expect_same(whole, watched, label);
  const msim_stats stats = stats_of(whole);
  msim_sim_destroy(whole), msim_sim_destroy(watched);
  return stats;
}

#endif
