/* pcg - the state of the built-in conjugate gradients, shared with their kernels
 *
 * All quantities are in units of jacobi.scale, near the largest entry of A, so that they are within
 * the range of floats. The matrix is applied spring by spring to differences,
 *     (A p)_i = (m_i + h b) p_i + sum_j (t I + w w^T) (p_i - p_j),
 * b the drag, with t and w in single precision. That rounding changes the matrix of a spring a
 * little, but alike at both ends, and for t >= 0 it stays positive semidefinite: momentum is
 * conserved, and A stays as definite as it is. Sums are in double precision.
 * With a coarse space r, z, p and q are floats, too, which halves what an iteration transfers of
 * them, but y is not: errors of r and p delay the iteration a little, whereas those of y would be
 * multiplied by A. The true residual, in doubles, decides in any case. Without a coarse space,
 * which small systems do without, the slow modes that these errors bring back would delay it more.
 * So it would where the inertia of a particle is less than the rounding of its springs. descend()
 * has floats where its tolerance allows them, precondition() has doubles.
 * Both half-edges of a spring have t and w. Stored once, in blocks of one offset in four slices
 * from which the other end reads 8 lanes across entries, they need 0.6 of the memory, but an
 * iteration took 1.1 to 1.4 times as long in the cache and beside it (cloths of 64^2 and 500^2,
 * AVX2), and twice as long with one block for each offset, as memory is no longer read in order.
 * Angular springs (physics/angle_springs.h) are added to it in double precision.
 * One iteration consists of three sweeps over the unknowns:
 *     apply    q = A p,                                   sum p.q
 *     reduce   r -= alpha q,  z = D^-1 r,  sums of P^T r, sum r.z;  z replaces q
 *     advance  y += alpha p,  p = z + P c + beta p
 * where D are the diagonal blocks and P c is the coarse correction, whose share of r.z follows from
 * the coarse vectors. Each kernel works on a range of slices of 8 unknowns. */
#ifndef MS_PCG_H
#define MS_PCG_H

#include "base/isa.h"
#include "linear/coarse.h"
#include "linear/compression.h"
#include "linear/jacobi.h"
#include "linear/linear.h"
#include "linear/rank_modes.h"

typedef struct ms_pcg {
  ms_linear base;
  float *coefficients;        /* 32 half_edges.nentries: t, wx, wy, wz of 8 half-edges, by entry */
  ms_compression compression; /* of descend(); model NULL: not prepared */
  ms_jacobi jacobi;
  float *inverse;     /* jacobi.inverse, rounded; in blocks even where that is scalar */
  double *inertia;    /* first_pinned: m + h b, with the mean of the block of a force function */
  int single;         /* 1: r, p and q are vectors of floats, 0: of doubles; each solve chooses */
  int rounds_vectors; /* 1: r, p and q of a double model may be floats, on all ranks */
  void *r, *p, *q;
  double *y;        /* the caller's */
  double *residual; /* b - A y */
  double rho;       /* r.B r of the iteration that p is from; 0: p starts anew */
  int is_free;      /* 1: the matrix has no constraints on any rank */
  int starts;       /* 1: the next direction is in the space of the modes of ranks */
  double unit;      /* of r, p and q; a power of 2, 1 for doubles: squares are in range */
  double *vectors;  /* r, q, p and the residual; NULL: in coarse.value */
  ms_coarse coarse;
  int coarse_is_ready;     /* 1: the coarse matrix is factored */
  int may_reuse_coarse;    /* 1: that factor may be lagged, i.e. serve later systems */
  int32_t coarse_age;      /* calls of factor() since it was computed */
  float *factored_inverse; /* the diagonal of `inverse` when it was computed */
  double factored_scale;   /* jacobi.scale when it was computed */
  double *sums;            /* one per chunk of slices */
  ms_rank_modes *modes;    /* the top level on several ranks; NULL: one process */
  const struct ms_pcg_kernels *kernels;
} ms_pcg;

typedef struct ms_pcg_pack_kernels {
  /* the matrix, its diagonal and the inverse blocks in the units of pcg, as floats */
  void (*pack)(ms_pcg *s, int32_t begin, int32_t end);
} ms_pcg_pack_kernels;

typedef struct ms_pcg_kernels {
  /* r = b */
  void (*begin)(const ms_pcg *s, const double *b, int32_t begin, int32_t end);
  void (*apply)(const ms_pcg *s, int32_t begin, int32_t end, double *sum);
  void (*apply_split_rows)(const ms_pcg *s,
                           double *sum); /* split rows, after apply() of all slices */
  void (*reduce)(const ms_pcg *s, double alpha, int32_t begin, int32_t end, double *sum);
  void (*advance)(const ms_pcg *s, double alpha, double beta, int32_t begin, int32_t end);
  /* y += alpha p */
  void (*end)(const ms_pcg *s, double alpha, int32_t begin, int32_t end);
} ms_pcg_kernels;

typedef ms_pcg_kernels ms_single_pcg_kernels; /* those for vectors of floats */

#endif
