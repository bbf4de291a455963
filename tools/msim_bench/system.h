/* system - the linear system of one step, as the public API has it: A dv = b */
#ifndef BENCH_SYSTEM_H
#define BENCH_SYSTEM_H

#include "scenes.h"

typedef struct linear_system {
  int32_t n, particles; /* n: unknowns */
  double h, rtol;
  msim_csr A;            /* its arrays are ours */
  double *b, *guess, *v; /* n: M v + h F(x, 0) - A v; 0; the velocity before the step */
  double size;           /* ||b||, in the norm of solver.rtol */
} linear_system;

/* Of the step of length h from a scene's state. 0 where it failed, and why in err. Call system_free
 * in any case. */
int system_make(const moving *m, double h, double rtol, linear_system *s, msim_error *err);
void system_free(linear_system *s);

/* ||b - A dv|| / ||b|| of velocities of all particles after the step. */
double system_residual(const linear_system *s, const double *v /* 3 particles */);

#endif
