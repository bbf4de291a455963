/* forces - benchmark of explicit steps against a textbook implementation and the memory
 * bandwidth */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../common/clock.h"
#include "../common/message.h"
#include "benches.h"
#include "interrupt.h"
#include "background_load.h"
#include "../bench_reference/textbook.h"
#include "timing.h"
#include "../bench_reference/triad.h"

enum { STIFFNESS = 1000, MOST_ARMS = 5 };
#define STEP 1e-6 /* s: stable in all scenes */

/* The candidates that alternate on one scene. A sample is `steps` steps, or passes of the triad,
 * which transfers as many bytes as a step must. */
typedef struct forces_context {
  moving_scene m;
  msim_sim *sims[2]; /* with one thread and with two */
  textbook book;
  triad memory;
  double bytes; /* transferred in a step */
  int steps;
  int count;
  timing_candidate all[MOST_ARMS];
  struct forces_candidate {
    struct forces_context *arena;
    int threads;
  } arms[MOST_ARMS];
} forces_context;

/*------------------------------------- contestants ----------------------------------------------*/

static int run_explicit_steps(timing_candidate *c, timing_sample *s) {
  const struct forces_candidate *arm = c->data;
  const forces_context *a = arm->arena;
  msim_error err;
  const double start = clock_seconds();
  const msim_status status = msim_sim_step(a->sims[arm->threads - 1], a->steps, &err);
  s->whole = (clock_seconds() - start) / a->steps;
  if (status) snprintf(c->reason, sizeof c->reason, "%s", err.text);
  return status == MSIM_OK;
}

static int run_textbook(timing_candidate *c, timing_sample *s) {
  const struct forces_candidate *arm = c->data;
  forces_context *a = arm->arena;
  const double start = clock_seconds();
  for (int i = 0; i < a->steps; i++) a->book.kernels->step(&a->book, STEP);
  s->whole = (clock_seconds() - start) / a->steps;
  return 1;
}

static int run_triad(timing_candidate *c, timing_sample *s) {
  const struct forces_candidate *arm = c->data;
  s->whole = triad_seconds(&arm->arena->memory, arm->threads, arm->arena->steps);
  if (!isfinite(s->whole)) snprintf(c->reason, sizeof c->reason, "no second thread was started");
  return isfinite(s->whole);
}

static timing_candidate *add_forces_candidate(forces_context *a, const char *name,
                                              const char *measure, int threads,
                                              int (*run)(timing_candidate *, timing_sample *)) {
  timing_candidate *c = &a->all[a->count];
  a->arms[a->count] = (struct forces_candidate){a, threads};
  *c = (timing_candidate){
      .family = name, .measure = measure, .run = run, .data = &a->arms[a->count]};
  snprintf(c->name, sizeof c->name, "%s, %d thread%s", name, threads, threads == 1 ? "" : "s");
  a->count++;
  return c;
}

/*------------------------------------- one scene ------------------------------------------------*/

/* Bytes that a step must transfer. A particle: x and v read and written, mass read, 104. A
 * half-edge, as a spring is read from both ends: k, rest and a neighbour index of 4 bytes, which
 * serves 8 half-edges if their neighbours are contiguous. */
static double bytes_of_step(const moving_scene *m) {
  const double half = 16 + (m->kind->random ? 4 : 0.5);
  return 104.0 * m->view.nparticles + 2 * half * m->view.nsprings;
}

static int make_forces_sim(forces_context *a, int threads, msim_error *err) {
  msim_options options;
  msim_options_init(&options, sizeof options);
  options.integrator = "symplectic-euler";
  options.h = STEP;
  options.threads = threads;
  msim_sim **sim = &a->sims[threads - 1];
  return msim_sim_create(a->m.scene, &options, sim, err) == MSIM_OK &&
         msim_sim_set_state(*sim, &a->m.state, err) == MSIM_OK;
}

