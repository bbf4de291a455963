/* entrants - who takes part in the bench `precision`, and by which settings, fixed beforehand
 *
 * Methods of msim at fixed steps: h = L, L/2, L/4, ... from their longest stable step L on, or from
 * 64 times that of Verlet where they have none; MRIStep of SUNDIALS likewise, by its slow steps.
 * Under error control, and other methods of SUNDIALS: tol = 1e-1, 1e-2, ... */
#ifndef BENCH_ENTRANTS_H
#define BENCH_ENTRANTS_H

#include "kernel.h"
#include "ode.h"

enum { MOST_ENTRANTS = 64, MOST_RUNGS = 24 };

typedef struct entrant {
  char name[32];
  const char *integrator; /* msim's; NULL: a method of the library below */
  int ode;                /* its number there */
  int by_tol;
  int32_t collision;
  double first, ratio; /* the first setting, h in s or tol; of each to the one before */
} entrant;

typedef struct entrants {
  int count;
  entrant all[MOST_ENTRANTS];
} entrants;

/* All that fit the scene. split_by: how its forces are split, 0: not at all; ode: nullable. */
void entrants_collect(const truth *t, int split_by, const ode_methods *ode, entrants *list);

/* NULL: it does not take part. */
#define AUTO_BY_TOL "auto, tol"
const entrant *entrants_find(const entrants *list, const char *name);

/* One run by one setting. 0 where it failed, and why in e->reason. */
typedef struct arena {
  const truth *truth;
  const kernel *kernel;   /* what the library gets */
  const ode_methods *ode; /* nullable */
  int32_t threads;
} arena;

int entrant_run(const arena *a, const entrant *who, double setting, double until, ending *e);

#endif
