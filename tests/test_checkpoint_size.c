/* Tests of the checkpoint sizes that docs/reliability.md states: bytes per particle, and per spring
 * that was set. */
#include <stdlib.h>

#include "scenes.h"

static size_t save(msim_sim *sim) {
  const size_t capacity = msim_sim_save_size(sim);
  void *bytes = malloc(capacity);
  size_t length = 0;
  assert_non_null(bytes);
  assert_ok(msim_sim_save(sim, bytes, capacity, &length, err));
  free(bytes);
  return length;
}

static int save_frame(msim_sim *sim, void *user) {
  size_t *frames = user;
  frames[0]++;
  frames[frames[0]] = save(sim);
  return frames[0] == 3; /* stop */
}

/* After three steps; under error control at the third frame, which lies inside a step. */
static size_t size_of(int32_t side, const msim_options *opt) {
  msim_scene *scene = hanging_cloth(side, 300, 0);
  msim_sim *sim = make_sim(scene, opt);
  size_t frames[4] = {0};
  if (opt->tol > 0) assert_int_equal(msim_sim_run(sim, save_frame, frames, NULL), MSIM_STOPPED);
  else assert_ok(msim_sim_step(sim, 3, err));
  const size_t size = opt->tol > 0 ? frames[3] : save(sim);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return size;
}

/* Difference of two sizes of cloth, in which everything that is independent of particles cancels */
static double bytes_a_particle(const msim_options *opt) {
  enum { SMALL = 9, LARGE = 17 };
  const size_t more = size_of(LARGE, opt) - size_of(SMALL, opt);
  return (double)more / (LARGE * LARGE - SMALL * SMALL);
}

/* 48 bytes for x and v, 24 for each vector that the method carries on, and 48 for the older state
 * that the energy monitor may restore. The tolerance of a byte in ten particles is for numbers that
 * grow with the scene. */
static void bytes_of_particles(void **state) {
  (void)state;
  static const struct {
    const char *method;
    int carried, older;
  } promised[] = {{"symplectic-euler", 0, 1}, {"velocity-verlet", 1, 1}, {"bdf2", 3, 0}};
  for (int i = 0; i < 3; i++) {
    msim_options opt = options(promised[i].method, 1e-4);
    opt.watch = MSIM_WATCH_OFF;
    assert_close(bytes_a_particle(&opt), 48 + 24 * promised[i].carried, 0.1);
    opt.watch = MSIM_WATCH_ON;
    assert_close(bytes_a_particle(&opt), 48 + 24 * promised[i].carried + 48 * promised[i].older,
                 0.1);
  }
}

static void bytes_inside_a_step(void **state) {
  (void)state;
  msim_options opt = options("dop853", 1e-3);
  opt.tol = 1e-3, opt.steps = -1, opt.t_end = 1, opt.fps = 1000, opt.watch = MSIM_WATCH_OFF;
  assert_close(bytes_a_particle(&opt), 504, 0.1);
}

static void bytes_of_springs(void **state) {
  (void)state;
  msim_scene_view view = {.size = sizeof view};
  const msim_options opt = options("linearly-implicit-euler", 1e-3);
  msim_scene *scene = hanging_cloth(9, 300, 0);
  msim_sim *sim = make_sim(scene, &opt);
  const size_t before = save(sim);
  msim_scene_get(scene, &view);
  assert_ok(msim_sim_set_springs(sim, view.k, view.rest, view.damping, err));
  assert_int_equal(save(sim) - before, 24 * view.nsprings);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(bytes_of_particles),
                                     cmocka_unit_test(bytes_inside_a_step),
                                     cmocka_unit_test(bytes_of_springs)};
  return cmocka_run_group_tests_name("checkpoint_size", tests, NULL, NULL);
}
