/* Tests of the thread pool: every item is done once, with as many threads as could be started, in
 * parent and child processes; idle threads use no CPU time. */
#define _GNU_SOURCE /* RTLD_NEXT */
#include <dlfcn.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "base/pool.h"
#include "testing.h"

enum { MOST_ITEMS = 1000 };

/* pthread_create fails after so many calls; -1: never */
static int calls_left = -1;

int pthread_create(pthread_t *thread, const pthread_attr_t *attr, void *(*start)(void *),
                   void *arg) {
  int (*real)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
  void *address = dlsym(RTLD_NEXT, "pthread_create");
  memcpy(&real, &address, sizeof real);
  if (calls_left == 0) return 11;
  if (calls_left > 0) calls_left--;
  return real(thread, attr, start, arg);
}

static const msim_allocator *libc(void) {
  static msim_allocator alloc;
  alloc = ms_memory_allocator(NULL);
  return &alloc;
}

static int done[MOST_ITEMS]; /* each written by one thread only, as the thread sanitizer checks */
static void do_item(void *data, int32_t item) { done[item] += *(int *)data; }

static int all_are(int32_t n, int value) {
  for (int32_t i = 0; i < MOST_ITEMS; i++)
    if (done[i] != (i < n ? value : 0)) return 0;
  return 1;
}

static int run_items(ms_pool *pool, int32_t n, int runs) {
  int one = 1;
  memset(done, 0, sizeof done);
  for (int i = 0; i < runs; i++) ms_pool_run(pool, do_item, &one, n);
  return all_are(n, runs);
}

static void do_chunk(void *data, int32_t begin, int32_t end) {
  const int32_t size = *(int32_t *)data;
  for (int32_t i = begin; i < end; i++) done[i] += begin % size == 0 && end - begin <= size;
}

static void pause_ms(int ms) { nanosleep(&(struct timespec){.tv_nsec = 1000000L * ms}, NULL); }

/*------------------------------------- tests ----------------------------------------------------*/

static void every_item_is_done_once(void **state) {
  (void)state;
  static const int32_t threads[] = {1, 2, 3, 7}, items[] = {0, 1, 2, 5, MOST_ITEMS};
  for (size_t t = 0; t < sizeof threads / sizeof *threads; t++) {
    ms_pool *pool = ms_pool_create(libc(), threads[t]);
    assert_int_equal(ms_pool_thread_count(pool), threads[t]);
    assert_true((pool == NULL) == (threads[t] == 1));
    for (size_t i = 0; i < sizeof items / sizeof *items; i++)
      assert_true(run_items(pool, items[i], 200));
    ms_pool_destroy(pool);
  }
}

static void chunks_cover_every_element_once(void **state) {
  (void)state;
  static const int32_t counts[] = {0, 1, 6, 7, 8, MOST_ITEMS};
  ms_pool *pool = ms_pool_create(libc(), 3);
  for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
    int32_t size = 7;
    memset(done, 0, sizeof done);
    assert_int_equal(ms_pool_run_chunks(pool, do_chunk, &size, counts[i], size),
                     (counts[i] + 6) / 7);
    assert_true(all_are(counts[i], 1));
  }
  ms_pool_destroy(pool);
}

/* Long pauses: threads that have gone to sleep wake up. */
static void sleeping_threads_wake_up(void **state) {
  (void)state;
  ms_pool *pool = ms_pool_create(libc(), 3);
  for (int i = 0; i < 20; i++) {
    pause_ms(2);
    assert_true(run_items(pool, MOST_ITEMS, 1));
  }
  ms_pool_destroy(pool);
}

/* Two items, each of which waits until the other has begun: this needs two threads. */
static void wait_for_other_item(void *data, int32_t item) {
  (void)item;
  pthread_barrier_wait(data);
}

static void items_run_side_by_side(void **state) {
  (void)state;
  pthread_barrier_t barrier;
  pthread_barrier_init(&barrier, NULL, 2);
  for (int i = 0; i < 50; i++) { /* each a new pool: after a delay the owner works alone */
    ms_pool *pool = ms_pool_create(libc(), 2);
    ms_pool_run(pool, wait_for_other_item, &barrier, 2);
    ms_pool_destroy(pool);
  }
  pthread_barrier_destroy(&barrier);
}

