/* compression - how much of the transverse stiffness t < 0 of compressed springs pcg leaves out of
 * an indefinite matrix
 *
 * t is negative in every spring that is shorter than at rest, and the matrix indefinite only where
 * the mesh is about to buckle: mostly in few places at a time. So t < 0 is left out spring by
 * spring, where a search direction p has shown that p.A p < 0, and stays in A elsewhere; compare
 * the projection on demand of Longva et al. (2023) and, for single elements, Teran et al. (2005).
 * As springs move, the next matrix of Newton's method has most of t again. */
#ifndef MS_COMPRESSION_H
#define MS_COMPRESSION_H

#include "physics/model.h"

typedef struct ms_compression {
  const ms_model *model;
  float *left_out; /* 8 halves.nslots: the share of t < 0 that is left out, in [0, 1] */
  double *largest; /* by chunk of slots */
} ms_compression;

msim_status ms_compression_create(const ms_model *model, ms_compression *c, msim_error *err);
void ms_compression_destroy(ms_compression *c);

/* The matrix is the clamped one, and the next one starts with all of t. */
void ms_compression_forget(ms_compression *c);

/* The next matrix, in the coefficients of pcg.h: it leaves out a tenth of what the last one did. */
void ms_compression_apply(ms_compression *c, float *coefficients);

/* p.A p <= 0: halve t in the springs that have most part in that. 0: none has. */
int ms_compression_reduce(ms_compression *c, const double *p, float *coefficients);

#endif
