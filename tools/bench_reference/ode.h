/* ode - interface to the integrators of another library, in a module that is loaded on demand
 *
 *   x' = v, v' = F(x, v)/m, from x and v at t = 0 to t_end
 * where the caller supplies the force F. */
#ifndef BENCH_ODE_H
#define BENCH_ODE_H

#include <stddef.h>
#include <stdint.h>

/* How the forces of a scene are split into a stiff part and the others. x' = v belongs to the stiff
 * part if that consists of springs, which oscillate, and to the others if it is the damping. */
enum { SPLIT_SPRINGS = 1, SPLIT_DAMPING = 2 };
enum { ALL_FORCES, STIFF_FORCES, OTHER_FORCES, FORCE_PARTS };

typedef struct ode_problem {
  size_t n;                      /* number of coordinates */
  const double *x, *v, *inverse; /* n; inverse: 1/m, 0 for pinned particles */
  double t_end;
  /* Of x and of v. The norm of a step's error is the root mean square over all coordinates, each
   * divided by tol times its scale. */
  double scales[2];
  int split; /* SPLIT_*; 0: only ALL_FORCES is called */
  /* Computes one of the parts above. Returns 0 to abort. */
  int (*force)(void *data, int part, const double *x, const double *v, double *f);
  void *data;
} ode_problem;

typedef struct ode_method {
  const char *name;
  int split_mask; /* the SPLIT_* of which it needs one; 0: it uses ALL_FORCES */
  int by_step;    /* 1: its setting is the step length, s; 0: tol */
} ode_method;

typedef struct ode_methods {
  char library[64]; /* name and version */
  /* The i-th method; NULL past the end. */
  const ode_method *(*info)(int i);
  /* Returns the library's status, 0 for success. x, v: n, the final state. */
  int (*solve)(int i, const ode_problem *p, double setting, double *x, double *v);
} ode_methods;

/* The symbol that the module exports. */
#define ODE_SYMBOL "msim_bench_ode"
extern const ode_methods msim_bench_ode;

#endif