static double cpu_seconds(void) {
  struct timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void idle_threads_use_no_cpu_time(void **state) {
  (void)state;
  ms_pool *pool = ms_pool_create(libc(), 4);
  assert_true(run_items(pool, 10, 1));
  pause_ms(50);
  const double before = cpu_seconds();
  pause_ms(300);
  assert_true(cpu_seconds() - before < 0.05);
  ms_pool_destroy(pool);
}

static void fewer_threads_where_they_fail(void **state) {
  (void)state;
  for (int allowed = 0; allowed < 3; allowed++) {
    calls_left = allowed;
    ms_pool *pool = ms_pool_create(libc(), 4);
    calls_left = -1;
    assert_int_equal(ms_pool_thread_count(pool), 1 + allowed);
    assert_true(run_items(pool, 100, 10));
    ms_pool_destroy(pool);
  }
}

static void *no_memory(size_t bytes, void *left) {
  return --*(int *)left < 0 ? NULL : malloc(bytes);
}

static void give(void *memory, void *left) {
  (void)left;
  free(memory);
}

static void one_thread_without_memory(void **state) {
  (void)state;
  for (int blocks = 0; blocks < 3; blocks++) {
    int left = blocks;
    const msim_allocator scarce = {sizeof scarce, no_memory, give, &left};
    assert_null(ms_pool_create(&scarce, 4));
  }
}

/* The child process has one thread: it does all the work, and destroys the pool without waiting for
 * others. */
static void children_do_it_alone(void **state) {
  (void)state;
  ms_pool *pool = ms_pool_create(libc(), 3);
  assert_true(run_items(pool, 100, 10));
  const pid_t child = fork();
  if (child == 0) {
    const int good = ms_pool_thread_count(pool) == 1 && run_items(pool, 100, 10);
    ms_pool_destroy(pool);
    _exit(!good);
  }
  int status = -1;
  assert_int_equal(waitpid(child, &status, 0), child);
  assert_int_equal(status, 0);
  assert_int_equal(ms_pool_thread_count(pool), 3);
  assert_true(run_items(pool, 100, 10));
  ms_pool_destroy(pool);
}

/* The first item of the worker delays the owner; the items of the next run take long enough for the
 * worker to take some of them, if the pool allowed it. */
typedef struct delay_test {
  pthread_t owner;
  int late; /* ms that the worker needs for an item; the owner needs 1 */
  int by_worker[8];
} delay_test;

static void do_slowly(void *data, int32_t item) {
  delay_test *h = data;
  h->by_worker[item] = !pthread_equal(pthread_self(), h->owner);
  pause_ms(h->by_worker[item] ? h->late : 1);
}

static int count_by_worker(ms_pool *pool, delay_test *h) {
  int n = 0;
  ms_pool_run(pool, do_slowly, h, 8);
  for (int i = 0; i < 8; i++) n += h->by_worker[i];
  return n;
}

/* 1: the worker delays the owner, which then works alone, 20 times. */
static int works_alone(ms_pool *pool, delay_test *h) {
  h->late = 30;
  int n = count_by_worker(pool, h) == 0;
  h->late = 1;
  for (int i = 0; i < 20; i++) n += count_by_worker(pool, h);
  return n == 0;
}

/* On a busy machine the owner may be suspended until the worker is done, so that there is no delay,
 * or until it no longer works alone; and the worker, until the owner has done all items. */
static void a_delayed_owner_works_alone_for_a_while(void **state) {
  (void)state;
  ms_pool *pool = ms_pool_create(libc(), 2);
  delay_test h = {.owner = pthread_self()};
  int attempts = 20;
  while (!works_alone(pool, &h) && attempts--) pause_ms(999);
  assert_true(attempts >= 0);
  do pause_ms(999);
  while (count_by_worker(pool, &h) == 0 && attempts--);
  assert_true(attempts >= 0);
  ms_pool_destroy(pool);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(every_item_is_done_once),
                                     cmocka_unit_test(chunks_cover_every_element_once),
                                     cmocka_unit_test(sleeping_threads_wake_up),
                                     cmocka_unit_test(items_run_side_by_side),
                                     cmocka_unit_test(idle_threads_use_no_cpu_time),
                                     cmocka_unit_test(fewer_threads_where_they_fail),
                                     cmocka_unit_test(one_thread_without_memory),
                                     cmocka_unit_test(children_do_it_alone),
                                     cmocka_unit_test(a_delayed_owner_works_alone_for_a_while)};
  return cmocka_run_group_tests_name("pool", tests, NULL, NULL);
}