static int make_arena(const bench_scene *scene, double seconds, forces_context *a,
                      msim_error *err) {
  *a = (forces_context){.count = 0};
  snprintf(err->text, sizeof err->text, "out of memory");
  if (!moving_scene_create_perturbed(scene, STIFFNESS, &a->m)) {
    *err = a->m.err;
    return 0;
  }
  a->bytes = bytes_of_step(&a->m);
  a->steps = 1 + (int)(seconds / 8e-9 / a->m.view.nsprings);
  return textbook_make(&a->m.view, a->m.x, a->m.v, &a->book) &&
         triad_make(&a->memory, (size_t)a->bytes) && make_forces_sim(a, 1, err) &&
         make_forces_sim(a, 2, err);
}

static void free_arena(forces_context *a) {
  for (int i = 0; i < 2; i++) msim_sim_destroy(a->sims[i]);
  textbook_free(&a->book);
  triad_free(&a->memory);
  moving_scene_free(&a->m);
}

/* The largest difference of a coordinate, m, after the same number of steps. */
static double textbook_difference(forces_context *a) {
  enum { STEPS = 3 };
  msim_state state = {.size = sizeof state};
  double largest = 0;
  if (msim_sim_step(a->sims[0], STEPS, NULL) != MSIM_OK) return NAN;
  for (int i = 0; i < STEPS; i++) a->book.kernels->step(&a->book, STEP);
  msim_sim_state(a->sims[0], &state);
  for (int32_t i = 0; i < 3 * state.n; i++)
    largest = fmax(largest, fabs(state.x[i] - a->book.x[i]));
  return largest;
}

/*------------------------------------- rows -----------------------------------------------------*/

static json_t *add_forces_row(report *out, const char *measure, const forces_context *a) {
  json_t *row = report_add_row(out, measure);
  put_text(row, "scene", a->m.kind->name);
  return row;
}

static void report_arm(report *out, const forces_context *a, const timing_candidate *c) {
  const struct forces_candidate *arm = c->data;
  const double seconds = median_of(c, whole_seconds), spread = spread_of(c, whole_seconds);
  json_t *row = add_forces_row(out, c->measure, a);
  put_text(row, "name", c->family);
  put_text(row, "contestant", c->name);
  if (c->run == run_textbook) put_text(row, "isa", a->book.kernels->isa);
  put_integer(row, "threads", arm->threads);
  put_integer(row, "springs", a->m.view.nsprings);
  put_text(row, "status", c->failed ? "failed" : c->nsamples ? "ok" : "left out");
  if (c->failed || c->nsamples == 0) {
    put_text(row, "reason", c->failed ? c->reason : "there was no time left");
    return;
  }
  const double springs = strcmp(c->measure, "triad") == 0 ? NAN : a->m.view.nsprings / seconds;
  put_real(row, "us", 1e6 * seconds);
  put_real(row, "spread", spread);
  put_integer(row, "repeats", c->nsamples > 1 ? c->nsamples - 1 : 1);
  put_real(row, "gb_per_s", 1e-9 * a->bytes / seconds);
  put_real(row, "springs_per_s", springs);
  printf(" %-22s %9.4g us %4.0f%% %7.3g GB/s", c->name, 1e6 * seconds, 100 * spread,
         1e-9 * a->bytes / seconds);
  if (isfinite(springs)) printf(" %7.4g M springs/s", 1e-6 * springs);
  putchar('\n');
}

static const struct forces_key {
  const char *ratio, *scene, *key;
} keys[] = {{"speedup", "cloth100", "explicit_step_speedup_cloth100"},
            {"fraction of triad", "cloth500", "triad_fraction_cloth500"},
            {"two threads", "cloth500", "two_threads_cloth500"},
            {"speedup", "mesh500", "irregular_speedup"}};

static void report_forces_key(report *out, const char *ratio, const bench_scene *scene,
                              double value) {
  for (const struct forces_key *k = keys; k < keys + sizeof keys / sizeof *keys; k++)
    if (strcmp(k->ratio, ratio) == 0 && strcmp(k->scene, scene->name) == 0)
      report_key(out, k->key, value);
}

