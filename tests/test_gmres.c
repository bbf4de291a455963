/* Tests of the memory of GMRES, which stores one or two vectors per iteration before it restarts.
 * The restart length is what fits in 128 MiB, but at least 30 and at most 200, and at most the
 * number of unknowns. */
#include <string.h>

#include "counting_host.h"
#include "msim/backend.h"
#include "scenes.h"

/* Blocks of memory after the analysis of a system of n unknowns, one in each block row */
static int count_blocks(const msim_backend *table, int32_t n) {
  counting_host host;
  void *self;
  msim_solve_info info = {.size = sizeof info};
  const msim_system A = {
      .size = sizeof A, .n = n, .block = 1, .format = table->format, .stride = n};
  host_init(&host);
  assert_int_equal(table->create(&host.host, &self), MSIM_OK);
  assert_int_equal(table->analyze(self, &A, &info), MSIM_OK);
  const int count = host.live;
  table->destroy(self);
  assert_int_equal(host.live, 0);
  return count;
}

/* For small systems the restart length is the number of unknowns: two of them give the number of
 * blocks per iteration. */
static void check_lengths(const char *name, int64_t vectors) {
  const msim_backend *table;
  const int64_t memory = 128 << 20, size = sizeof(double);
  assert_ok(msim_solver_backend(name, NULL, &table, err));
  const int ten = count_blocks(table, 10), each = (count_blocks(table, 20) - ten) / 10;
  assert_true(each > 0);
  const int32_t sizes[] = {199, 1000, 80000, 200000, (int32_t)(memory / (vectors * size * 28))};
  const int64_t lengths[] = {199, 200, memory / (vectors * size * 80000),
                             memory / (vectors * size * 200000), 30};
  for (int i = 0; i < 5; i++) {
    const int length = 10 + (count_blocks(table, sizes[i]) - ten) / each;
    assert_int_equal(length, lengths[i] < 200 ? lengths[i] : 200);
  }
}

static void calls_are_as_long_as_memory_allows(void **state) {
  (void)state;
  require(is_solver_available("sundials-spgmr"), "SUNDIALS");
  check_lengths("sundials-spgmr", 1);
  check_lengths("sundials-spfgmr", 2);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(calls_are_as_long_as_memory_allows)};
  return cmocka_run_group_tests_name("gmres", tests, NULL, NULL);
}
