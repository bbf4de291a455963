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
#include "spinner.h"
#include "textbook.h"
#include "timing.h"
#include "triad.h"

enum { STIFFNESS = 1000, MOST_ARMS = 5 };
#define STEP 1e-6 /* s: stable in all scenes */

/* The candidates that alternate on one scene. A sample is `steps` steps, or passes of the triad,
 * which transfers as many bytes as a step must. */
typedef struct arena {
  moving m;
  msim_sim *sims[2]; /* with one thread and with two */
  textbook book;
  triad memory;
  double bytes; /* transferred in a step */
  int steps;
  int count;
  contestant all[MOST_ARMS];
  struct arm {
    struct arena *arena;
    int threads;
  } arms[MOST_ARMS];
} arena;

/*------------------------------------- contestants ----------------------------------------------*/

static int run_step(contestant *c, sample *s) {
  const struct arm *arm = c->data;
  const arena *a = arm->arena;
  msim_error err;
  const double start = wall_seconds();
  const msim_status status = msim_sim_step(a->sims[arm->threads - 1], a->steps, &err);
  s->whole = (wall_seconds() - start) / a->steps;
  if (status) snprintf(c->reason, sizeof c->reason, "%s", err.text);
  return status == MSIM_OK;
}

static int run_textbook(contestant *c, sample *s) {
  const struct arm *arm = c->data;
  arena *a = arm->arena;
  const double start = wall_seconds();
  for (int i = 0; i < a->steps; i++) a->book.kernels->step(&a->book, STEP);
  s->whole = (wall_seconds() - start) / a->steps;
  return 1;
}

static int run_triad(contestant *c, sample *s) {
  const struct arm *arm = c->data;
  s->whole = triad_seconds(&arm->arena->memory, arm->threads, arm->arena->steps);
  if (!isfinite(s->whole)) snprintf(c->reason, sizeof c->reason, "no second thread was started");
  return isfinite(s->whole);
}

static contestant *enter(arena *a, const char *name, const char *measure, int threads,
                         int (*run)(contestant *, sample *)) {
  contestant *c = &a->all[a->count];
  a->arms[a->count] = (struct arm){a, threads};
  *c = (contestant){.family = name, .measure = measure, .run = run, .data = &a->arms[a->count]};
  snprintf(c->name, sizeof c->name, "%s, %d thread%s", name, threads, threads == 1 ? "" : "s");
  a->count++;
  return c;
}

/*------------------------------------- one scene ------------------------------------------------*/

/* Bytes that a step must transfer. A particle: x and v read and written, mass read, 104. A
 * half-edge, as a spring is read from both ends: k, rest and a neighbour index of 4 bytes, which
 * serves 8 half-edges if their neighbours are contiguous. */
static double bytes_of_step(const moving *m) {
  const double half = 16 + (m->kind->random ? 4 : 0.5);
  return 104.0 * m->view.nparticles + 2 * half * m->view.nsprings;
}

static int make_sim(arena *a, int threads, msim_error *err) {
  msim_options options;
  msim_options_init(&options, sizeof options);
  options.integrator = "symplectic-euler";
  options.h = STEP;
  options.threads = threads;
  msim_sim **sim = &a->sims[threads - 1];
  return msim_sim_create(a->m.scene, &options, sim, err) == MSIM_OK &&
         msim_sim_set_state(*sim, &a->m.state, err) == MSIM_OK;
}

static int make_arena(const bench_scene *scene, double seconds, arena *a, msim_error *err) {
  *a = (arena){.count = 0};
  snprintf(err->text, sizeof err->text, "out of memory");
  if (!moving_shaken(scene, STIFFNESS, &a->m)) {
    *err = a->m.err;
    return 0;
  }
  a->bytes = bytes_of_step(&a->m);
  a->steps = 1 + (int)(seconds / 8e-9 / a->m.view.nsprings);
  return textbook_make(&a->m, &a->book) && triad_make(&a->memory, (size_t)a->bytes) &&
         make_sim(a, 1, err) && make_sim(a, 2, err);
}

static void free_arena(arena *a) {
  for (int i = 0; i < 2; i++) msim_sim_destroy(a->sims[i]);
  textbook_free(&a->book);
  triad_free(&a->memory);
  moving_free(&a->m);
}

