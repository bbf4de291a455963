#define _GNU_SOURCE /* sched_getaffinity, CPU_COUNT */
#include "base/pool.h"

#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdatomic.h>

#include "base/clock.h"
#include "base/pause.h"

/* If the owner waits longer than LATE_SECONDS (s), the system has suspended a worker in the middle
 * of an item, because its core is in use by other processes. The owner then works alone for
 * ALONE_FACTOR times as long, so that waiting costs a few percent of the time at most. */
#define LATE_SECONDS 200e-6
#define ALONE_FACTOR 30

/* One thread's share of the items. Each thread begins with its own share, then helps with the
 * others. Each has a cache line of its own, to avoid false sharing. */
typedef struct work_share {
  _Alignas(MS_ALIGNMENT) atomic_int next;
  int32_t end;
} work_share;

/* A worker accesses a job only while it is counted in `inside`, and only if the job is still open
 * after that increment. A job is finished when it is closed and `inside` is 0. */
struct ms_pool {
  _Alignas(MS_ALIGNMENT) atomic_uint job; /* odd while a job is open; +1 at its start and end */
  _Alignas(MS_ALIGNMENT) atomic_int active_workers;
  atomic_int sleepers, owner_sleeps, quit;
  pthread_mutex_t lock; /* for the sleeping threads */
  pthread_cond_t begin, all_left;
  ms_pool_item *work;
  void *data;
  int32_t threads;
  double alone_until; /* time of ms_clock_now() */
  int forks;          /* number of forks when the pool was created */
  msim_allocator alloc;
  struct worker {
    ms_pool *pool;
    int32_t index;
    pthread_t thread;
  } * workers;        /* threads; entry 0, the owner's, is unused */
  work_share *shares; /* threads */
};

/*------------------------------------- processes ------------------------------------------------*/

/* Number of forks between the process that first used pools and this one. */
static atomic_int forks;
static void count_fork(void) { atomic_fetch_add(&forks, 1); }
static void register_fork_handler(void) { pthread_atfork(NULL, NULL, count_fork); }
static int has_threads(const ms_pool *pool) { return pool->forks == atomic_load(&forks); }

int32_t ms_pool_usable_cores(void) {
  cpu_set_t set;
  return sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
}

/*------------------------------------- waiting --------------------------------------------------*/

/* Wait until a job other than `seen` is open, or the pool is destroyed. */
static unsigned wait_for_job(ms_pool *pool, unsigned seen) {
  for (int i = 0; i < MS_POLLS_BEFORE_SLEEP; i++) {
    const unsigned job = atomic_load(&pool->job);
    if ((job != seen && job % 2) || atomic_load(&pool->quit)) return job;
    ms_pause();
  }
  pthread_mutex_lock(&pool->lock);
  atomic_fetch_add(&pool->sleepers, 1);
  unsigned job;
  while ((job = atomic_load(&pool->job), job == seen || job % 2 == 0) && !atomic_load(&pool->quit))
    pthread_cond_wait(&pool->begin, &pool->lock);
  atomic_fetch_sub(&pool->sleepers, 1);
  pthread_mutex_unlock(&pool->lock);
  return job;
}

static void wake_workers(ms_pool *pool) {
  if (!atomic_load(&pool->sleepers)) return;
  pthread_mutex_lock(&pool->lock);
  pthread_cond_broadcast(&pool->begin);
  pthread_mutex_unlock(&pool->lock);
}

/* Wait until the last worker has left the closed job. */
static void wait_for_workers(ms_pool *pool) {
  for (int i = 0; i < MS_POLLS_BEFORE_SLEEP; i++) {
    if (!atomic_load(&pool->active_workers)) return;
    ms_pause();
  }
  const double start = ms_clock_now();
  pthread_mutex_lock(&pool->lock);
  atomic_store(&pool->owner_sleeps, 1);
  while (atomic_load(&pool->active_workers)) pthread_cond_wait(&pool->all_left, &pool->lock);
  atomic_store(&pool->owner_sleeps, 0);
  pthread_mutex_unlock(&pool->lock);
  const double end = ms_clock_now();
  if (end - start > LATE_SECONDS) pool->alone_until = end + ALONE_FACTOR * (end - start);
}

static int owner_works_alone(ms_pool *pool) {
  if (pool->alone_until > 0 && ms_clock_now() > pool->alone_until) pool->alone_until = 0;
  return pool->alone_until > 0;
}

static void leave_job(ms_pool *pool) {
  if (atomic_fetch_sub(&pool->active_workers, 1) > 1 || !atomic_load(&pool->owner_sleeps)) return;
  pthread_mutex_lock(&pool->lock);
  pthread_cond_signal(&pool->all_left);
  pthread_mutex_unlock(&pool->lock);
}

/*------------------------------------- working --------------------------------------------------*/

