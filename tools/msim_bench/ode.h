/* ode - the methods of a library for ordinary differential equations, in a module of their own that
 * is loaded when it is needed
 *
 *   x' = v, v' = F(x, v)/m, from x and v at t = 0 to t_end
 * with the force of the caller. */
#ifndef BENCH_ODE_H
#define BENCH_ODE_H

#include <stddef.h>
#include <stdint.h>

/* How the forces of a scene may be split into a stiff part and the others. x' = v belongs to stiff
 * springs, as they oscillate; where the damping is the stiff part it belongs to the others. */
enum { SPLIT_SPRINGS = 1, SPLIT_DAMPING = 2 };
enum { ALL_FORCES, STIFF_FORCES, OTHER_FORCES, FORCE_PARTS };

typedef struct ode_problem {
  size_t n;                      /* coordinates */
  const double *x, *v, *inverse; /* n; inverse: 1/m, 0 where nothing moves */
  double t_end;
  /* Of x and of v: errors of a step are measured as the root mean square of all coordinates, each
   * over tol times this. */
  double scales[2];
  int split; /* 0: the forces come whole */
  /* One of the parts above. 0: give up */
  int (*force)(void *data, int part, const double *x, const double *v, double *f);
  void *data;
} ode_problem;

typedef struct ode_method {
  const char *name;
  int splits;  /* those of which it needs one; 0: it takes the forces whole */
  int by_step; /* its setting is the length of its steps, s; else tol */
} ode_method;

typedef struct ode_methods {
  char library[64]; /* with its version */
  /* The i-th method, NULL past the end. */
  const ode_method *(*info)(int i);
  /* Returns a status of the library, 0 where it went well. x, v: n, where it came to. */
  int (*solve)(int i, const ode_problem *p, double setting, double *x, double *v);
} ode_methods;

/* The module's, under this name. */
#define ODE_SYMBOL "msim_bench_ode"
extern const ode_methods msim_bench_ode;

/* Load the module: NULL where it is not there, and why in reason. */
const ode_methods *ode_load(char reason[static 256]);

#endif
