/* isa - the instruction sets for which the inner loops are compiled, and the choice of one
 *
 * A file of kernels is compiled once for each, with MS_ISA defined as its name, and ends with one
 * constant table:
 *     const ms_block_kernels MS_TABLE(ms_block_kernels) = {...};
 * A caller declares MS_TABLES(ms_block_kernels) and uses ms_block_kernels_of[isa]. */
#ifndef MS_ISA_H
#define MS_ISA_H

enum { MS_ISA_BASELINE, MS_ISA_AVX2, MS_ISA_AVX512 };

/* name: baseline, avx2 or avx512. -1: not compiled, or not supported by this CPU. */
int ms_isa_find(const char *name);

/* The instruction set named by the environment variable MSIM_ISA, else the widest of this CPU. */
int ms_isa_choose(void);

#ifndef MS_ISA
#  define MS_ISA baseline
#endif
#define MS_TABLE__(table, isa) table##_##isa
#define MS_TABLE_(table, isa)  MS_TABLE__(table, isa)
#define MS_TABLE(table)        MS_TABLE_(table, MS_ISA)

#ifdef MSIM_X86_KERNELS
#  define MS_TABLES(table)                                             \
    extern const table table##_baseline, table##_avx2, table##_avx512; \
    static const table *const table##_of[] = {&table##_baseline, &table##_avx2, &table##_avx512}
#else
#  define MS_TABLES(table)               \
    extern const table table##_baseline; \
    static const table *const table##_of[] = {&table##_baseline}
#endif

#endif
