/* step - forces and what a step makes of them, in one pass over memory */
#ifndef MS_STEP_H
#define MS_STEP_H

#include "base/isa.h"
#include "physics/model.h"

/* One pass over the unknown rows. A result that is NULL is not made; pinned rows of results are
 * left alone. Rows read x and v of their neighbours: no result may lie there. */
typedef struct ms_pass {
  const double *x, *v; /* where forces are taken; v NULL: those that do not depend on it */
  double *f;           /* F(x, v) */
  double *a;           /* F/m */

  /* v_to = v_from + h_before a_before + h F/m; a_before nullable */
  double *v_to;
  const double *v_from, *a_before;
  double h_before, h;

  /* x_to = x_from + drift along; along NULL: v_to */
  double *x_to;
  const double *x_from, *along;
  double drift;
} ms_pass;

/* By all threads of the model's pool; each row by one of them, so no bit depends on their number.
 * Returns 1 if no number of v_to, and of x_to, or else x, is NaN or beyond MS_HUGE; 0: some may be.
 */
int ms_pass_run(const ms_model *model, const ms_pass *pass);

/* One set for each instruction set. */
typedef struct ms_pass_kernels {
  /* groups [begin, end), after the parts; returns as ms_pass_run does */
  int (*groups)(const ms_model *model, const ms_pass *pass, int32_t begin, int32_t end);
  /* one part of a long row, to halves.part_sums */
  void (*part)(const ms_model *model, const ms_pass *pass, int32_t part);
} ms_pass_kernels;

#endif
