/* distributed - declarations shared by the parts of the benchmark `distributed` */
#ifndef BENCH_DISTRIBUTED_H
#define BENCH_DISTRIBUTED_H

#include "benches.h"
#include "rank_run.h"

/* A scene and the steps that are made in it: explicit ones of velocity-verlet, or linearly implicit
 * ones. */
typedef struct distributed_case {
  bench_scene scene;
  int implicit;
  int steps; /* in a sample */
} distributed_case;

typedef struct distributed_bench {
  const bench_run *run;
  const struct distributed_plan *plan;
  msim_comm *processes; /* of mpirun; NULL: ranks are threads */
  int nranks;
  int32_t ranks[MAX_RANK_COUNTS];
  /* For the model, indices 1 for solids, 0 for cloths; NAN: not measured */
  double explicit_seconds[2]; /* a particle and step of one process */
  double iteration_seconds;   /* a particle and iteration, cloth */
  double collectives;         /* an iteration */
  double bytes[2];            /* a particle of one process, explicit and implicit */
  double shared_bytes;        /* a particle of the scene, on each further rank */
  /* What the summary has: the worst of all cases */
  struct {
    double speedup_2[2], one_rank[2]; /* explicit and implicit */
    double speedup_independent;       /* of explicit steps of two halves that do not communicate */
    double over_alone;
  } worst;
} distributed_bench;

/* The scene of a case in motion, or displaced at random for explicit steps. Returns 0 on failure
 * and sets m->err. Call moving_scene_free in any case. */
int distributed_scene_create(const distributed_bench *b, const distributed_case *c,
                             moving_scene *m);

/* The run of a case on so many ranks, to be created */
rank_run distributed_run(const distributed_bench *b, const distributed_case *c,
                         const moving_scene *m, int32_t ranks);

/* What parts of a scene cost: messages, balance, iterations, memory; rows and keys */
void measure_parts(distributed_bench *b);
void measure_memory(distributed_bench *b);

/* The model's table: rows */
void report_model(const distributed_bench *b);

#endif
