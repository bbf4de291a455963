#define _POSIX_C_SOURCE 200809L /* pthread_barrier_t */
#include "triad.h"

#include <math.h>
#include <pthread.h>
#include <stdlib.h>

#include "../common/clock.h"

int triad_make(triad *t, size_t bytes) {
  enum { LINE = 64 };
  const size_t size = bytes / 3 / LINE * LINE + LINE;
  *t = (triad){.n = size / sizeof(double),
               .a = aligned_alloc(LINE, size),
               .b = aligned_alloc(LINE, size),
               .c = aligned_alloc(LINE, size)};
  if (!t->a || !t->b || !t->c) return 0;
  for (size_t i = 0; i < t->n; i++) t->a[i] = 0, t->b[i] = (double)i, t->c[i] = 1;
  return 1;
}

void triad_free(triad *t) {
  free(t->a);
  free(t->b);
  free(t->c);
  *t = (triad){0};
}

static void triad_pass(const triad *t, size_t begin, size_t end, double s) {
  double *restrict a = t->a;
  const double *restrict b = t->b, *restrict c = t->c;
  for (size_t i = begin; i < end; i++) a[i] = b[i] + s * c[i];
}

typedef struct triad_share {
  const triad *triad;
  size_t begin, end;
  int passes;
  pthread_barrier_t *ready;
} triad_share;

static void *run_half(void *data) {
  const triad_share *h = data;
  if (h->ready) pthread_barrier_wait(h->ready);
  for (int i = 0; i < h->passes; i++) triad_pass(h->triad, h->begin, h->end, i + 1);
  return NULL;
}

static double run_two(const triad *t, int passes) {
  pthread_barrier_t ready;
  pthread_t other;
  pthread_barrier_init(&ready, NULL, 2);
  triad_share mine = {t, 0, t->n / 2, passes, NULL}, theirs = {t, t->n / 2, t->n, passes, &ready};
  double seconds = NAN;
  if (pthread_create(&other, NULL, run_half, &theirs) == 0) {
    pthread_barrier_wait(&ready);
    const double start = clock_seconds();
    run_half(&mine);
    pthread_join(other, NULL);
    seconds = clock_seconds() - start;
  }
  pthread_barrier_destroy(&ready);
  return seconds / passes;
}

double triad_seconds(const triad *t, int threads, int passes) {
  if (threads == 2) return run_two(t, passes);
  triad_share all = {t, 0, t->n, passes, NULL};
  const double start = clock_seconds();
  run_half(&all);
  return (clock_seconds() - start) / passes;
}
