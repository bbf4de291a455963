/* compression - reduces the negative transverse stiffness t of compressed springs, where it makes
 * the matrix of pcg indefinite
 *
 * t is negative in every spring shorter than its rest length, but the matrix is indefinite only
 * where the mesh is about to buckle, mostly in few places at a time. Therefore t is reduced spring
 * by spring, once a search direction p has shown that p.A p <= 0; compare the projection on demand
 * of Longva et al. (2023) and, for single elements, Teran et al. (2005). As springs move, the next
 * matrix of Newton's method has most of t again. */
#ifndef MS_COMPRESSION_H
#define MS_COMPRESSION_H

#include "physics/model.h"

typedef struct ms_compression {
  const ms_model *model;
  float *reduction; /* 8 half_edges.nentries: the fraction by which t < 0 is reduced, in [0, 1] */
  double *largest;  /* per chunk of slice ranges: the largest contribution to -p.A p */
} ms_compression;

msim_status ms_compression_create(const ms_model *model, ms_compression *c, msim_error *err);
void ms_compression_destroy(ms_compression *c);

/* Reset all fractions to 0: for the clamped matrix, which has no t < 0. */
void ms_compression_reset(ms_compression *c);

/* Reduce t < 0 in the coefficients (pcg.h) of a new matrix, by a tenth of the last fractions. */
void ms_compression_carry_over(ms_compression *c, float *coefficients);

/* Given x.A x <= 0, x that of the operands, halve t < 0 in the springs that contribute to that at
 * least a thousandth of the largest contribution of any rank. Returns 0 if none contributes;
 * collective. */
int ms_compression_reduce(ms_compression *c, ms_operands operands, float *coefficients);

#endif
