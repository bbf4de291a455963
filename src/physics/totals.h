/* totals - energy, place and size of an island, in one pass over memory */
#ifndef MS_TOTALS_H
#define MS_TOTALS_H

#include "base/isa.h"
#include "physics/model.h"

/* Of the unknowns and their springs; pinned particles move nothing. */
typedef struct ms_totals {
  double kinetic, elastic; /* J */
  double moment[3];        /* sum of m x, kg m */
  double low[3], high[3];  /* the box around the particles, m; 0 along an axis left out */
} ms_totals;

/* Where the pass puts the state, too: two vectors of the model, whose pinned rows stay. */
typedef struct ms_totals_copy {
  double *x, *v;
} ms_totals_copy;

/* Parts that the sums are made of: room for so many is needed. */
int32_t ms_totals_parts(const ms_model *model);

/* Of the state x, v, by all threads of the model's pool; no bit depends on their number. */
ms_totals ms_totals_compute(const ms_model *model, const double *x, const double *v,
                            const ms_totals_copy *copy, ms_totals *parts);

/* to += more, and the box around both */
void ms_totals_add(const ms_totals *more, ms_totals *to);

/* Of nothing: added to, it takes what is added. */
ms_totals ms_totals_none(void);

/* One set for each instruction set: the segments [begin, end) of halves.h. */
typedef struct ms_totals_kernels {
  void (*segments)(const ms_model *model, const double *x, const double *v,
                   const ms_totals_copy *copy, int32_t begin, int32_t end, ms_totals *totals);
} ms_totals_kernels;

#endif
