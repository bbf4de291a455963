/* pcg - the state of the built-in conjugate gradients, as its kernels see it
 *
 * Everything is in units of jacobi.scale, near the largest entry of A, so that floats hold what is
 * rounded to them. The matrix is applied spring by spring to differences,
 *     (A p)_i = (m_i + h b) p_i + sum_j (t I + w w^T) (p_i - p_j),
 * with t and w in single precision: that changes each spring's own matrix a little, and never the
 * balance of its two ends, so that A stays as definite as it is. Sums are in double precision.
 * One iteration is three passes over the rows:
 *     apply    q = A p,                                   sum p.q
 *     reduce   r -= alpha q,  z = D^-1 r,                 sum r.z
 *     advance  y += alpha p,  p = z + P c + beta p
 * where D are the diagonal blocks and P c the coarse part, whose share of r.z is known from the
 * coarse vectors. Each pass works on a range of groups. */
#ifndef MS_PCG_H
#define MS_PCG_H

#include "base/isa.h"
#include "linear/coarse.h"
#include "linear/compression.h"
#include "linear/jacobi.h"
#include "linear/linear.h"

typedef struct ms_pcg {
  ms_linear base;
  float *coefficients;        /* 32 halves.nslots: t, wx, wy, wz of 8 halves, slot by slot */
  ms_compression compression; /* in descend() */
  ms_jacobi jacobi;
  float *inverse;            /* the same, rounded */
  double *inertia;           /* first_pinned: m + h b; 1 in the padding */
  double *r, *z, *p, *q, *y; /* y: the caller's */
  ms_coarse coarse;
  int coarse_is_ready; /* it is factored */
  int may_keep;        /* in later steps too */
  int32_t coarse_age;  /* factors of A since then */
  float *factored;     /* 6 first_pinned: inverse when it was */
  double factored_scale;
  double *sums; /* one for each chunk of groups */
  const struct ms_pcg_kernels *kernels;
} ms_pcg;

typedef struct ms_pcg_kernels {
  void (*pack)(ms_pcg *s, int32_t begin, int32_t end);
  void (*apply)(const ms_pcg *s, int32_t begin, int32_t end, double *sum);
  void (*apply_parts)(const ms_pcg *s, double *sum); /* of long rows, after the groups */
  void (*reduce)(const ms_pcg *s, double alpha, int32_t begin, int32_t end, double *sum);
  void (*advance)(const ms_pcg *s, double alpha, double beta, int32_t begin, int32_t end);
} ms_pcg_kernels;

#endif
