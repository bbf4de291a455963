/* benches - the table of all benchmarks of msim_bench */
#ifndef BENCH_BENCHES_H
#define BENCH_BENCHES_H

#include "plot.h"
#include "report.h"
#include "bench_scenes.h"

enum { MAX_SCENES = 13 };

/* Options of a benchmark run, from the command line. */
typedef struct bench_options {
  int quick;                             /* finish within 60 s */
  int32_t threads;                       /* option of all sims; 0: chosen by the scene's size */
  int nscenes;                           /* 0: all scenes of the benchmark */
  const bench_scene *scenes[MAX_SCENES]; /* nscenes */
} bench_options;

typedef struct bench_entry {
  const char *name;
  const char *doc;
  /* Measures and prints. Returns the exit status. */
  int (*run)(const bench_options *wishes, report *r);
  const plot *picture; /* how gnuplot draws the results */
} bench_entry;

/* The i-th benchmark; NULL past the end. */
const bench_entry *bench_info(int i);

/* Whether a scene is selected; without a selection, all are. */
int is_scene_selected(const bench_options *wishes, const char *scene);

int bench_linear(const bench_options *wishes, report *r);
int bench_skip(const bench_options *wishes, report *r);
int bench_forces(const bench_options *wishes, report *r);
int bench_scaling(const bench_options *wishes, report *r);
int bench_step(const bench_options *wishes, report *r);
int bench_precision(const bench_options *wishes, report *r);
int bench_stability(const bench_options *wishes, report *r);

#endif
