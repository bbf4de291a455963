/* ode_forces - the forces for the methods of another library: by msim_sim_force on interleaved
 * arrays, or by the loop of spring_runs.h on arrays by components, whichever is faster in this
 * scene */
#ifndef BENCH_ODE_FORCES_H
#define BENCH_ODE_FORCES_H

#include "force_split.h"

typedef struct ode_forces {
  msim_scene_view view;
  msim_sim *sim; /* computes forces */
  spring_runs runs;
  force_split split;       /* arrays by components */
  int by_runs;             /* 1: the loop; always so if these forces are split */
  double *x, *v, *inverse; /* initial state and 1/m, in the layout in use */
  /* Times in s, the minimum of 5: forces by msim_sim_force and by the loop; creating a sim; a step
   * of velocity Verlet, which takes one evaluation. */
  double flat_s, runs_s, create_s, step_s;
  double stiff_s, others_s; /* of split forces; NAN: not split */
  double difference;        /* of both implementations, over the largest force */
  double split_difference;  /* of the forces and the sum of their parts, likewise */
} ode_forces;

/* The implementations are timed and compared in the state x, v, where springs are strained.
 * split_by, stiff: as for force_split_create; h: a stable step. Returns 0 if out of memory. Call
 * ode_forces_free in any case. */
int ode_forces_create(const msim_scene *scene, msim_sim *sim, int split_by, double stiff,
                      const double *x, const double *v, double h, ode_forces *k);
void ode_forces_free(ode_forces *k);

/* part: ALL_FORCES, STIFF_FORCES or OTHER_FORCES */
void ode_forces_evaluate(const ode_forces *k, int part, const double *x, const double *v,
                         double *f);

/* Converts from the layout in use to x0 y0 z0 x1 ... */
void ode_forces_interleave(const ode_forces *k, const double *from, double *to);

#endif
