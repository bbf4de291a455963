/* benches - the table of all benchmarks of msim_bench, and what they share */
#ifndef BENCH_BENCHES_H
#define BENCH_BENCHES_H

#include "bench_scenes.h"
#include "report.h"

enum { MAX_SCENES = 14, MAX_SCENE_NAME = 16, MAX_SCENE_LIST = 256, MAX_RANK_COUNTS = 8 };

/* Options of a benchmark run, from the command line. */
typedef struct bench_options {
  int quick;       /* finish within 60 s */
  int32_t threads; /* option of all sims; 0: chosen by the scene's size */
  int nscenes;     /* 0: all scenes of the benchmark */
  char scenes[MAX_SCENES][MAX_SCENE_NAME];
  int nranks;                     /* 0: those of the benchmark */
  int32_t ranks[MAX_RANK_COUNTS]; /* nranks: numbers of ranks */
} bench_options;

/* A run of a benchmark. */
typedef struct bench_run {
  const bench_options *options;
  report *report;
  double until; /* no measurement begins after it, on the clock of clock_seconds */
  double fall;  /* s, limit for advancing a scene */
} bench_run;

typedef struct bench_entry {
  const char *name, *doc;
  /* s, limits for all scenes and for advancing one of them: in a full run, with --quick */
  double seconds[2], fall[2];
  const char *scenes;  /* those it has; NULL: those of bench_scenes.h; "": without --scene */
  const char *threads; /* how many it runs with, where --threads is not for it; NULL: as told */
  int has_ranks;       /* 1: --ranks is for it */
  int (*run)(bench_run *b); /* measures and prints; returns the exit status */
} bench_entry;

/* The i-th benchmark; NULL past the end. */
const bench_entry *bench_info(int i);

/* The names of its scenes, separated by ", "; "": it takes no --scene. */
void list_scenes(const bench_entry *bench, char list[static MAX_SCENE_LIST]);

/* Whether a scene is selected; without a selection, all are. */
int is_scene_selected(const bench_options *options, const char *scene);

int bench_linear(bench_run *b);
int bench_skip(bench_run *b);
int bench_forces(bench_run *b);
int bench_scaling(bench_run *b);
int bench_step(bench_run *b);
int bench_precision(bench_run *b);
int bench_stability(bench_run *b);
int bench_distributed(bench_run *b);

#endif
