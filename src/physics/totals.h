/* totals - energy, mass moment and bounding box of an island, computed in one sweep over memory */
#ifndef MS_TOTALS_H
#define MS_TOTALS_H

#include "base/isa.h"
#include "base/ranks.h"
#include "physics/model.h"

/* Of the unknowns and their springs, without pinned particles. */
typedef struct ms_totals {
  double kinetic, elastic; /* J */
  double moment[3];        /* sum of m x, kg m */
  double force_work;       /* sum of F.x for constant forces: minus their potential energy, J */
  double low[3], high[3];  /* bounding box, m; 0 along an axis left out */
} ms_totals;

/* The number of partial sums. */
int32_t ms_totals_count_parts(const ms_model *model);

/* Totals of the state x, v of the unknowns of this rank, by all threads of the model's pool, bit
 * for bit the same for any number of them. parts: scratch, ms_totals_count_parts. Collective. */
ms_totals ms_totals_compute(const ms_model *model, const double *x, const double *v,
                            ms_totals *parts);

/* to += more; the box becomes that around both. */
void ms_totals_add(const ms_totals *more, ms_totals *to);

/* Add the totals of all ranks; collective. Nullable: ranks. */
void ms_totals_sum_ranks(ms_ranks *ranks, ms_totals *totals);

/* Identity of ms_totals_add. */
ms_totals ms_totals_identity(void);

typedef struct ms_totals_job {
  const ms_model *model;
  const double *x, *v;
  ms_totals *parts;
} ms_totals_job;

/* One table for each instruction set: totals of the slice ranges [begin, end). */
typedef struct ms_totals_kernels {
  ms_totals (*slice_ranges)(const ms_totals_job *job, int32_t begin, int32_t end);
} ms_totals_kernels;

#endif
