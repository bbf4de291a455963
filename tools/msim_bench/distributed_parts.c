/* What parts of a scene cost, on ranks that are threads: messages against the model, balance,
 * iterations, memory; and the model's table */
#include <math.h>
#include <stdio.h>

#include "../common/interrupt.h"
#include "cases.h"
#include "counted_memory.h"
#include "distributed.h"
#include "scaling_model.h"

/* In a full run, with --quick */
static const bench_scene cloths[] = {{"cloth200", 200, 0, 0}, {"cloth64", 64, 0, 0}};
static const bench_scene flat_cloths[] = {{"cloth300", 300, 0, 0}, {"cloth64", 64, 0, 0}};
static const bench_scene jellies[] = {{"jelly32", 32, 1, 0}, {"jelly16", 16, 1, 0}};

/*------------------------------------- scenes and samples ---------------------------------------*/

/* Particles, springs and gravity of a scene, pinned or all free. alloc: nullable */
static msim_status copy_scene(const moving_scene *m, const msim_allocator *alloc, int pins,
                              msim_scene **scene, msim_error *err) {
  const msim_scene_view *s = &m->view;
  msim_status status = msim_scene_create(alloc, scene, err);
  if (!status) status = msim_scene_add_particles(*scene, s->nparticles, s->x, s->v, s->mass, err);
  if (!status)
    status = msim_scene_add_springs(*scene, s->nsprings, s->ij, s->k, s->rest, s->damping, err);
  for (int32_t p = 0; p < s->nparticles && pins && !status; p++)
    if (s->pinned[p]) status = msim_scene_pin(*scene, 1, &p, err);
  return status ? status : msim_scene_set_gravity(*scene, s->gravity, err);
}

/* One sample of a case; returns 0, and prints why, if there is none. */
static int run_sample(const rank_run *what, rank_run *r, timing_candidate *c) {
  msim_error err;
  *r = *what;
  candidate_init(c, "ranks", "step", rank_run_sample, r);
  if (!rank_run_create(r, &err)) candidate_fail(c, err.text);
  else if (rank_run_sample(c, &c->samples[0])) return c->nsamples = 1;
  printf(" %d ranks: %s\n", (int)r->n, c->reason);
  return 0;
}

/*------------------------------------- messages and balance -------------------------------------*/

/* Keys: the worst of cloth and solid */
typedef struct parts_keys {
  double over_model, imbalance;
} parts_keys;

static void report_messages(const distributed_bench *b, const bench_scene *scene, double n,
                            const rank_run *r, parts_keys *keys) {
  const comm_counts counts = rank_run_counts(r);
  const double bytes = (double)counts.bytes / (double)counts.exchanges,
               ghosts = r->n == 2 ? model_ghosts_of_half(scene->solid, n)
                                  : model_ghosts(scene->solid, n / r->n),
               model = MODEL_GHOST_BYTES * ghosts;
  report_add_row(b->run->report, "parts",
                 FIELDS(TEXT("scene", scene->name), INTEGER("ranks", r->n), REAL("bytes", bytes),
                        REAL("model_bytes", model), REAL("halo_bytes_over_model", bytes / model),
                        REAL("largest_over_mean", counts.largest_over_mean)));
  printf(
      " %-9s %2d parts: %6.0f bytes an exchange, %.4f of the model; largest part %.4f of the "
      "mean\n",
      scene->name, (int)r->n, bytes, bytes / model, counts.largest_over_mean);
  keys->over_model = fmax(keys->over_model, bytes / model);
  keys->imbalance = fmax(keys->imbalance, counts.largest_over_mean);
}

/* An explicit step. Without pinned particles the border between two halves is flat, as in the
 * model. */
