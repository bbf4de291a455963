#define _GNU_SOURCE /* secure_getenv */
#include "base/isa.h"

#include <stdlib.h>
#include <string.h>

int ms_isa_find(const char *name) {
  if (strcmp(name, "baseline") == 0) return MS_ISA_BASELINE;
#ifdef MSIM_X86_KERNELS
  if (strcmp(name, "avx2") == 0 && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
    return MS_ISA_AVX2;
#  ifdef MSIM_EMULATE_AVX512 /* tests/emulated_avx512.h */
  if (strcmp(name, "avx512") == 0 && ms_isa_find("avx2") >= 0) return MS_ISA_AVX512;
#  endif
  if (strcmp(name, "avx512") == 0 && __builtin_cpu_supports("avx512f") &&
      __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("fma"))
    return MS_ISA_AVX512;
#endif
  return -1;
}

int ms_isa_choose(void) {
  const char *wanted = secure_getenv("MSIM_ISA");
  const char *const names[] = {wanted ? wanted : "avx512", "avx512", "avx2"};
  for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
    const int isa = ms_isa_find(names[i]);
    if (isa >= 0) return isa;
  }
  return MS_ISA_BASELINE;
}
