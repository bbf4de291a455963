/* Side effects: nothing is printed, and instances do not affect each other, in one thread or in
 * several. */
#define _GNU_SOURCE /* dup, dup2, fileno */
#include <pthread.h>
#include <unistd.h>

#include "conformance.h"

/*------------------------------------- several instances ----------------------------------------*/

static void calls_to_several_may_alternate(void **state) {
  (void)state;
  enum { MANY = 3, ROWS = 30 };
  problem *p[MANY];
  rig r[MANY];
  double *b = random_vector(3 * ROWS, 3);
  for (int i = 0; i < MANY; i++) p[i] = spring_net(ROWS, i + 1, 7);
  for (int i = 0; i < MANY; i++) assert_int_equal(rig_open(&r[i], backend, p[i]), MSIM_OK);
  for (int i = 0; i < MANY; i++) assert_int_equal(rig_factor(&r[i], MSIM_FACTOR_SPD), MSIM_OK);
  for (int i = 0; i < MANY; i++) {
    double y[3 * ROWS] = {0};
    outcome alone = solve_with(backend, p[i], MSIM_FACTOR_SPD, b);
    assert_int_equal(rig_solve(&r[i], RTOL, LIMIT, 1, b, y), MSIM_OK);
    assert_same("side by side", y, alone.y, unknowns(p[i]));
    free(alone.y);
  }
  for (int i = 0; i < MANY; i++) rig_close(&r[i]), problem_free(p[i]);
  free(b);
}

/*------------------------------------- threads --------------------------------------------------*/

enum { THREADS = 3, N = 120, TURNS = 10 };

typedef struct job {
  const problem *p;
  const double *b;
  msim_status status;
  double y[3 * N];
} job;

static void *work(void *data) {
  job *j = data;
  for (int turn = 0; turn < TURNS; turn++) {
    outcome o = solve_with(backend, j->p, MSIM_FACTOR_SPD, j->b);
    const size_t bytes = (size_t)unknowns(j->p) * sizeof *o.y;
    if (o.status) j->status = o.status;
    else if (turn > 0 && memcmp(j->y, o.y, bytes) != 0) j->status = MSIM_STOPPED;
    memcpy(j->y, o.y, bytes);
    free(o.y);
  }
  return NULL;
}

static void threads_do_not_meet(void **state) {
  (void)state;
  static job jobs[THREADS];
  pthread_t threads[THREADS];
  problem *p[THREADS];
  double *b = random_vector(3 * N, 3);
  for (int i = 0; i < THREADS; i++) {
    p[i] = spring_net(N, i + 1, 7);
    jobs[i] = (job){.p = p[i], .b = b};
  }
  for (int i = 0; i < THREADS; i++)
    assert_int_equal(pthread_create(&threads[i], NULL, work, &jobs[i]), 0);
  for (int i = 0; i < THREADS; i++) pthread_join(threads[i], NULL);
  for (int i = 0; i < THREADS; i++) {
    outcome alone = solve_with(backend, p[i], MSIM_FACTOR_SPD, b);
    assert_int_equal(jobs[i].status, MSIM_OK);
    assert_same("in a thread", jobs[i].y, alone.y, unknowns(p[i]));
    free(alone.y), problem_free(p[i]);
  }
  free(b);
}

/*------------------------------------- no output ------------------------------------------------*/

static void solve_and_drop(const char *label, const problem *p) {
  double *b = random_vector(unknowns(p), 3);
  outcome o = solve_with(backend, p, MSIM_FACTOR_SPD, b);
  (void)label;
  free(o.y), free(b);
}

/* Good and bad systems, with standard output and standard error redirected to a file. */
static void nothing_is_printed(void **state) {
  (void)state;
  const kind kinds[] = {{"springs", spring_net, 1},       {"one negative", one_negative, 1},
                        {"free chain", free_chain, 1},    {"row of zeros", zero_row, 1},
                        {"scaled rows", badly_scaled, 1}, {0}};
  FILE *file = tmpfile();
  assert_non_null(file);
  fflush(NULL);
  const int out = dup(1), err = dup(2);
  dup2(fileno(file), 1), dup2(fileno(file), 2);
  for_each(kinds, (const int32_t[]){1, 20, 0}, solve_and_drop);
  fflush(NULL);
  dup2(out, 1), dup2(err, 2);
  close(out), close(err);
  const long printed = (fseek(file, 0, SEEK_END), ftell(file));
  fclose(file);
  if (printed != 0) fail_msg("%ld bytes were printed", printed);
}

int run_side_effects(void) {
  const struct CMUnitTest tests[] = {conformance_test(calls_to_several_may_alternate),
                                     conformance_test(threads_do_not_meet),
                                     conformance_test(nothing_is_printed)};
  return cmocka_run_group_tests_name("manners", tests, NULL, NULL);
}
