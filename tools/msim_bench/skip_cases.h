/* skip_cases - scenes that do not need some feature, for the benchmark `skip` */
#ifndef BENCH_SKIP_CASES_H
#define BENCH_SKIP_CASES_H

#include "msim/msim.h"

typedef struct skip_case {
  const char *name;  /* in the rows */
  const char *key;   /* in the summary; NULL: none */
  const char *scene; /* description to print */
  const char *integrator;
  double h;
  int series;  /* steps in a sample, from the scene's state; 0: samples continue from each other, as
                 is possible for scenes at rest and explicit steps */
  unsigned is; /* properties of the scene, see the .c file */
  double gravity;             /* along z, m/s^2 */
  const char *off, *also_off; /* options that disable the skip, or NAME=VALUE; NULL: none */
} skip_case;

/* The i-th case; NULL past the end. */
const skip_case *skip_case_info(int i);

/* Builds the scene. without: such that the feature must be computed. */
msim_status skip_case_build(const skip_case *what, int without, msim_scene *scene, msim_error *err);

#endif
