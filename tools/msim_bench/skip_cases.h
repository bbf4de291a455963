/* skip_cases - scenes that do not need something, for the bench `skip` */
#ifndef BENCH_SKIP_CASES_H
#define BENCH_SKIP_CASES_H

#include "msim/msim.h"

enum { MOST_OFF = 2 };

typedef struct skip_case {
  const char *name;  /* of the rows */
  const char *key;   /* of the summary; NULL: it has none */
  const char *scene; /* for people */
  const char *integrator;
  double h;
  const char *off[MOST_OFF]; /* the options that switch the skip off */
  /* The scene: with what is skipped, or with what must be done without the skip. */
  msim_status (*build)(int without, msim_scene *scene, msim_error *err);
  int series; /* steps in a sample, from the scene's state on; 0: samples go on from each other, as
                 scenes at rest and explicit steps may */
} skip_case;

/* The i-th, NULL past the end. */
const skip_case *skip_case_info(int i);

#endif
