/* forces - benchmark of explicit steps against a textbook implementation and the memory
 * bandwidth */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "../bench_reference/textbook.h"
#include "../bench_reference/triad.h"
#include "../common/clock.h"
#include "../common/interrupt.h"
#include "background_load.h"
#include "cases.h"

enum { MOST_CANDIDATES = 6 };
#define STEP 1e-6 /* s: stable in all scenes */

/* The candidates that alternate on one scene. A sample is `steps` steps, or passes of the triad,
 * which transfers as many bytes as a step must. */
typedef struct forces_context {
  moving_scene m;
  msim_sim *sims[3]; /* with one thread, with two, and with one in single precision */
  textbook book;
  triad memory;
  double bytes; /* transferred in a step */
  int steps;
  int count;
  timing_candidate all[MOST_CANDIDATES];
  struct forces_candidate {
    struct forces_context *context;
    const char *name;
    int threads;
    msim_sim *sim; /* NULL: not of msim */
  } candidates[MOST_CANDIDATES];
} forces_context;

/*------------------------------------- candidates -----------------------------------------------*/

static int run_explicit_steps(timing_candidate *c, timing_sample *s) {
  const struct forces_candidate *f = c->data;
  const forces_context *a = f->context;
  msim_error err;
  const double start = clock_seconds();
  const msim_status status = msim_sim_step(f->sim, a->steps, &err);
  s->whole = (clock_seconds() - start) / a->steps;
  return status ? candidate_fail(c, err.text) : 1;
}

static int run_textbook(timing_candidate *c, timing_sample *s) {
  const struct forces_candidate *f = c->data;
  forces_context *a = f->context;
  const double start = clock_seconds();
  for (int i = 0; i < a->steps; i++) a->book.kernels->step(&a->book, STEP);
  s->whole = (clock_seconds() - start) / a->steps;
  return 1;
}

static int run_triad(timing_candidate *c, timing_sample *s) {
  const struct forces_candidate *f = c->data;
  s->whole = triad_seconds(&f->context->memory, f->threads, f->context->steps);
  return isfinite(s->whole) || candidate_fail(c, "the second thread could not be started");
}

static timing_candidate *add_forces_candidate(forces_context *a, const char *name,
                                              const char *measure, int threads, msim_sim *sim,
                                              int (*run)(timing_candidate *, timing_sample *)) {
  char text[32];
  a->candidates[a->count] = (struct forces_candidate){a, name, threads, sim};
  snprintf(text, sizeof text, "%s, %d thread%s", name, threads, threads == 1 ? "" : "s");
  candidate_init(&a->all[a->count], text, measure, run, &a->candidates[a->count]);
  return &a->all[a->count++];
}

/*------------------------------------- one scene ------------------------------------------------*/

/* Bytes that a step must transfer. A particle: x and v read and written, mass read, 104. A
 * half-edge, as a spring is read from both ends: k, rest and a neighbour index of 4 bytes, which
 * serves 8 half-edges if their neighbours are contiguous. */
static double bytes_of_step(const moving_scene *m) {
  const double half = 16 + (m->kind->random ? 4 : 0.5);
  return 104.0 * m->view.nparticles + 2 * half * m->view.nsprings;
}

static int make_forces_sim(const forces_context *a, int threads, int precision, msim_sim **sim,
                           msim_error *err) {
  msim_options options;
  msim_options_init(&options, sizeof options);
  options.integrator = "symplectic-euler";
  options.h = STEP;
  options.threads = threads;
  options.precision = precision;
  return msim_sim_create(a->m.scene, &options, sim, err) == MSIM_OK &&
         msim_sim_set_state(*sim, &a->m.state, err) == MSIM_OK;
}

static int make_context(const bench_scene *scene, double seconds, forces_context *a,
                        msim_error *err) {
  *a = (forces_context){.count = 0};
  snprintf(err->text, sizeof err->text, "out of memory");
  if (!moving_scene_create_perturbed(scene, SOFT, &a->m)) {
    *err = a->m.err;
    return 0;
  }
  a->bytes = bytes_of_step(&a->m);
  a->steps = 1 + (int)(seconds / 8e-9 / a->m.view.nsprings);
  return textbook_make(&a->m.view, a->m.x, a->m.v, &a->book) &&
         triad_make(&a->memory, (size_t)a->bytes) &&
         make_forces_sim(a, 1, MSIM_PRECISION_DOUBLE, &a->sims[0], err) &&
         make_forces_sim(a, 2, MSIM_PRECISION_DOUBLE, &a->sims[1], err) &&
         make_forces_sim(a, 1, MSIM_PRECISION_SINGLE, &a->sims[2], err);
}

