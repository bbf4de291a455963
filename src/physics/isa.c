#define _GNU_SOURCE /* secure_getenv */
#include <stdlib.h>
#include <string.h>

#include "physics/kernels.h"

extern const ms_kernels ms_kernels_baseline;
#ifdef MSIM_X86_KERNELS
extern const ms_kernels ms_kernels_avx2, ms_kernels_avx512;
#endif

const ms_kernels *ms_kernels_named(const char *isa) {
  if (strcmp(isa, "baseline") == 0) return &ms_kernels_baseline;
#ifdef MSIM_X86_KERNELS
  if (strcmp(isa, "avx2") == 0 && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
    return &ms_kernels_avx2;
  if (strcmp(isa, "avx512") == 0 && __builtin_cpu_supports("avx512f")) return &ms_kernels_avx512;
#endif
  return NULL;
}

const ms_kernels *ms_kernels_best(void) {
  const char *wanted = secure_getenv("MSIM_ISA");
  const char *const names[] = {wanted ? wanted : "avx512", "avx512", "avx2"};
  for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
    const ms_kernels *kernels = ms_kernels_named(names[i]);
    if (kernels) return kernels;
  }
  return &ms_kernels_baseline;
}
