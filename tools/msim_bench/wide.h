/* wide - compiles loops for several vector widths, one of which is selected at load time */
#ifndef BENCH_WIDE_H
#define BENCH_WIDE_H

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#  define WIDE __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#  define WIDE
#endif

#endif
