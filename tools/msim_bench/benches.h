/* benches - what msim_bench can measure */
#ifndef BENCH_BENCHES_H
#define BENCH_BENCHES_H

#include "picture.h"
#include "report.h"
#include "scenes.h"

enum { MOST_SCENES = 13 };

/* What the command line asks of a bench. */
typedef struct bench_wishes {
  int quick;                              /* end within 60 s */
  int32_t threads;                        /* option of all sims; 0: by size */
  int nscenes;                            /* 0: all that the bench has in mind */
  const bench_scene *scenes[MOST_SCENES]; /* nscenes */
} bench_wishes;

typedef struct bench_entry {
  const char *name;
  const char *doc;
  /* Measure and print. Returns the exit status. */
  int (*run)(const bench_wishes *wishes, report *r);
  const picture *picture; /* of what it found */
} bench_entry;

/* The i-th bench, NULL past the end. */
const bench_entry *bench_info(int i);

/* Whether a scene is among those that are asked for. */
int is_wanted(const bench_wishes *wishes, const char *scene);

int bench_linear(const bench_wishes *wishes, report *r);
int bench_skip(const bench_wishes *wishes, report *r);
int bench_forces(const bench_wishes *wishes, report *r);
int bench_scaling(const bench_wishes *wishes, report *r);
int bench_step(const bench_wishes *wishes, report *r);
int bench_precision(const bench_wishes *wishes, report *r);
int bench_stability(const bench_wishes *wishes, report *r);

#endif
