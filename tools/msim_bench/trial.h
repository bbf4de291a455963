/* trial - one scene from its start to the end of the time that is looked at, by one method */
#ifndef BENCH_TRIAL_H
#define BENCH_TRIAL_H

#include "msim/msim.h"

typedef struct trial {
  const msim_scene *scene;
  const char *integrator;
  double t_end;
  int64_t steps;              /* of equal length */
  double tol;                 /* > 0: instead of them, steps that error control chooses */
  int32_t threads, collision; /* options */
  double until;               /* on wall_seconds' clock: when to give up */
  /* Nullable: start, another x and v; see, called at 64 times of the run and at its start. */
  const msim_state *start;
  void (*see)(msim_sim *sim, void *data);
  void *data;
} trial;

/* Where it came to. */
typedef struct ending {
  double *x, *v;       /* 3n: room for the state */
  double seconds;      /* making the sim, running it and reading its state */
  int64_t evaluations; /* of forces */
  int refused;         /* the method does not take this scene, whatever its steps */
  char reason[1024];   /* where it failed */
} ending;

/* Room for a scene of n particles; 0: there is no memory. */
int ending_make(int32_t n, ending *e);
void ending_free(ending *e);

/* 0 where it failed. */
int trial_run(const trial *t, ending *e);

/* The longest stable step of a method, s. NAN: it has none, and why in err. */
double longest_step(const msim_scene *scene, const char *integrator, msim_error *err);

#endif