static void run_share(ms_pool *pool, work_share *p) {
  while (atomic_load_explicit(&p->next, memory_order_relaxed) < p->end) {
    const int32_t item = atomic_fetch_add_explicit(&p->next, 1, memory_order_relaxed);
    if (item < p->end) pool->work(pool->data, item);
  }
}

static void run_all_shares(ms_pool *pool, int32_t own) {
  for (int32_t i = 0; i < pool->threads; i++)
    run_share(pool, &pool->shares[(own + i) % pool->threads]);
}

static void *worker_main(void *data) {
  struct worker *worker = data;
  ms_pool *pool = worker->pool;
  unsigned seen = 0;
  while (1) {
    seen = wait_for_job(pool, seen);
    if (atomic_load(&pool->quit)) return NULL;
    atomic_fetch_add(&pool->active_workers, 1);
    if (atomic_load(&pool->job) == seen) run_all_shares(pool, worker->index);
    leave_job(pool);
  }
}

static void divide_items(ms_pool *pool, int32_t n) {
  for (int32_t i = 0; i < pool->threads; i++) {
    const int64_t count = n;
    atomic_store_explicit(&pool->shares[i].next, (int)(count * i / pool->threads),
                          memory_order_relaxed);
    pool->shares[i].end = (int32_t)(count * (i + 1) / pool->threads);
  }
}

void ms_pool_run(ms_pool *pool, ms_pool_item *work, void *data, int32_t n) {
  if (!pool || n < 2 || !has_threads(pool) || owner_works_alone(pool)) {
    for (int32_t item = 0; item < n; item++) work(data, item);
    return;
  }
  pool->work = work;
  pool->data = data;
  divide_items(pool, n);
  atomic_fetch_add(&pool->job, 1);
  wake_workers(pool);
  run_all_shares(pool, 0);
  atomic_fetch_add(&pool->job, 1);
  wait_for_workers(pool);
}

typedef struct chunks_job {
  ms_pool_chunk *work;
  void *data;
  int32_t n, size;
} chunks_job;

static void do_chunk(void *data, int32_t item) {
  const chunks_job *j = data;
  const int32_t begin = j->size * item, left = j->n - begin;
  j->work(j->data, begin, left < j->size ? j->n : begin + j->size);
}

int32_t ms_pool_run_chunks(ms_pool *pool, ms_pool_chunk *work, void *data, int32_t n,
                           int32_t size) {
  chunks_job j = {work, data, n, size};
  ms_pool_run(pool, do_chunk, &j, ms_pool_count_chunks(n, size));
  return ms_pool_count_chunks(n, size);
}

/*------------------------------------- creation and destruction ---------------------------------*/

/* Workers block all signals: these are for the threads of the host program. */
static void start_workers(ms_pool *pool, int32_t threads) {
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  for (int32_t i = 1; i < threads; i++) {
    struct worker *worker = &pool->workers[i];
    *worker = (struct worker){.pool = pool, .index = i};
    if (pthread_create(&worker->thread, NULL, worker_main, worker) != 0) break;
    pool->threads++;
  }
  pthread_sigmask(SIG_SETMASK, &before, NULL);
}

static void free_pool(ms_pool *pool) {
  msim_allocator alloc = pool->alloc;
  MS_FREE(&alloc, pool->workers, pool->shares, pool);
}

ms_pool *ms_pool_create(const msim_allocator *alloc, int32_t threads) {
  static pthread_once_t once = PTHREAD_ONCE_INIT;
  if (threads > MS_MAX_THREADS) threads = MS_MAX_THREADS;
  if (threads < 2) return NULL;
  pthread_once(&once, register_fork_handler);
  ms_pool *pool = ms_memory_allocate(alloc, 1, sizeof *pool);
  if (!pool) return NULL;
  pool->alloc = *alloc;
  pool->forks = atomic_load(&forks);
  pool->threads = 1;
  if (!MS_NEW(alloc, pool->workers, threads) || !MS_NEW(alloc, pool->shares, threads)) {
    free_pool(pool);
    return NULL;
  }
  pthread_mutex_init(&pool->lock, NULL);
  pthread_cond_init(&pool->begin, NULL);
  pthread_cond_init(&pool->all_left, NULL);
  start_workers(pool, threads);
  if (pool->threads > 1) return pool;
  ms_pool_destroy(pool);
  return NULL;
}

/* A child process has none of the threads, and the state of the lock is unknown. */
void ms_pool_destroy(ms_pool *pool) {
  if (!pool) return;
  if (has_threads(pool)) {
    atomic_store(&pool->quit, 1);
    wake_workers(pool);
    for (int32_t i = 1; i < pool->threads; i++) pthread_join(pool->workers[i].thread, NULL);
    pthread_cond_destroy(&pool->begin);
    pthread_cond_destroy(&pool->all_left);
    pthread_mutex_destroy(&pool->lock);
  }
  free_pool(pool);
}

int32_t ms_pool_thread_count(const ms_pool *pool) {
  return pool && has_threads(pool) ? pool->threads : 1;
}
