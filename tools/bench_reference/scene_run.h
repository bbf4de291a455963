/* scene_run - runs a scene from its start to t_end by one method */
#ifndef BENCH_SCENE_RUN_H
#define BENCH_SCENE_RUN_H

#include "msim/msim.h"

typedef struct scene_run {
  const msim_scene *scene;
  const char *integrator;
  double t_end;
  int64_t steps; /* number of steps of equal length */
  double tol;    /* > 0: error control with this tolerance instead of steps */
  int32_t threads, collision, precision; /* options */
  double until;                          /* on the clock of clock_seconds: when to give up */
  /* May be NULL. start: another x and v; see: called at the start and about 64 times in the run. */
  const msim_state *start;
  void (*on_frame)(msim_sim *sim, void *data);
  void *data;
} scene_run;

/* Final state and cost of a run. */
typedef struct run_result {
  double *x, *v;       /* 3n */
  double seconds;      /* to create the sim, run it and read its state */
  int64_t evaluations; /* of forces */
  int refused;         /* the method does not support this scene with any step */
  char reason[1024];   /* why it failed */
} run_result;

/* Allocates the state of n particles. Returns 0 if out of memory. */
int run_result_create(int32_t n, run_result *e);
void run_result_free(run_result *e);

/* Returns 0 on failure and sets e->reason. */
int scene_run_execute(const scene_run *t, run_result *e);

/* The longest stable step of a method, s. NAN: it has none; sets err. */
double longest_step(const msim_scene *scene, const char *integrator, msim_error *err);

#endif