static void measure_messages(const distributed_bench *b, const bench_scene *scene, int32_t ranks,
                             parts_keys *keys) {
  const distributed_case c = {*scene, 0, 1};
  moving_scene m;
  msim_scene *copy = NULL;
  msim_error err;
  static timing_candidate t;
  rank_run r = {.here = 0};
  int made = distributed_scene_create(b, &c, &m);
  made = made && copy_scene(&m, NULL, ranks > 2, &copy, &err) == MSIM_OK;
  rank_run what = distributed_run(b, &c, &m, ranks);
  what.scene = copy;
  if (made && run_sample(&what, &r, &t)) report_messages(b, scene, m.view.nparticles, &r, keys);
  rank_run_free(&r);
  msim_scene_destroy(copy);
  moving_scene_free(&m);
}

/* Iterations of a system on several ranks over those of one process: of moving scenes, or from the
 * start, where cloth hangs flat. worst: the larger of it and this ratio */
static void compare_iterations(const distributed_bench *b, const bench_scene *scene, int32_t ranks,
                               int from_start, double *worst) {
  const distributed_case c = {*scene, 1, from_start ? 6 : 2};
  static timing_candidate t[2];
  moving_scene m;
  rank_run r[2] = {{.here = 0}};
  const int made = distributed_scene_create(b, &c, &m);
  const msim_state start = {
      .size = sizeof start, .n = m.view.nparticles, .x = m.view.x, .v = m.view.v};
  rank_run alone = distributed_run(b, &c, &m, ALONE), several = distributed_run(b, &c, &m, ranks);
  if (from_start) alone.start = several.start = &start;
  if (made && run_sample(&alone, &r[0], &t[0]) && run_sample(&several, &r[1], &t[1])) {
    const double of_alone = (double)t[0].samples[0].iterations,
                 of_several = (double)t[1].samples[0].iterations;
    report_add_row(
        b->run->report, "iterations",
        FIELDS(TEXT("scene", scene->name), INTEGER("ranks", ranks),
               TEXT("from", from_start ? "start" : "motion"), REAL("iterations", of_several),
               REAL("alone", of_alone), REAL("iterations_over_alone", of_several / of_alone)));
    printf(" %-9s %2d parts: %.0f iterations%s, %.0f alone\n", scene->name, (int)ranks, of_several,
           from_start ? " in the first steps" : "", of_alone);
    *worst = fmax(*worst, of_several / of_alone);
  }
  for (int k = 0; k < 2; k++) rank_run_free(&r[k]);
  moving_scene_free(&m);
}

void measure_parts(distributed_bench *b) {
  static const int32_t ranks[] = {2, 64};
  static const char *const keys[] = {"halo_bytes_over_model_2", "halo_bytes_over_model_64"};
  const int quick = b->run->options->quick;
  double imbalance = NAN, on_16 = NAN, first = NAN;
  printf("\nparts of a scene\n");
  for (int i = 0; i < 2 && !is_interrupted(); i++) {
    parts_keys worst = {NAN, imbalance};
    measure_messages(b, &cloths[quick], ranks[i], &worst);
    measure_messages(b, &jellies[quick], ranks[i], &worst);
    report_key(b->run->report, keys[i], worst.over_model);
    imbalance = worst.imbalance;
  }
  report_key(b->run->report, "largest_over_mean", imbalance);
  compare_iterations(b, &cloths[quick], 16, 0, &on_16);
  compare_iterations(b, &jellies[1], 16, 0, &on_16);
  for (int32_t n = 2; n <= 4 && !is_interrupted(); n++)
    compare_iterations(b, &flat_cloths[quick], n, 1, &first);
  report_key(b->run->report, "iterations_over_alone_16", on_16);
  report_key(b->run->report, "iterations_over_alone_first_steps", first);
  fflush(stdout);
}

/*------------------------------------- memory ---------------------------------------------------*/

/* Bytes a particle at the peak of creation and a step: of the scene and the sims of all ranks. NAN:
 * failed */