/* The largest difference of a coordinate, m, after the same number of steps. */
static double difference(arena *a) {
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

static json_t *scene_row(report *out, const char *measure, const arena *a) {
  json_t *row = report_row(out, measure);
  put_text(row, "scene", a->m.kind->name);
  return row;
}

static void report_arm(report *out, const arena *a, const contestant *c) {
  const struct arm *arm = c->data;
  const double seconds = median_of(c, whole_seconds), spread = spread_of(c, whole_seconds);
  json_t *row = scene_row(out, c->measure, a);
  put_text(row, "name", c->family);
  put_text(row, "contestant", c->name);
  if (c->run == run_textbook) put_text(row, "isa", a->book.kernels->isa);
  put_integer(row, "threads", arm->threads);
  put_integer(row, "springs", a->m.view.nsprings);
  put_text(row, "status", c->failed ? "failed" : c->n ? "ok" : "left out");
  if (c->failed || c->n == 0) {
    put_text(row, "reason", c->failed ? c->reason : "there was no time left");
    return;
  }
  const double springs = strcmp(c->measure, "triad") == 0 ? NAN : a->m.view.nsprings / seconds;
  put_real(row, "us", 1e6 * seconds);
  put_real(row, "spread", spread);
  put_integer(row, "repeats", c->n > 1 ? c->n - 1 : 1);
  put_real(row, "gb_per_s", 1e-9 * a->bytes / seconds);
  put_real(row, "springs_per_s", springs);
  printf(" %-22s %9.4g us %4.0f%% %7.3g GB/s", c->name, 1e6 * seconds, 100 * spread,
         1e-9 * a->bytes / seconds);
  if (isfinite(springs)) printf(" %7.4g M springs/s", 1e-6 * springs);
  putchar('\n');
}

static const struct key {
  const char *ratio, *scene, *key;
} keys[] = {{"speedup", "cloth100", "explicit_step_speedup_cloth100"},
            {"fraction of triad", "cloth500", "triad_fraction_cloth500"},
            {"two threads", "cloth500", "two_threads_cloth500"},
            {"speedup", "mesh500", "irregular_speedup"}};

static void report_key_of(report *out, const char *ratio, const bench_scene *scene, double value) {
  for (const struct key *k = keys; k < keys + sizeof keys / sizeof *keys; k++)
    if (strcmp(k->ratio, ratio) == 0 && strcmp(k->scene, scene->name) == 0)
      report_key(out, k->key, value);
}

/* Reports the speedup: the median of the ratios of each round. */
static void report_ratio(report *out, const arena *a, const char *name, const contestant *slow,
                         const contestant *fast) {
  if (!slow || !fast) return;
  if (slow->failed || fast->failed) return;
  const double ratio = median_ratio(slow, whole_seconds, fast, whole_seconds);
  if (!isfinite(ratio)) return;
  report_key_of(out, name, a->m.kind, ratio);
  json_t *row = scene_row(out, "ratio", a);
  put_text(row, "name", name);
  put_real(row, "ratio", ratio);
  printf(" %s %.3g\n", name, ratio);
}

static void report_arena(report *out, const arena *a, double apart) {
  json_t *row = scene_row(out, "scene", a);
  put_integer(row, "particles", a->m.view.nparticles);
  put_integer(row, "springs", a->m.view.nsprings);
  put_real(row, "bytes_per_step", a->bytes);
  put_real(row, "difference", apart);
  printf("\n%s, %d particles, %d springs, %.3g MB a step\n", a->m.kind->name,
         (int)a->m.view.nparticles, (int)a->m.view.nsprings, 1e-6 * a->bytes);
  for (int i = 0; i < a->count; i++) report_arm(out, a, &a->all[i]);
}

/*------------------------------------- all scenes -----------------------------------------------*/

static void measure(report *out, arena *a, const patience *p) {
  const double apart = difference(a);
  const int two = usable_cores() > 1;
  const contestant *step = enter(a, "msim", "step", 1, run_step);
  const contestant *book = enter(a, "textbook", "step", 1, run_textbook);
  const contestant *memory = enter(a, "triad", "triad", 1, run_triad);
  const contestant *step2 = two ? enter(a, "msim", "step", 2, run_step) : NULL;
  if (two) enter(a, "triad", "triad", 2, run_triad);
  contest(a->all, a->count, p);
  if (is_interrupted()) return;
  report_arena(out, a, apart);
  report_ratio(out, a, "speedup", book, step);
  report_ratio(out, a, "fraction of triad", memory, step);
  report_ratio(out, a, "two threads", step, step2);
  fflush(stdout);
}

static void measure_scene(report *out, const bench_scene *scene, int quick, double until) {
  const patience p = {
      .most = quick ? 5 : 15, .budget = 60, .rounds = quick ? 5 : 15, .until = until};
  arena *a = malloc(sizeof *a);
  msim_error err;
  if (!a) return;
  report_key_of(out, "speedup", scene, NAN); /* no result yet */
  report_key_of(out, "fraction of triad", scene, NAN);
  if (usable_cores() > 1) report_key_of(out, "two threads", scene, NAN);
  if (make_arena(scene, quick ? 0.02 : 0.1, a, &err)) {
    measure(out, a, &p);
  } else {
    json_t *row = scene_row(out, "scene", a);
    put_text(row, "status", "failed");
    put_text(row, "reason", err.text);
    printf("\n%s: %s\n", scene->name, err.text);
  }
  free_arena(a);
  free(a);
}

int bench_forces(const bench_wishes *wishes, report *r) {
  static const char *const names[] = {"cloth32", "cloth100", "cloth500", "jelly16",
                                      "jelly46", "mesh100",  "mesh500"};
  if (wishes->threads)
    return complain_usage("", "--threads means nothing to forces, which runs on one and on two");
  const double until = wall_seconds() + (wishes->quick ? 45 : 600);
  const int count = wishes->nscenes ? wishes->nscenes : (int)(sizeof names / sizeof *names);
  for (int i = 0; i < count && !is_interrupted(); i++)
    measure_scene(r, wishes->nscenes ? wishes->scenes[i] : scene_named(names[i]), wishes->quick,
                  until);
  return 0;
}
