/* problem - sparse block matrices of many kinds for tests of backends, as lists of scalar
 * entries */
#ifndef PROBLEM_H
#define PROBLEM_H

#include <stdint.h>

/* a(row, column) += value + skew and a(column, row) += value - skew; a diagonal entry is added
 * once */
typedef struct entry {
  int32_t row, column; /* row <= column */
  double value, skew;
} entry;

typedef struct problem {
  int32_t n, block; /* number of block rows, scalar rows in each */
  int32_t count, capacity;
  entry *entries;
} problem;

static inline int32_t unknowns(const problem *p) { return p->block * p->n; }

/* Positive definite: diagonally dominant, every row coupled to a few random ones. The pattern
 * depends on the size only, the values on the seed. */
problem *random_dominant(int32_t n, int32_t block, uint64_t seed);

/* Positive definite, condition number about 1e4: M - h^2 J of a net of stretched springs. */
problem *spring_net(int32_t n, int32_t block, uint64_t seed);

/* Symmetric indefinite: spring_net with one diagonal scalar made negative. */
problem *one_negative(int32_t n, int32_t block, uint64_t seed);

/* Identities on the diagonal, neighbours coupled by 1.2: each diagonal block is positive definite;
 * the matrix is indefinite if n >= 2. */
problem *strong_coupling(int32_t n, int32_t block, uint64_t seed);

/* The negative of spring_net. */
problem *negative_definite(int32_t n, int32_t block, uint64_t seed);

/* Positive semidefinite with integer entries, so that a zero pivot is exactly zero: the stiffness
 * matrix of a free chain of springs without mass; an identity with one row of zeros. */
problem *free_chain(int32_t n, int32_t block, uint64_t seed);
problem *zero_row(int32_t n, int32_t block, uint64_t seed);

/* Positive definite and badly scaled: D A D with D from 1e-6 to 1e6; masses that differ by 1e9. */
problem *badly_scaled(int32_t n, int32_t block, uint64_t seed);
problem *unequal_masses(int32_t n, int32_t block, uint64_t seed);

/* Positive definite: L L^T of blocks of three scalars, with a pivot of 1e-8 next to an entry
 * 1e-4. */
problem *small_pivots(int32_t n, int32_t block, uint64_t seed);

/* p with every scalar on the diagonal set to `value`. */
problem *set_diagonal(problem *p, double value);

/* A + S with S^T = -S random, off the diagonal half as large as A. */
problem *add_skew_part(problem *p, uint64_t seed);

/* A = factor A */
problem *scale_values(problem *p, double factor);

void problem_free(problem *p);

/* y = A x */
void problem_apply(const problem *p, const double *x, double *y);

/* The inverses of the diagonal blocks, row by row, and the identity for a block that is not
 * positive definite. With such a block msim itself calls no backend. */
void problem_invert_blocks(const problem *p, double *inverse /* block^2 n */);

/* ||b - A y|| / ||b|| in the norm sqrt(r.D^-1 r), D the diagonal blocks; 0 for b = 0 and y = 0 */
double residual(const problem *p, const double *b, const double *y);

/* ||b - A y|| / || |A| |y| + |b| || in the 2-norm: a few eps if only rounding errors y */
double backward_error(const problem *p, const double *b, const double *y);

/* Uniform pseudorandom numbers in [-1, 1); the caller frees them. */
double *random_vector(int32_t n, uint64_t seed);

#endif
