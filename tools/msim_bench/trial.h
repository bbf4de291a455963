/* trial - runs a scene from its start to t_end by one method */
#ifndef BENCH_TRIAL_H
#define BENCH_TRIAL_H

#include "msim/msim.h"

typedef struct trial {
  const msim_scene *scene;
  const char *integrator;
  double t_end;
  int64_t steps;              /* number of steps of equal length */
  double tol;                 /* > 0: error control with this tolerance instead of steps */
  int32_t threads, collision; /* options */
  double until;               /* on wall_seconds' clock: when to give up */
  /* May be NULL. start: another x and v; see: called at the start and about 64 times in the run. */
  const msim_state *start;
  void (*see)(msim_sim *sim, void *data);
  void *data;
} trial;

/* Final state and cost of a run. */
typedef struct ending {
  double *x, *v;       /* 3n */
  double seconds;      /* to create the sim, run it and read its state */
  int64_t evaluations; /* of forces */
  int refused;         /* the method does not support this scene with any step */
  char reason[1024];   /* why it failed */
} ending;

/* Allocates the state of n particles. Returns 0 if out of memory. */
int ending_make(int32_t n, ending *e);
void ending_free(ending *e);

/* Returns 0 on failure and sets e->reason. */
int trial_run(const trial *t, ending *e);

/* The longest stable step of a method, s. NAN: it has none; sets err. */
double longest_step(const msim_scene *scene, const char *integrator, msim_error *err);

#endif
