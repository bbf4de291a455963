/* linear_system - the linear system A dv = b of one step, from the public API */
#ifndef BENCH_LINEAR_SYSTEM_H
#define BENCH_LINEAR_SYSTEM_H

#include "bench_scenes.h"

typedef struct linear_system {
  int32_t n, particles; /* n: number of unknowns */
  double h, rtol;
  msim_sim *sim; /* owns the arrays of A */
  msim_csr A;
  double *b, *v; /* n: M v + h F(x, 0) - A v; the velocity before the step */
  double size;   /* ||b||, in the norm of solver.rtol */
} linear_system;

/* The system of the step of length h from a scene's state. Returns 0 on failure and sets err. Call
 * linear_system_free in any case. */
int linear_system_create(const moving_scene *m, double h, double rtol, linear_system *s,
                         msim_error *err);
void linear_system_free(linear_system *s);

/* ||b - A dv|| / ||b|| for v, the velocities of all particles after the step. */
double linear_system_residual(const linear_system *s, const double *v /* 3 * particles */);

#endif
