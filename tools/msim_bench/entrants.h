/* entrants - the methods in the benchmark `precision` and their settings, fixed in advance
 *
 * Fixed steps: h = L, L/2, L/4, ... from the longest stable step L on, or from 64 times that of
 * Verlet for methods without a limit; MRIStep of SUNDIALS likewise, for its slow steps. Error
 * control, and the other methods of SUNDIALS: tol = 1e-1, 1e-2, ... */
#ifndef BENCH_ENTRANTS_H
#define BENCH_ENTRANTS_H

#include "kernel.h"
#include "ode.h"

enum { MOST_ENTRANTS = 64, MOST_RUNGS = 24 };

typedef struct entrant {
  char name[32];
  const char *integrator; /* of msim; NULL: a method of the other library */
  int ode;                /* its number there, see ode.h */
  int by_tol;
  int32_t collision;
  double first, ratio; /* first setting (h in s, or tol); ratio of successive settings */
} entrant;

typedef struct entrants {
  int count;
  entrant all[MOST_ENTRANTS];
} entrants;

/* Collects the methods that suit the scene. split_by: SPLIT_* if its forces are split, else 0; ode:
 * may be NULL. */
void entrants_collect(const truth *t, int split_by, const ode_methods *ode, entrants *list);

/* Returns NULL if there is none. */
#define AUTO_BY_TOL "auto, tol"
const entrant *entrants_find(const entrants *list, const char *name);

/* One run with one setting. Returns 0 on failure and sets e->reason. */
typedef struct arena {
  const truth *truth;
  const kernel *kernel;   /* forces for the other library */
  const ode_methods *ode; /* may be NULL */
  int32_t threads;
} arena;

int entrant_run(const arena *a, const entrant *who, double setting, double until, ending *e);

#endif
