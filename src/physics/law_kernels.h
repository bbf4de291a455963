/* law_kernels - the loops over springs with a law, one table for each instruction set; bits do not
 * depend on it, as no fused multiply-add is used */
#ifndef MS_LAW_KERNELS_H
#define MS_LAW_KERNELS_H

#include "base/isa.h"
#include "physics/law.h"
#include "physics/law_springs.h"

/* The springs of a run at some positions: d = x_j - x_i in the components of the model, and its
 * length */
typedef struct ms_law_lengths {
  double d[3][MS_LAW_BATCH], l2[MS_LAW_BATCH], l[MS_LAW_BATCH];
  ms_law_batch at;
} ms_law_lengths;

typedef struct ms_law_kernels {
  void (*measure)(const ms_model *model, const ms_law_run *run, const double *x,
                  ms_law_lengths *to);
  /* f/l d, the force on the first particle of each spring, to laws.scratch; as with linear springs,
   * l is at least that of MS_MIN_LENGTH2 */
  void (*forces)(const ms_model *model, const ms_law_run *run, const double *x);
  /* the sums of these for rows [begin, end) of laws.row, to added_force */
  void (*add_forces)(const ms_model *model, int32_t begin, int32_t end);
  /* the least limit - l of the springs of a run (law_breaking.h); -1 where some is not >= 0 */
  double (*slack)(const ms_model *model, const ms_law_run *run, const double *x);
  /* 1: some row of [begin, end), whole slices, is farther than `most` from where it was at `seen`,
   * or is not finite. */
  int (*has_moved)(const ms_model *model, int32_t begin, int32_t end, const double *seen,
                   const double *x, double most);
} ms_law_kernels;

/* Evaluate the law of a run at the stretches in at->stretch. */
void ms_law_springs_evaluate(const ms_model *model, const ms_law_run *run, ms_law_batch *at);

#endif
