/* descent - what minimises the potential of a step with the prefactored matrix as its only one */
#ifndef BENCH_DESCENT_H
#define BENCH_DESCENT_H

#include "potential.h"
#include "pursuit.h"

enum { PAIRS = 8 }; /* that L-BFGS remembers */

typedef struct descent descent;

typedef struct descent_method {
  const char *name;
  /* From x = y on. */
  void (*begin)(descent *d);
  /* Returns whether there is a next x. */
  int (*iterate)(descent *d);
} descent_method;

extern const descent_method projective_dynamics, lbfgs;

/* Vectors are those of the potential, 3n. */
struct descent {
  const descent_method *method;
  const potential *p;
  size_t length;
  double *x, *gradient, *direction, *next;
  double value;                        /* P(x) */
  double *s[PAIRS + 1], *y[PAIRS + 1]; /* changes of x and gradient, the next pair among them */
  double curvature[PAIRS + 1];         /* y.s */
  int64_t pairs;                       /* made so far */
  double *all;                         /* memory of the vectors */
  pursuit pursuit;
};

/* 0 where there is no memory. Call descent_free in any case. */
int descent_make(const descent_method *method, const potential *p, descent *d);
void descent_free(descent *d);

/* Run until all accuracies are reached, or as long as is allowed; the seconds are those of the
 * method itself. */
void descent_pursue(descent *d, const allowance *allowed);

/* So many iterations from the start, in seconds. */
double descent_repeat(descent *d, int64_t iterations);

#endif