static double measure_peak(const distributed_bench *b, const distributed_case *c,
                           const moving_scene *m, int32_t ranks) {
  counted_memory memory;
  msim_scene *scene = NULL;
  msim_error err;
  static timing_candidate t;
  rank_run what = distributed_run(b, c, m, ranks), r = {.here = 0};
  counted_memory_begin(&memory);
  int made = copy_scene(m, &memory.allocator, 1, &scene, &err) == MSIM_OK;
  what.scene = scene;
  made = made && run_sample(&what, &r, &t);
  rank_run_free(&r);
  msim_scene_destroy(scene);
  return made ? (double)atomic_load(&memory.peak) / m->view.nparticles : NAN;
}

void measure_memory(distributed_bench *b) {
  const bench_scene *scene = &cloths[b->run->options->quick];
  static const char *const methods[] = {"explicit", "implicit"};
  static const char *const keys[] = {"bytes_a_particle_explicit", "bytes_a_particle_implicit"};
  printf("\nmemory, %s\n", scene->name);
  for (int implicit = 0; implicit < 2 && !is_interrupted(); implicit++) {
    const distributed_case c = {*scene, implicit, 1};
    moving_scene m;
    double of[3] = {NAN, NAN, NAN}; /* by number of ranks */
    const int made = moving_scene_create_perturbed(scene, SOFT, &m);
    for (int32_t ranks = 1; ranks <= 2 && made; ranks++) {
      of[ranks] = measure_peak(b, &c, &m, ranks);
      report_add_row(b->run->report, "memory",
                     FIELDS(TEXT("scene", scene->name), TEXT("method", methods[implicit]),
                            INTEGER("ranks", ranks), REAL("bytes_a_particle", of[ranks])));
      printf(" %s, %d rank%s: %.4g bytes a particle\n", methods[implicit], (int)ranks,
             ranks == 1 ? "" : "s", of[ranks]);
    }
    moving_scene_free(&m);
    b->bytes[implicit] = of[1];
    b->shared_bytes = of[2] - of[1];
    report_key(b->run->report, keys[implicit], of[1]);
  }
}

/*------------------------------------- the model ------------------------------------------------*/

static const column columns[] = {{"ranks", "ranks", 5, "%.0f", 0},
                                 {"GB explicit", "gb_explicit", 11, "%.3g", 0},
                                 {"implicit", "gb_implicit", 8, "%.3g", 0},
                                 {"+ shared", "gb_shared", 8, "%.3g", 0},
                                 {"cloth, ms", "cloth_ms", 9, "%.3g", 0},
                                 {"efficiency", "cloth_efficiency", 10, "%.2f", 0},
                                 {"solid, ms", "solid_ms", 9, "%.3g", 0},
                                 {"efficiency", "solid_efficiency", 10, "%.2f", 0},
                                 {"CG iteration, ms", "iteration_ms", 16, "%.3g", 0},
                                 {.key = NULL}};

void report_model(const distributed_bench *b) {
  const double n = 1e8, *c = b->explicit_seconds;
  printf("\nmodel of 1e8 particles: memory of a rank, explicit steps, an iteration in cloth\n");
  print_titles(columns);
  for (int32_t ranks = 64; ranks <= 4096; ranks *= 8) {
    const double cloth = model_seconds(0, n, ranks, c[0], 1),
                 solid = model_seconds(1, n, ranks, c[1], 1),
                 iteration = model_seconds(0, n, ranks, b->iteration_seconds, b->collectives);
    json_t *row = report_add_row(
        b->run->report, "model",
        FIELDS(INTEGER("ranks", ranks), REAL("gb_explicit", 1e-9 * n / ranks * b->bytes[0]),
               REAL("gb_implicit", 1e-9 * n / ranks * b->bytes[1]),
               REAL("gb_shared", 1e-9 * n * b->shared_bytes), REAL("cloth_ms", 1e3 * cloth),
               REAL("cloth_efficiency", c[0] * n / ranks / cloth), REAL("solid_ms", 1e3 * solid),
               REAL("solid_efficiency", c[1] * n / ranks / solid),
               REAL("iteration_ms", 1e3 * iteration)));
    print_row(columns, row);
  }
}
