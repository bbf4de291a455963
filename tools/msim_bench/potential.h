/* potential - the step as a minimisation, in the order of the prefactored matrix
 *
 *   P(x') = 1/2 (x' - y)' M (x' - y) + h^2 E(x'),  y = x + h v + h^2 g,  v' = (x' - x)/h
 * E of the springs; grad P = 0 is the equation of the step (Martin et al. 2011). */
#ifndef BENCH_POTENTIAL_H
#define BENCH_POTENTIAL_H

#include "laplacian.h"
#include "nonlinear.h"

typedef struct potential {
  const nonlinear_step *step;
  const laplacian *matrix;
  int32_t n, nsprings, npinned;
  double *mass, *y; /* n; 3n: where it begins */
  int32_t *pinned;  /* their places */
  struct link {
    int32_t i, j;
    double k, rest; /* k: h^2 of it */
  } * springs;
  double *v; /* 3n: room for potential_velocity */
} potential;

/* 0 where there is no memory. Call potential_free in any case. */
int potential_make(const nonlinear_step *s, const laplacian *L, potential *p);
void potential_free(potential *p);

/* P and its gradient, in one loop over the springs. */
double potential_at(const potential *p, const double *x, double *gradient);

/* The velocity that leads there, in the order of the scene; lent. */
const double *potential_velocity(const potential *p, const double *x);

#endif