/* Reports the speedup: the median of the ratios of each round. */
static void report_forces_ratio(report *out, const forces_context *a, const char *name,
                                const timing_candidate *slow, const timing_candidate *fast) {
  if (!slow || !fast) return;
  if (slow->failed || fast->failed) return;
  const double ratio = median_ratio(slow, whole_seconds, fast, whole_seconds);
  if (!isfinite(ratio)) return;
  report_forces_key(out, name, a->m.kind, ratio);
  json_t *row = add_forces_row(out, "ratio", a);
  put_text(row, "name", name);
  put_real(row, "ratio", ratio);
  printf(" %s %.3g\n", name, ratio);
}

static void report_arena(report *out, const forces_context *a, double apart) {
  json_t *row = add_forces_row(out, "scene", a);
  put_integer(row, "particles", a->m.view.nparticles);
  put_integer(row, "springs", a->m.view.nsprings);
  put_real(row, "bytes_per_step", a->bytes);
  put_real(row, "difference", apart);
  printf("\n%s, %d particles, %d springs, %.3g MB a step\n", a->m.kind->name,
         (int)a->m.view.nparticles, (int)a->m.view.nsprings, 1e-6 * a->bytes);
  for (int i = 0; i < a->count; i++) report_arm(out, a, &a->all[i]);
}

/*------------------------------------- all scenes -----------------------------------------------*/

static void measure_forces(report *out, forces_context *a, const timing_limits *p) {
  const double apart = textbook_difference(a);
  const int two = usable_cores() > 1;
  const timing_candidate *step = add_forces_candidate(a, "msim", "step", 1, run_explicit_steps);
  const timing_candidate *book = add_forces_candidate(a, "textbook", "step", 1, run_textbook);
  const timing_candidate *memory = add_forces_candidate(a, "triad", "triad", 1, run_triad);
  const timing_candidate *step2 =
      two ? add_forces_candidate(a, "msim", "step", 2, run_explicit_steps) : NULL;
  if (two) add_forces_candidate(a, "triad", "triad", 2, run_triad);
  time_in_turn(a->all, a->count, p);
  if (is_interrupted()) return;
  report_arena(out, a, apart);
  report_forces_ratio(out, a, "speedup", book, step);
  report_forces_ratio(out, a, "fraction of triad", memory, step);
  report_forces_ratio(out, a, "two threads", step, step2);
  fflush(stdout);
}

static void measure_forces_scene(report *out, const bench_scene *scene, int quick, double until) {
  const timing_limits p = {
      .max_rounds = quick ? 5 : 15, .budget = 60, .min_rounds = quick ? 5 : 15, .until = until};
  forces_context *a = malloc(sizeof *a);
  msim_error err;
  if (!a) return;
  report_forces_key(out, "speedup", scene, NAN); /* no result yet */
  report_forces_key(out, "fraction of triad", scene, NAN);
  if (usable_cores() > 1) report_forces_key(out, "two threads", scene, NAN);
  if (make_arena(scene, quick ? 0.02 : 0.1, a, &err)) {
    measure_forces(out, a, &p);
  } else {
    json_t *row = add_forces_row(out, "scene", a);
    put_text(row, "status", "failed");
    put_text(row, "reason", err.text);
    printf("\n%s: %s\n", scene->name, err.text);
  }
  free_arena(a);
  free(a);
}

int bench_forces(const bench_options *wishes, report *r) {
  static const char *const names[] = {"cloth32", "cloth100", "cloth500", "jelly16",
                                      "jelly46", "mesh100",  "mesh500"};
  if (wishes->threads)
    return report_usage_error("",
                              "--threads means nothing to forces, which runs on one and on two");
  const double until = clock_seconds() + (wishes->quick ? 45 : 600);
  const int count = wishes->nscenes ? wishes->nscenes : (int)(sizeof names / sizeof *names);
  for (int i = 0; i < count && !is_interrupted(); i++)
    measure_forces_scene(r, wishes->nscenes ? wishes->scenes[i] : scene_named(names[i]),
                         wishes->quick, until);
  return 0;
}
