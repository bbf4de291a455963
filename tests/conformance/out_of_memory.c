/* Lack of memory in the library behind a backend: each of its allocations fails in turn, alone or
 * with all later ones. The call returns MSIM_ERR_MEMORY or succeeds without the memory, nothing
 * crashes, nothing leaks. Not with sanitizers. */
#include <stdlib.h>

#include "../failing_allocator.h"
#include "conformance.h"

#if FAILING_MALLOC

static void count_in_calls(int begins) {
  failing_allocator_count(begins ? FAILING_BY_MALLOC : FAILING_NONE);
}

/* All calls of an instance, in which allocation number `which` fails; -1: none. */
static void run_with_failure(int64_t which, int all_later, const problem *p, const double *b,
                             double *y) {
  rig r;
  failing_allocator_arm(which, all_later);
  failing_allocator_count_leaks();
  rig_init(&r, bare, p);
  r.on_call = count_in_calls;
  msim_status status = rig_create(&r);
  if (!status) status = rig_analyze(&r);
  if (!status) status = rig_factor(&r, MSIM_FACTOR_SPD);
  if (!status && symmetric) status = rig_factor(&r, MSIM_FACTOR_SYMMETRIC);
  if (!status) status = rig_solve(&r, RTOL, LIMIT, 1, b, y);
  rig_close(&r);
  const int64_t live = failing_allocator_count_leaks();
  if (status != MSIM_OK && !(failing_allocator_has_failed() && status == MSIM_ERR_MEMORY))
    fail_msg("allocation %lld failed: status %d, \"%s\"", (long long)which, (int)status,
             r.host.sentence);
  if (!status && !is_solution(p, b, y, RTOL, 1e-9))
    fail_msg("allocation %lld failed: a wrong solution with MSIM_OK", (long long)which);
  if (live)
    fail_msg("allocation %lld failed: %lld blocks are left", (long long)which, (long long)live);
}

static void allocations_fail_in_turn(void **state) {
  (void)state;
  if (strstr(bare->library, "SUNDIALS")) {
    print_message("  skipped: SUNDIALS does not check for NULL from malloc\n");
    skip();
  }
  if (strstr(bare->library, "PETSc")) {
    print_message("  skipped: PETSc takes memory by posix_memalign, and MPI ends the process\n");
    skip();
  }
  const int32_t n = 10, block = 3; /* small: threads of OpenBLAS would also end the process */
  problem *p = spring_net(n, block, 1);
  double *b = random_vector(n * block, 3), *y = calloc((size_t)(n * block), sizeof *y);
  outcome o = solve_with(bare, p, MSIM_FACTOR_SPD, b); /* some is allocated only once */
  for (int all_later = 0; all_later < 2; all_later++) {
    int64_t which = -1;
    do {
      run_with_failure(which++, all_later, p, b, y);
    } while (failing_allocator_has_failed() || which == 0);
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

int run_out_of_memory(void) {
  const struct CMUnitTest tests[] = {conformance_test(allocations_fail_in_turn)};
  return cmocka_run_group_tests_name("scarcity", tests, NULL, NULL);
}