static void free_context(forces_context *a) {
  for (int i = 0; i < 3; i++) msim_sim_destroy(a->sims[i]);
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

/*------------------------------------- results --------------------------------------------------*/

static const column columns[] = {{"", "contestant", -22, NULL, 0},
                                 {"us", "us", 9, "%.4g", 0},
                                 {"+-", "spread", 4, "%.0f%%", 100},
                                 {"GB/s", "gb_per_s", 7, "%.3g", 0},
                                 {"M springs/s", "springs_per_s", 11, "%.4g", 1e-6},
                                 {.key = NULL}};

static void report_candidate(report *out, const forces_context *a, const timing_candidate *c) {
  const struct forces_candidate *f = c->data;
  const double seconds = median_of(c, whole_seconds);
  json_t *row = report_add_row(
      out, c->measure,
      FIELDS(TEXT("scene", a->m.kind->name), TEXT("name", f->name), TEXT("contestant", c->name),
             TEXT("isa", c->run == run_textbook ? a->book.kernels->isa : NULL),
             INTEGER("threads", f->threads), INTEGER("springs", a->m.view.nsprings)));
  put_result(row, c, "us", 1e6);
  put_fields(
      row, FIELDS(REAL("gb_per_s", 1e-9 * a->bytes / seconds),
                  REAL("springs_per_s", c->run == run_triad ? NAN : a->m.view.nsprings / seconds)));
  print_row(columns, row);
}

/* Reports a speedup: the median of the ratios of each round. words: how it is printed. */
static void report_speedup(report *out, const forces_context *a, const char *name,
                           const char *words, const timing_candidate *slow,
                           const timing_candidate *fast) {
  if (!slow || !fast || slow->failed || fast->failed) return;
  const double ratio = median_ratio(slow, whole_seconds, fast, whole_seconds);
  if (!isfinite(ratio)) return;
  report_case_key(out, name, a->m.kind->name, SOFT, 0, ratio);
  report_add_row(out, "ratio",
                 FIELDS(TEXT("scene", a->m.kind->name), TEXT("name", name), REAL("ratio", ratio)));
  printf(" %s %.3g\n", words, ratio);
}

static void report_scene(report *out, const forces_context *a, double difference) {
  const msim_scene_view *s = &a->m.view;
  report_add_row(out, "scene",
                 FIELDS(TEXT("scene", a->m.kind->name), INTEGER("particles", s->nparticles),
                        INTEGER("springs", s->nsprings), REAL("bytes_per_step", a->bytes),
                        REAL("difference", difference)));
  printf("\n%s, %d particles, %d springs, %.3g MB a step\n", a->m.kind->name, (int)s->nparticles,
         (int)s->nsprings, 1e-6 * a->bytes);
  print_titles(columns);
  for (int i = 0; i < a->count; i++) report_candidate(out, a, &a->all[i]);
}

/*------------------------------------- all scenes -----------------------------------------------*/

static void measure_forces(report *out, forces_context *a, const timing_limits *p) {
  const double difference = textbook_difference(a);
  const int two = usable_cores() > 1;
  const timing_candidate *step =
      add_forces_candidate(a, "msim", "step", 1, a->sims[0], run_explicit_steps);
  const timing_candidate *single =
      add_forces_candidate(a, "msim single", "step", 1, a->sims[2], run_explicit_steps);
  const timing_candidate *book = add_forces_candidate(a, "textbook", "step", 1, NULL, run_textbook);
  const timing_candidate *memory = add_forces_candidate(a, "triad", "triad", 1, NULL, run_triad);
  const timing_candidate *step2 =
      two ? add_forces_candidate(a, "msim", "step", 2, a->sims[1], run_explicit_steps) : NULL;
  if (two) add_forces_candidate(a, "triad", "triad", 2, NULL, run_triad);
  time_in_turn(a->all, a->count, p);
  if (is_interrupted()) return;
  report_scene(out, a, difference);
  report_speedup(out, a, "speedup", "speedup over textbook", book, step);
  report_speedup(out, a, "single", "speedup in single precision", step, single);
  report_speedup(out, a, "fraction of triad", "fraction of memory bandwidth", memory, step);
  report_speedup(out, a, "two threads", "speedup with two threads", step, step2);
  fflush(stdout);
}

static void measure_forces_scene(const bench_run *b, const bench_scene *scene) {
  const int quick = b->options->quick, rounds = quick ? 5 : 15;
  const timing_limits p = {
      .max_rounds = rounds, .budget = 60, .min_rounds = rounds, .until = b->until};
  forces_context *a = malloc(sizeof *a);
  msim_error err;
  if (!a) return;
  init_case_keys(b->report, scene->name, SOFT, 0);
  if (make_context(scene, quick ? 0.02 : 0.1, a, &err)) {
    measure_forces(b->report, a, &p);
  } else {
    report_add_row(
        b->report, "scene",
        FIELDS(TEXT("scene", scene->name), TEXT("status", "failed"), TEXT("reason", err.text)));
    printf("\n%s: %s\n", scene->name, err.text);
  }
  free_context(a);
  free(a);
}

int bench_forces(bench_run *b) {
  static const char *const names[] = {"cloth32", "cloth100", "cloth500", "jelly16",
                                      "jelly46", "mesh100",  "mesh500"};
  const bench_options *options = b->options;
  const int count = options->nscenes ? options->nscenes : (int)(sizeof names / sizeof *names);
  for (int i = 0; i < count && !is_interrupted(); i++)
    measure_forces_scene(b, scene_named(options->nscenes ? options->scenes[i] : names[i]));
  return 0;
}
