/* system - the linear system of one step, as the public API tells it: A v' = b */
#ifndef BENCH_SYSTEM_H
#define BENCH_SYSTEM_H

#include "scenes.h"

typedef struct linear_system {
  int32_t n; /* unknowns */
  double h, rtol;
  msim_csr A;        /* its arrays are ours */
  double *b, *guess; /* n: M v + h F(x, 0); v */
  double size;       /* ||b|| */
} linear_system;

/* Of the step of length h from a scene's state. 0 where it failed, and why in err. Call system_free
 * in any case. */
int system_make(const moving *m, double h, double rtol, linear_system *s, msim_error *err);
void system_free(linear_system *s);

/* ||b - A v|| / ||b|| of velocities of all particles. */
double system_residual(const linear_system *s, const double *v /* 3 particles */);

#endif
