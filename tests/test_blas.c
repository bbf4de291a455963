/* Tests of the OpenBLAS kernels that the programs request: SkylakeX on AMD processors with AVX-512,
 * unless the user has chosen others. */
#define _POSIX_C_SOURCE 200809L /* setenv */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../tools/common/blas.h"
#include "testing.h"

/* According to /proc/cpuinfo; -1: it cannot be read */
static int is_amd_with_avx512(void) {
  char line[8192];
  int amd = 0, avx512 = 0;
  FILE *file = fopen("/proc/cpuinfo", "r");
  if (!file) return -1;
  while (fgets(line, sizeof line, file)) {
    amd |= strstr(line, "AuthenticAMD") != NULL;
    avx512 |= strstr(line, " avx512f ") && strstr(line, " avx512cd") && strstr(line, " avx512bw") &&
              strstr(line, " avx512dq") && strstr(line, " avx512vl");
  }
  fclose(file);
  return amd && avx512;
}

static void set_where_it_is_needed(void **state) {
  (void)state;
  const int is_needed = is_amd_with_avx512();
  if (is_needed < 0) skip();
  unsetenv("OPENBLAS_CORETYPE");
  blas_choose_kernels();
  const char *chosen = getenv("OPENBLAS_CORETYPE");
  assert_int_equal(chosen != NULL, is_needed);
  if (chosen) assert_string_equal(chosen, "SkylakeX");
}

static void left_where_it_is_set(void **state) {
  (void)state;
  setenv("OPENBLAS_CORETYPE", "Zen", 1);
  blas_choose_kernels();
  assert_string_equal(getenv("OPENBLAS_CORETYPE"), "Zen");
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(set_where_it_is_needed),
                                     cmocka_unit_test(left_where_it_is_set)};
  return cmocka_run_group_tests_name("blas", tests, NULL, NULL);
}
