#define _POSIX_C_SOURCE 200809L /* setenv */
#include "blas.h"

#include <stdlib.h>

/* 1: an AMD processor has all instructions that OpenBLAS' SkylakeX kernels are compiled for. */
static int needs_skylakex_kernels(void) {
#if defined(__GNUC__) && defined(__x86_64__)
  __builtin_cpu_init();
  return __builtin_cpu_is("amd") && __builtin_cpu_supports("avx512f") &&
         __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512bw") &&
         __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
#else
  return 0;
#endif
}

void blas_choose_kernels(void) {
  if (needs_skylakex_kernels()) setenv("OPENBLAS_CORETYPE", "SkylakeX", 0);
}
