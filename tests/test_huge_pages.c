/* Tests of huge pages: the memory of large scenes asks for them, that of small ones does not. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/memory.h"
#include "testing.h"

/* 1: the mapping that holds ptr was advised to have huge pages, by its flag hg in
 * /proc/self/smaps */
static int is_advised(const void *ptr) {
  FILE *f = fopen("/proc/self/smaps", "r");
  char line[512];
  int inside = 0, found = 0;
  assert_non_null(f);
  while (!found && fgets(line, sizeof line, f)) {
    uintptr_t begin, end;
    if (sscanf(line, "%" SCNxPTR "-%" SCNxPTR " ", &begin, &end) == 2)
      inside = begin <= (uintptr_t)ptr && (uintptr_t)ptr < end;
    found = inside && !strncmp(line, "VmFlags:", 8) && strstr(line, " hg");
  }
  fclose(f);
  return found;
}

static void large_blocks_ask_for_huge_pages(void **state) {
  const msim_allocator alloc = ms_memory_allocator(NULL);
  char *large = ms_memory_allocate(&alloc, 64, 1 << 20),
       *small = ms_memory_allocate(&alloc, 1, 1 << 16);
  (void)state;
  assert_non_null(large);
  assert_non_null(small);
  for (size_t i = 0; i < (size_t)64 << 20; i += 4096) assert_int_equal(large[i], 0);
  if (!access("/sys/kernel/mm/transparent_hugepage", F_OK)) {
    assert_true(is_advised(large));
    assert_true(is_advised(large + ((size_t)63 << 20)));
    assert_false(is_advised(small));
  }
  ms_memory_free(&alloc, large);
  ms_memory_free(&alloc, small);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(large_blocks_ask_for_huge_pages)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
