/* target_clones - compiles loops for several vector widths, one of which is selected at load time
 * */
#ifndef BENCH_TARGET_CLONES_H
#define BENCH_TARGET_CLONES_H

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#  define TARGET_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#  define TARGET_CLONES
#endif

#endif
