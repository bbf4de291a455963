/* Tests of sims of one scene in several threads: each computes the bits that it computes alone. The
 * argument is the linear solver. Under the thread sanitizer this also shows that only the scene is
 * shared. */
#include <pthread.h>
#include <string.h>

#include "scenes.h"

enum { SIDE = 12, N = SIDE * SIDE, THREADS = 4, STEPS = 30 };

static const char *solver = "pcg";

typedef struct job {
  const msim_scene *scene;
  msim_status status;
  double x[3 * N];
} job;

static void *work(void *data) {
  job *j = data;
  msim_sim *sim = NULL;
  msim_options opt = options("linearly-implicit-euler", 2e-3);
  opt.solver = solver;
  j->status = msim_sim_create(j->scene, &opt, &sim, NULL);
  if (!j->status) j->status = msim_sim_step(sim, STEPS, NULL);
  if (!j->status) memcpy(j->x, state_of(sim).x, sizeof j->x);
  msim_sim_destroy(sim);
  return NULL;
}

static void threads_do_not_meet(void **state) {
  (void)state;
  static job alone, jobs[THREADS];
  pthread_t threads[THREADS];
  msim_scene *scene = hanging_cloth(SIDE, 200, 0);
  alone.scene = scene;
  work(&alone);
  assert_int_equal(alone.status, MSIM_OK);
  for (int i = 0; i < THREADS; i++) {
    jobs[i].scene = scene;
    assert_int_equal(pthread_create(&threads[i], NULL, work, &jobs[i]), 0);
  }
  for (int i = 0; i < THREADS; i++) {
    assert_int_equal(pthread_join(threads[i], NULL), 0);
    assert_int_equal(jobs[i].status, MSIM_OK);
    assert_memory_equal(jobs[i].x, alone.x, sizeof alone.x);
  }
  msim_scene_destroy(scene);
}

static void *stop_it(void *sim) {
  msim_sim_stop(sim);
  return NULL;
}

static void stop_comes_from_another_thread(void **state) {
  (void)state;
  pthread_t thread;
  msim_scene *scene = hanging_cloth(SIDE, 200, 0);
  msim_options opt = options("verlet", 1e-4);
  msim_sim *sim = make_sim(scene, &opt);
  assert_int_equal(pthread_create(&thread, NULL, stop_it, sim), 0);
  assert_int_equal(msim_sim_step(sim, INT64_MAX, NULL), MSIM_STOPPED);
  pthread_join(thread, NULL);
  assert_true(state_of(sim).step > 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(int argc, char **argv) {
  if (argc > 1) solver = argv[1];
  if (!is_solver_available(solver)) return missing_status(solver);
  const struct CMUnitTest tests[] = {cmocka_unit_test(threads_do_not_meet),
                                     cmocka_unit_test(stop_comes_from_another_thread)};
  return cmocka_run_group_tests_name("threads", tests, NULL, NULL);
}
