/* potential - an implicit Euler step as a minimization, in the order of the prefactored matrix
 *
 *   P(x') = 1/2 (x' - y)' M (x' - y) + h^2 E(x'),  y = x + h v + h^2 g,  v' = (x' - x)/h
 * E is the energy of the springs; grad P = 0 is the equation of the step (Martin et al. 2011). */
#ifndef BENCH_POTENTIAL_H
#define BENCH_POTENTIAL_H

#include "laplacian.h"

typedef struct potential {
  const msim_scene_view *scene;
  const double *x; /* at the start of the step, in the order of the scene */
  double h;
  const laplacian *matrix;
  int32_t n, nsprings, npinned;
  double *mass, *y; /* n; 3n: the inertial position */
  int32_t *pinned;  /* positions in the order of the matrix */
  struct placed_spring {
    int32_t i, j;
    double k, rest; /* k: multiplied by h^2 */
  } * springs;
  double *v; /* 3n: result of potential_velocity */
} potential;

/* The step of length h from x, v, which must outlive p. Returns 0 if out of memory. Call
 * potential_free in any case. */
int potential_make(const msim_scene_view *s, const double *x, const double *v, double h,
                   const laplacian *L, potential *p);
void potential_free(potential *p);

/* Computes P and its gradient, in one loop over the springs. */
double potential_at(const potential *p, const double *x, double *gradient);

/* The velocity v' of x' = x, in the order of the scene; valid until the next call. */
const double *potential_velocity(const potential *p, const double *x);

#endif
