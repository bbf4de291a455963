/* prefactored_descent - minimizes the potential of an implicit step by methods whose only matrix is
 * the prefactored one */
#ifndef BENCH_PREFACTORED_DESCENT_H
#define BENCH_PREFACTORED_DESCENT_H

#include "potential.h"

enum { PAIRS = 8 }; /* pairs (s, y) that L-BFGS stores */

typedef struct descent descent;

typedef struct descent_method {
  const char *name;
  /* Starts from x = y, the inertial position. */
  void (*begin)(descent *d);
  /* Returns 0 if no next x was found. */
  int (*iterate)(descent *d);
} descent_method;

extern const descent_method projective_dynamics, lbfgs;

/* All vectors have the layout of the potential, 3n. */
struct descent {
  const descent_method *method;
  const potential *p;
  size_t length;
  double *x, *gradient, *direction, *next;
  double value;                        /* P(x) */
  double *s[PAIRS + 1], *y[PAIRS + 1]; /* changes of x and of the gradient, with one spare pair */
  double curvature[PAIRS + 1];         /* y.s */
  int64_t pairs;                       /* so far */
  double *all;                         /* memory of all vectors */
};

/* Returns 0 if out of memory. Call descent_free in any case. */
int descent_make(const descent_method *method, const potential *p, descent *d);
void descent_free(descent *d);

#endif
