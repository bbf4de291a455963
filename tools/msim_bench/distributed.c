/* distributed - benchmark of steps on several ranks: strong and weak scaling, communication, and
 * memory, with a model of many ranks from what was measured */
#include "distributed.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../common/interrupt.h"
#include "../common/message.h"
#include "../common/mpirun.h"
#include "cases.h"

enum { MOST_CANDIDATES = MAX_RANK_COUNTS + 2 }; /* alone, and PETSc or halves */
#define EXPLICIT_STEP 1e-6                      /* s: stable in all scenes */

typedef struct distributed_plan {
  distributed_case strong[6]; /* up to one of 0 steps */
  distributed_case weak[2];   /* on one rank; those of n ranks are n times as large */
  int rounds;
} distributed_plan;

#define CLOTH(side) \
  { "cloth" #side, side, 0, 0 }
#define JELLY(side) \
  { "jelly" #side, side, 1, 0 }

static const distributed_plan plans[] = {
    {.strong = {{CLOTH(500), 0, 20},
                {JELLY(44), 0, 20},
                {CLOTH(200), 1, 2},
                {CLOTH(300), 1, 2},
                {JELLY(24), 1, 4}},
     .weak = {{CLOTH(250), 0, 40}, {CLOTH(100), 1, 4}},
     .rounds = 9},
    {.strong = {{CLOTH(100), 0, 20}, {JELLY(16), 0, 20}, {CLOTH(48), 1, 2}, {JELLY(12), 1, 2}},
     .weak = {{CLOTH(64), 0, 20}, {CLOTH(24), 1, 2}},
     .rounds = 3},
};

/*------------------------------------- scenes and runs ------------------------------------------*/

int distributed_scene_create(const distributed_bench *b, const distributed_case *c,
                             moving_scene *m) {
  if (!c->implicit) return moving_scene_create_perturbed(&c->scene, SOFT, m);
  return moving_scene_create(&c->scene, SOFT, b->processes ? 1 : 0, INFINITY, INFINITY, m);
}

rank_run distributed_run(const distributed_bench *b, const distributed_case *c,
                         const moving_scene *m, int32_t ranks) {
  rank_run r = {.scene = m->scene,
                .start = &m->state,
                .options = implicit_options(MAIN_STEP, 1e-6, "pcg", 1),
                .steps = c->steps,
                .n = ranks,
                .processes = b->processes};
  if (c->implicit) return r;
  r.options.integrator = "velocity-verlet";
  r.options.h = EXPLICIT_STEP;
  return r;
}

/*------------------------------------- candidates -----------------------------------------------*/

/* Runs that alternate */
typedef struct rank_comparison {
  int count;
  rank_run runs[MOST_CANDIDATES];
  timing_candidate all[MOST_CANDIDATES];
} rank_comparison;

static void add_rank_run(rank_comparison *r, const char *name, const rank_run *run) {
  msim_error err;
  timing_candidate *c = &r->all[r->count];
  r->runs[r->count] = *run;
  candidate_init(c, name, "step", rank_run_sample, &r->runs[r->count]);
  c->failed = !rank_run_create(&r->runs[r->count++], &err);
  if (c->failed) candidate_fail(c, err.text);
}

static void add_ranks(rank_comparison *r, const distributed_bench *b, const distributed_case *c,
                      const moving_scene *m, int32_t ranks) {
  const rank_run run = distributed_run(b, c, m, ranks);
  char name[32];
  snprintf(name, sizeof name, ranks == ALONE ? "alone" : "%d rank%s", (int)ranks,
           ranks == 1 ? "" : "s");
  add_rank_run(r, name, &run);
}

static void time_comparison(const distributed_bench *b, rank_comparison *r) {
  const timing_limits p = {.max_rounds = b->plan->rounds,
                           .min_rounds = b->plan->rounds,
                           .budget = INFINITY,
                           .until = INFINITY}; /* the same on all processes */
  time_in_turn(r->all, r->count, &p);
}

static void free_comparison(rank_comparison *r) {
  for (int i = 0; i < r->count; i++) rank_run_free(&r->runs[i]);
  free(r);
}

static double iterations_of_run(const timing_candidate *c) {
  return c->nsamples > 0 ? (double)c->samples[c->nsamples - 1].iterations : NAN;
}

/* The median of the ratios; NAN: there is none. */
static double over(const timing_candidate *a, const timing_candidate *b) {
  return has_result(a) && has_result(b) ? median_ratio(a, whole_seconds, b, whole_seconds) : NAN;
}

/*------------------------------------- rows -----------------------------------------------------*/

static const column columns[] = {{"", "contestant", -12, NULL, 0},
                                 {"ms", "ms", 9, "%.4g", 0},
                                 {"+-", "spread", 4, "%.0f%%", 100},
                                 {"speedup", "speedup", 7, "%.3g", 0},
                                 {"efficiency", "efficiency", 10, "%.3g", 0},
                                 {"iterations", "iterations", 10, "%.4g", 0},
                                 {"exchanges", "exchanges", 9, "%.4g", 0},
                                 {"collectives", "collectives", 11, "%.4g", 0},
                                 {"bytes", "bytes", 9, "%.4g", 0},
                                 {.key = NULL}};

/* ratio: of the time of the first candidate over its own */
static json_t *report_run(const distributed_bench *b, const char *measure, const moving_scene *m,
                          const distributed_case *c, const timing_candidate *t, const char *key,
                          double ratio) {
  const rank_run *run = t->data;
  const comm_counts counts = rank_run_counts(run);
  json_t *row = report_add_row(
      b->run->report, measure,
      FIELDS(TEXT("scene", m->kind->name), TEXT("method", c->implicit ? "implicit" : "explicit"),
             TEXT("contestant", t->name), INTEGER("ranks", run->n > 0 ? run->n : 1),
             TEXT("solver", c->implicit ? run->options.solver : NULL),
             INTEGER("particles", m->view.nparticles), REAL("t", m->state.t)));
  put_result(row, t, "ms", 1e3);
  if (has_result(t)) {
    put_fields(row, FIELDS(REAL(key, ratio),
                           REAL("iterations", c->implicit ? iterations_of_run(t) : NAN)));
    if (counts.exchanges)
      put_fields(row, FIELDS(REAL("exchanges", (double)counts.exchanges / c->steps),
                             REAL("collectives", (double)counts.collectives / c->steps),
                             REAL("bytes", (double)counts.bytes / (double)counts.exchanges)));
  }
  print_row(columns, row);
  return row;
}

static void print_case(const char *words, const distributed_case *c, const moving_scene *m) {
  printf("\n%s, %s steps, %d particles\n", words, c->implicit ? "implicit" : "explicit",
         (int)m->view.nparticles);
  print_titles(columns);
}

/*------------------------------------- strong scaling -------------------------------------------*/

static void keep_constants(distributed_bench *b, const distributed_case *c, const moving_scene *m,
                           const timing_candidate *alone, const timing_candidate *t) {
  const comm_counts counts = rank_run_counts(t->data);
  const double n = m->view.nparticles, iterations = iterations_of_run(t);
  if (!c->implicit) b->explicit_seconds[c->scene.solid] = median_of(alone, whole_seconds) / n;
  if (!c->implicit || c->scene.solid) return;
  b->iteration_seconds = median_of(alone, solve_per_iteration) / n;
  if (counts.exchanges) b->collectives = (double)counts.collectives / c->steps / iterations;
}

static void report_ranks(distributed_bench *b, const distributed_case *c, const moving_scene *m,
                         const timing_candidate *alone, const timing_candidate *t) {
  const int32_t n = ((const rank_run *)t->data)->n;
  const double speedup = over(alone, t);
  json_t *row = report_run(b, "strong", m, c, t, "speedup", speedup);
  if (!isfinite(speedup)) return;
  double *one = &b->worst.one_rank[c->implicit], *two = &b->worst.speedup_2[c->implicit];
  if (n == 1) *one = fmax(*one, 1 / speedup);
  if (n == 2) *two = fmin(*two, speedup); /* fmin and fmax ignore NAN */
  if (n > 1) keep_constants(b, c, m, alone, t);
  if (n == 1 || !c->implicit) return;
  const double iterations = iterations_of_run(t) / iterations_of_run(alone);
  put_fields(row, FIELDS(REAL("iterations_over_alone", iterations)));
  if (n <= 4) b->worst.over_alone = fmax(b->worst.over_alone, iterations);
}

static int has_ranks(const distributed_bench *b, int32_t low, int32_t high) {
  for (int i = 0; i < b->nranks; i++)
    if (b->ranks[i] >= low && b->ranks[i] <= high) return 1;
  return 0;
}

/* PETSc's own conjugate gradients and multigrid on the same ranks */
static timing_candidate *add_petsc(const distributed_bench *b, const distributed_case *c,
                                   const moving_scene *m, rank_comparison *r) {
  rank_run run = distributed_run(b, c, m, b->ranks[0]);
  run.options.solver = "petsc";
  run.options.solver_options = "-ksp_type cg -pc_type gamg";
  add_rank_run(r, "petsc gamg", &run);
  return &r->all[r->count - 1];
}

static void report_petsc(const distributed_bench *b, const distributed_case *c,
                         const moving_scene *m, const rank_comparison *r,
                         const timing_candidate *petsc) {
  const timing_candidate *ours = petsc - 1;
  char key[64];
  report_run(b, "strong", m, c, petsc, "speedup", over(&r->all[0], petsc));
  snprintf(key, sizeof key, "petsc_gamg_over_msim_%s", c->scene.name);
  report_key(b->run->report, key, over(petsc, ours));
}

/* Two scenes half as large, one on each of two threads, which share the memory bus alone: what two
 * ranks could reach. half: to be freed; NULL: not created */
static timing_candidate *add_halves(const distributed_bench *b, const distributed_case *c,
                                    rank_comparison *r, moving_scene *half) {
  distributed_case smaller = *c;
  smaller.scene.side = (int32_t)lround(c->scene.side / (c->scene.solid ? cbrt(2) : sqrt(2)));
  if (!distributed_scene_create(b, &smaller, half)) return NULL;
  rank_run run = distributed_run(b, c, half, 2);
  run.independent = 1;
  add_rank_run(r, "two halves", &run);
  return &r->all[r->count - 1];
}

static void report_halves(distributed_bench *b, const distributed_case *c, const moving_scene *m,
                          const moving_scene *half, const timing_candidate *alone,
                          const timing_candidate *t) {
  const double speedup = over(alone, t) * 2 * half->view.nparticles / (double)m->view.nparticles;
  report_run(b, "halves", half, c, t, "speedup", speedup);
  b->worst.speedup_independent = fmin(b->worst.speedup_independent, speedup);
}

static void measure_strong(distributed_bench *b, const distributed_case *c) {
  moving_scene m, half = {0};
  rank_comparison *r = calloc(1, sizeof *r);
  timing_candidate *petsc = NULL, *halves = NULL;
  if (r && distributed_scene_create(b, c, &m)) {
    print_case(c->scene.name, c, &m);
    add_ranks(r, b, c, &m, ALONE);
    for (int i = 0; i < b->nranks; i++) add_ranks(r, b, c, &m, b->ranks[i]);
    if (b->processes && c->implicit) petsc = add_petsc(b, c, &m, r);
    if (!b->processes && !c->implicit && has_ranks(b, 2, 2)) halves = add_halves(b, c, r, &half);
    time_comparison(b, r);
    if (!is_interrupted()) {
      report_run(b, "strong", &m, c, &r->all[0], "speedup", NAN);
      for (int i = 0; i < b->nranks; i++) report_ranks(b, c, &m, &r->all[0], &r->all[1 + i]);
      if (petsc) report_petsc(b, c, &m, r, petsc);
      if (halves) report_halves(b, c, &m, &half, &r->all[0], halves);
    }
    fflush(stdout);
  }
  if (r) free_comparison(r);
  moving_scene_free(&half);
  moving_scene_free(&m);
}

/*------------------------------------- weak scaling ---------------------------------------------*/

static distributed_case enlarged(const distributed_case *c, int32_t ranks, char name[static 32]) {
  distributed_case large = *c;
  large.scene.side = (int32_t)lround(c->scene.side * sqrt(ranks));
  snprintf(name, 32, "cloth%d", (int)large.scene.side);
  large.scene.name = name;
  return large;
}

static void report_weak(const distributed_bench *b, const distributed_case *c,
                        const moving_scene *scenes, const rank_comparison *r) {
  print_case("weak scaling", c, &scenes[0]);
  for (int i = 0; i < r->count; i++) {
    const int32_t n = r->runs[i].n;
    const double larger = (double)scenes[i].view.nparticles / scenes[0].view.nparticles;
    report_run(b, "weak", &scenes[i], c, &r->all[i], "efficiency",
               over(&r->all[0], &r->all[i]) * larger * r->runs[0].n / n);
  }
  fflush(stdout);
}

static void measure_weak(const distributed_bench *b, const distributed_case *c) {
  moving_scene scenes[MAX_RANK_COUNTS] = {{0}};
  char names[MAX_RANK_COUNTS][32];
  distributed_case cases[MAX_RANK_COUNTS];
  rank_comparison *r = calloc(1, sizeof *r);
  int made = r != NULL;
  for (int i = 0; i < b->nranks && made; i++) {
    cases[i] = enlarged(c, b->ranks[i], names[i]);
    made = distributed_scene_create(b, &cases[i], &scenes[i]);
    if (made) add_ranks(r, b, &cases[i], &scenes[i], b->ranks[i]);
  }
  if (made) time_comparison(b, r);
  if (made && !is_interrupted()) report_weak(b, c, scenes, r);
  if (r) free_comparison(r);
  for (int i = 0; i < b->nranks; i++) moving_scene_free(&scenes[i]);
}

/*------------------------------------- the benchmark --------------------------------------------*/

/* Where mpirun has started several processes, these are the ranks. Returns 0 on failure. */
static int open_processes(distributed_bench *b) {
  msim_error err;
  if (!mpirun_may_be_several()) return 1;
  if (msim_comm_open("mpi", NULL, NULL, &b->processes, &err)) {
    report_error("%s", err.text);
    return 0;
  }
  b->nranks = 1;
  b->ranks[0] = b->processes->nranks;
  return 1;
}

static void choose_ranks(distributed_bench *b) {
  static const int32_t usual[] = {1, 2, 4};
  const bench_options *w = b->run->options;
  b->nranks = w->nranks ? w->nranks : 3;
  memcpy(b->ranks, w->nranks ? w->ranks : usual, (size_t)b->nranks * sizeof *b->ranks);
}

static void report_keys(const distributed_bench *b) {
  report *r = b->run->report;
  if (has_ranks(b, 2, 2)) {
    report_key(r, "explicit_speedup_2", b->worst.speedup_2[0]);
    if (!b->processes)
      report_key(r, "explicit_speedup_2_independent", b->worst.speedup_independent);
    report_key(r, "implicit_step_speedup_2", b->worst.speedup_2[1]);
  }
  if (has_ranks(b, 1, 1)) {
    report_key(r, "one_rank_over_alone_explicit", b->worst.one_rank[0]);
    report_key(r, "one_rank_over_alone_implicit", b->worst.one_rank[1]);
  }
  if (has_ranks(b, 2, 4)) report_key(r, "iterations_over_alone", b->worst.over_alone);
}

int bench_distributed(bench_run *run) {
  distributed_bench b = {.run = run,
                         .plan = &plans[run->options->quick],
                         .explicit_seconds = {NAN, NAN},
                         .iteration_seconds = NAN,
                         .collectives = NAN,
                         .bytes = {NAN, NAN},
                         .shared_bytes = NAN,
                         .worst = {{NAN, NAN}, {NAN, NAN}, NAN, NAN}};
  choose_ranks(&b);
  if (!open_processes(&b)) return EXIT_ERROR;
  for (const distributed_case *c = b.plan->strong; c->steps && !is_interrupted(); c++)
    measure_strong(&b, c);
  report_keys(&b);
  for (int i = 0; i < 2 && !b.processes && !is_interrupted(); i++)
    measure_weak(&b, &b.plan->weak[i]);
  if (!b.processes && !is_interrupted()) {
    measure_parts(&b);
    measure_memory(&b);
    report_model(&b);
  }
  msim_comm_close(b.processes);
  return EXIT_OK;
}
