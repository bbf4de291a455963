/* problem - block matrices of every kind, as lists of their scalar entries */
#ifndef PROBLEM_H
#define PROBLEM_H

#include <stdint.h>

/* a(row, column) += value + skew, a(column, row) += value - skew, the diagonal once */
typedef struct entry {
  int32_t row, column; /* row <= column */
  double value, skew;
} entry;

typedef struct problem {
  int32_t n, block; /* block rows, scalars in each */
  int32_t count, capacity;
  entry *entries;
} problem;

static inline int32_t unknowns(const problem *p) { return p->block * p->n; }

/* Positive definite: diagonally dominant, every row coupled to a few at random. The pattern depends
 * on the size only, the values on the seed. */
problem *random_dominant(int32_t n, int32_t block, uint64_t seed);

/* Positive definite, condition about 1e4: M - h^2 J of a net of stretched springs. */
problem *spring_net(int32_t n, int32_t block, uint64_t seed);

/* Symmetric and neither; `spring_net` with one scalar of the diagonal made negative. */
problem *one_negative(int32_t n, int32_t block, uint64_t seed);

/* A chain of identities with neighbours coupled by 1.2: each diagonal block is positive definite,
 * the whole is not, from two rows on. */
problem *strong_coupling(int32_t n, int32_t block, uint64_t seed);

/* - spring_net */
problem *negative_definite(int32_t n, int32_t block, uint64_t seed);

/* Positive semidefinite, in integers, so that a zero pivot is exactly zero: a chain of springs
 * without mass; an identity with one row of zeros. */
problem *free_chain(int32_t n, int32_t block, uint64_t seed);
problem *zero_row(int32_t n, int32_t block, uint64_t seed);

/* Positive definite, badly scaled: D A D with D from 1e-6 to 1e6; masses 1e9 apart. */
problem *badly_scaled(int32_t n, int32_t block, uint64_t seed);
problem *unequal_masses(int32_t n, int32_t block, uint64_t seed);

/* Positive definite: L L' by threes of scalars, with a pivot of 1e-8 that has 1e-4 beside it. */
problem *small_pivots(int32_t n, int32_t block, uint64_t seed);

/* random_dominant with every scalar of the diagonal `value`. */
problem *with_diagonal(problem *p, double value);

/* A + S, S' = -S: half as large off the diagonal, at random. */
problem *skewed(problem *p, uint64_t seed);

/* A = factor A */
problem *times(problem *p, double factor);

void problem_free(problem *p);

/* y = A x */
void problem_apply(const problem *p, const double *x, double *y);

/* The inverses of the diagonal blocks, by rows; the identity stands in where one is not positive
 * definite. msim itself does not even ask a backend then. */
void problem_invert_blocks(const problem *p, double *inverse /* block^2 n */);

/* ||b - A y|| / ||b|| in the norm sqrt(r.D^-1 r), D those blocks; 0 for b = 0 and y = 0 */
double residual(const problem *p, const double *b, const double *y);

/* ||b - A y|| / || |A| |y| + |b| ||, 2-norm: a few eps where y is as good as rounding allows */
double backward_error(const problem *p, const double *b, const double *y);

/* Numbers in [-1, 1); the caller frees them. */
double *random_vector(int32_t n, uint64_t seed);

#endif
