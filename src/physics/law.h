/* law - evaluation of the laws of springs: force, slope and energy as functions of the stretch
 *
 *   e = l - L,  f(e),  f' = df/de,  E = integral of f from 0 to e.
 * The formulas of the kinds are in msim/scene.h. */
#ifndef MS_LAW_H
#define MS_LAW_H

#include "scene/laws.h"

/* Springs of a batch at most */
enum { MS_LAW_BATCH = 64 };

/* Inputs and results of a batch */
typedef struct ms_law_batch {
  int only_force; /* 1: slope and energy need not be computed */
  double stretch[MS_LAW_BATCH], force[MS_LAW_BATCH], slope[MS_LAW_BATCH], energy[MS_LAW_BATCH];
} ms_law_batch;

/* Evaluate `law` for n springs with these k and rest, whose stretches are in batch->stretch. */
void ms_law_evaluate(const ms_law *law, int32_t n, const double *k, const double *rest,
                     ms_law_batch *batch);

/* f, f' and E of one spring of a scene, of any law, at length l */
typedef struct ms_law_value {
  double force, slope, energy;
} ms_law_value;

ms_law_value ms_law_value_of(const ms_scene *scene, int32_t spring, double l);

#endif
