#include "bench_scenes.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../common/clock.h"
#include "../common/interrupt.h"
#include "random_mesh.h"

const bench_scene *scene_info(int i) {
  static const bench_scene scenes[] = {
      {"cloth32", 32, 0, 0},     {"cloth64", 64, 0, 0},   {"cloth100", 100, 0, 0},
      {"cloth200", 200, 0, 0},   {"cloth316", 316, 0, 0}, {"cloth500", 500, 0, 0},
      {"cloth1000", 1000, 0, 0}, {"jelly8", 8, 1, 0},     {"jelly16", 16, 1, 0},
      {"jelly24", 24, 1, 0},     {"jelly32", 32, 1, 0},   {"jelly46", 46, 1, 0},
      {"mesh100", 100, 0, 1},    {"mesh500", 500, 0, 1},
  };
  return i >= 0 && i < (int)(sizeof scenes / sizeof *scenes) ? &scenes[i] : NULL;
}

const bench_scene *scene_named(const char *name) {
  const bench_scene *scene;
  for (int i = 0; (scene = scene_info(i)) != NULL; i++)
    if (strcmp(scene->name, name) == 0) return scene;
  return NULL;
}

/*------------------------------------- building -------------------------------------------------*/

msim_cloth bench_cloth(int32_t side, double k, int32_t npinned, const int32_t *pinned) {
  return (msim_cloth){.size = sizeof(msim_cloth),
                      .rows = side,
                      .columns = side,
                      .row = {0, 1, 0},
                      .column = {1, 0, 0},
                      .mass = 0.3,
                      .k_structural = k,
                      .k_shear = k,
                      .k_bend = k,
                      .npinned = npinned,
                      .pinned = pinned};
}

static msim_status add_bench_cloth(moving_scene *m) {
  const int32_t side = m->kind->side, corners[2] = {0, side - 1};
  const msim_cloth cloth = bench_cloth(side, m->k, 2, corners);
  return msim_scene_add_cloth(m->scene, &cloth, &m->err);
}

static msim_status add_jelly(moving_scene *m) {
  const int32_t side = m->kind->side;
  int32_t *edge = malloc((size_t)side * sizeof *edge);
  for (int32_t i = 0; edge && i < side; i++) edge[i] = i * side + side - 1;
  const msim_lattice jelly = {.size = sizeof jelly,
                              .n = {side, side, side},
                              .extent = {1, 1, 1},
                              .mass = 1,
                              .k = m->k,
                              .npinned = edge ? side : 0,
                              .pinned = edge};
  msim_status status = msim_scene_add_lattice(m->scene, &jelly, &m->err);
  free(edge);
  return status;
}

msim_status moving_scene_build(const bench_scene *kind, double k, const msim_allocator *alloc,
                               moving_scene *m) {
  const double gravity[3] = {0, 0, -9.81};
  *m = (moving_scene){.kind = kind, .k = k, .threads = 1};
  msim_status status = msim_scene_create(alloc, &m->scene, &m->err);
  if (!status) status = msim_scene_set_gravity(m->scene, gravity, &m->err);
  if (!status && m->kind->random) status = random_mesh_add(m->scene, m->kind->side, m->k, &m->err);
  else if (!status) status = m->kind->solid ? add_jelly(m) : add_bench_cloth(m);
  if (status) return status;
  m->view.size = sizeof m->view;
  msim_scene_get(m->scene, &m->view);
  for (int32_t i = 0; i < m->view.nparticles; i++) m->unknowns += m->view.pinned[i] ? 0 : 3;
  return MSIM_OK;
}

/*------------------------------------- moving ---------------------------------------------------*/

msim_options implicit_options(double h, double rtol, const char *solver, int32_t threads) {
  msim_options options;
  msim_options_init(&options, sizeof options);
  options.integrator = "linearly-implicit-euler";
  options.h = h;
  options.jacobian = MSIM_JACOBIAN_CLAMP;
  options.solver = solver;
  options.solver_rtol = rtol;
  options.solver_max_iterations = MAX_ITERATIONS;
  options.threads = threads;
  return options;
}

static int keep_state(const msim_state *state, moving_scene *m) {
  const size_t n = 3 * (size_t)m->view.nparticles;
  m->x = malloc(n * sizeof *m->x);
  m->v = malloc(n * sizeof *m->v);
  m->zeros = calloc(n, sizeof *m->zeros);
  if (!m->x || !m->v || !m->zeros) {
    snprintf(m->err.text, sizeof m->err.text, "out of memory for the state");
    return 0;
  }
  memcpy(m->x, state->x, n * sizeof *m->x);
  memcpy(m->v, state->v, n * sizeof *m->v);
  m->state = *state;
  m->state.x = m->x;
  m->state.v = m->v;
  return 1;
}

/* A cloth of 1000 x 1000 falls faster than linearly implicit Euler can follow: with any tolerance
 * it is unstable from step 20 on. */
static int advance_scene(const bench_scene *kind, msim_sim *sim, double seconds, double until,
                         msim_error *err) {
  const int steps = kind->side < 1000 ? 60 : 12;
  const double enough = clock_seconds() + seconds;
  for (int i = 0; i < steps && clock_seconds() < enough; i++) {
    if (is_interrupted() || clock_seconds() > until) {
      snprintf(err->text, sizeof err->text,
               "the time limit was reached before the scene was in motion");
      return 0;
    }
    if (msim_sim_step(sim, 1, err) != MSIM_OK) return 0;
  }
  return 1;
}

int moving_scene_create(const bench_scene *kind, double k, int32_t threads, double seconds,
                        double until, moving_scene *m) {
  const msim_options options = implicit_options(1.0 / 120, 1e-6, "auto", threads);
  msim_sim *sim = NULL;
  msim_state state = {.size = sizeof state};
  int made = !moving_scene_build(kind, k, NULL, m) &&
             !msim_sim_create(m->scene, &options, &sim, &m->err) &&
             advance_scene(kind, sim, seconds, until, &m->err);
  m->threads = threads;
  if (made) msim_sim_state(sim, &state);
  made = made && keep_state(&state, m);
  msim_sim_destroy(sim);
  return made;
}

int moving_scene_create_perturbed(const bench_scene *kind, double k, moving_scene *m) {
  if (moving_scene_build(kind, k, NULL, m)) return 0;
  const msim_state state = {
      .size = sizeof state, .n = m->view.nparticles, .x = m->view.x, .v = m->view.v};
  if (!keep_state(&state, m)) return 0;
  unsigned seed = 1;
  for (int32_t i = 0; i < 3 * m->view.nparticles; i++) {
    seed = seed * 1664525u + 1013904223u;
    if (!m->view.pinned[i / 3]) m->x[i] += 0.1 / kind->side * ((seed >> 8) / 16777216.0 - 0.5);
  }
  return 1;
}

void moving_scene_free(moving_scene *m) {
  free(m->x);
  free(m->v);
  free(m->zeros);
  msim_scene_destroy(m->scene);
  *m = (moving_scene){0};
}
