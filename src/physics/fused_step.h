/* fused_step - computes forces and updates x and v with them, fused into one sweep over memory */
#ifndef MS_FUSED_FUSED_STEP_H
#define MS_FUSED_FUSED_STEP_H

#include "base/isa.h"
#include "physics/model.h"

/* Inputs and results of one force sweep over the unknowns, vectors of doubles, or of floats if the
 * model computes in single precision (ms_model.single). A result that is NULL is not computed;
 * pinned rows of results are not written. Rows read x and v of their neighbours: no result may
 * alias these. */
typedef struct ms_fused_step {
  const void *x, *v;      /* state of the forces; v NULL: without the terms in v */
  double t;               /* s: the time of a force function */
  const void *function_v; /* its velocities; NULL: v */
  void *f;                /* F(x, v) */
  void *a;                /* F/m */

  /* v_to = v_from + h_before a_before + h F/m; a_before nullable */
  void *v_to;
  const void *v_from, *a_before;
  double h_before, h;

  /* x_to = x_from + drift along; along NULL: v_to */
  void *x_to;
  const void *x_from, *along;
  double drift;
} ms_fused_step;

/* Runs on all threads of the model's pool; bits do not depend on their number. Returns 1 if no
 * number of v_to and x_to is NaN or beyond MS_LARGEST_VALID, 0 if some may be. If x_to is NULL, it
 * checks x with v_to. */
int ms_fused_step_run(const ms_model *model, const ms_fused_step *sweep);

/* One table for each instruction set. */
typedef struct ms_force_kernels {
  /* slices [begin, end), after the parts of split rows; returns as ms_fused_step_run does */
  int (*slices)(const ms_model *model, const ms_fused_step *sweep, int32_t begin, int32_t end);
  /* one part of a split row, to half_edges.part_sums */
  void (*part)(const ms_model *model, const ms_fused_step *sweep, int32_t part);
} ms_force_kernels;

typedef ms_force_kernels ms_single_force_kernels; /* those for models in single precision */

#endif
