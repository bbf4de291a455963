/* slice_pair - two neighbouring slices at once, in registers of 16 floats
 *
 * AVX-512 has registers for 16 floats, but slices have 8 rows (half_edges.h). An entry of one slice
 * and one of the next fill a register; each row adds its springs in the same order as alone, so
 * that its bits are those of single slices. */
#ifndef MS_SLICE_PAIR_H
#define MS_SLICE_PAIR_H

#include "physics/fused_step.h"

#if defined(MS_SINGLE) && defined(__AVX512F__)
#  define MS_HAS_SLICE_PAIRS

/* As ms_force_kernels.slices, for an even number of slices of springs that have rest lengths, or
 * damping, and are linear */
int ms_slice_pairs_step(const ms_model *model, const ms_fused_step *sweep, int damped,
                        int32_t begin, int32_t end);
#endif

#endif
