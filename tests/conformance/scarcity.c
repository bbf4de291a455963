/* Scarcity: every allocation of the library behind a backend fails in turn, and with it all later
 * ones or none. The call says MSIM_ERR_MEMORY or does without, nothing crashes, nothing stays
 * behind. malloc itself is taken over for that, which sanitizers do too: they leave this out. */
#include <malloc.h>
#include <stdlib.h>

#include "conformance.h"

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)

void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *old, size_t size);
void *__libc_memalign(size_t alignment, size_t size);
void __libc_free(void *ptr);

/* Of this thread, while a backend is called. */
static _Thread_local int inside, for_good, ended;
static _Thread_local int64_t left, live; /* allocations until one fails; blocks not freed */

/* NULL for the one that is to fail. */
static int is_there(void) {
  if (!inside || left < 0) return 1;
  if (left > 0) return left--, 1;
  ended = 1;
  if (!for_good) left = -1;
  return 0;
}

static void *count(void *block) {
  live += inside && block;
  return block;
}

/* seen by all libraries of the process */
#  pragma GCC visibility push(default)
void *malloc(size_t size) { return is_there() ? count(__libc_malloc(size)) : NULL; }

void *calloc(size_t n, size_t size) { return is_there() ? count(__libc_calloc(n, size)) : NULL; }

void *realloc(void *old, size_t size) {
  if (!is_there()) return NULL;
  return old ? __libc_realloc(old, size) : count(__libc_malloc(size));
}

/* Never fails: OpenMP would end the process, and nobody could help it. */
void *memalign(size_t alignment, size_t size) { return count(__libc_memalign(alignment, size)); }

void free(void *ptr) {
  live -= inside && ptr;
  __libc_free(ptr);
}

#  pragma GCC visibility pop

static void around(int begins) { inside = begins; }

/* One life of an instance in which the allocation number `which` fails; -1: none. */
static void live_with(int64_t which, int all_later, const problem *p, const double *b, double *y) {
  rig r;
  left = which, for_good = all_later, ended = 0, live = 0;
  rig_init(&r, bare, p);
  r.around = around;
  msim_status status = rig_create(&r);
  if (!status) status = rig_analyze(&r);
  if (!status) status = rig_factor(&r, MSIM_FACTOR_SPD);
  if (!status && symmetric) status = rig_factor(&r, MSIM_FACTOR_SYMMETRIC);
  if (!status) status = rig_solve(&r, RTOL, LIMIT, 1, b, y);
  const int failed = ended;
  rig_close(&r);
  if (status != MSIM_OK && !(failed && status == MSIM_ERR_MEMORY))
    fail_msg("allocation %lld failed: status %d, \"%s\"", (long long)which, (int)status,
             r.host.sentence);
  if (!status && !is_answer(p, b, y, RTOL, 1e-9))
    fail_msg("allocation %lld failed: a wrong answer with MSIM_OK", (long long)which);
  if (live)
    fail_msg("allocation %lld failed: %lld blocks are left", (long long)which, (long long)live);
}

static void allocations_fail_in_turn(void **state) {
  (void)state;
  if (strstr(bare->library, "SUNDIALS")) {
    print_message("  SUNDIALS does not look at what malloc gives it\n");
    skip();
  }
  const int32_t n = 10, block = 3; /* small: threads of OpenBLAS would end the process, too */
  problem *p = spring_net(n, block, 1);
  double *b = random_vector(n * block, 3), *y = calloc((size_t)(n * block), sizeof *y);
  outcome o = solve_with(bare, p, MSIM_FACTOR_SPD, b); /* what libraries allocate only once */
  for (int all_later = 0; all_later < 2; all_later++) {
    int64_t which = -1;
    do {
      live_with(which++, all_later, p, b, y);
    } while (ended || which == 0);
    print_message("  %lld allocations\n", (long long)which - 1);
  }
  free(o.y), free(b), free(y), problem_free(p);
}

#else

static void allocations_fail_in_turn(void **state) {
  (void)state;
  skip();
}

#endif

int run_scarcity(void) {
  const struct CMUnitTest tests[] = {conformance_test(allocations_fail_in_turn)};
  return cmocka_run_group_tests_name("scarcity", tests, NULL, NULL);
}
