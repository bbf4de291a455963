/* scenes - small scenes, options and queries that several tests share */
#ifndef TEST_SCENES_H
#define TEST_SCENES_H

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "msim/backend.h"
#include "testing.h"

/* A horizontal cloth of 1 m x 1 m and 0.3 kg, two corners pinned. */
static inline msim_scene *hanging_sheet(int32_t rows, int32_t columns, double k, double damping) {
  const int32_t corners[2] = {0, columns - 1};
  const double g[3] = {0, 0, -9.81};
  const msim_cloth cloth = {.size = sizeof cloth,
                            .rows = rows,
                            .columns = columns,
                            .row = {0, 1, 0},
                            .column = {1, 0, 0},
                            .mass = 0.3,
                            .k_structural = k,
                            .k_shear = k,
                            .k_bend = k,
                            .damping = damping,
                            .npinned = 2,
                            .pinned = corners};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_cloth(scene, &cloth, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

static inline msim_scene *hanging_cloth(int32_t side, double k, double damping) {
  return hanging_sheet(side, side, k, damping);
}

/* A cube of 1 kg with side^3 particles, pinned in the layer of that z index. */
static inline msim_scene *pinned_block(int32_t side, double extent, double k, int32_t layer) {
  const double g[3] = {0, 0, -9.81};
  int32_t face[400];
  assert_true(side <= 20);
  for (int32_t i = 0; i < side * side; i++) face[i] = side * i + layer;
  const msim_lattice lattice = {.size = sizeof lattice,
                                .n = {side, side, side},
                                .extent = {extent, extent, extent},
                                .mass = 1,
                                .k = k,
                                .npinned = side * side,
                                .pinned = face};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

/* Scene i of tools/scenes; NULL past the end. */
static inline msim_scene *load_shipped_scene(size_t i) {
  static const char *const names[] = {"three_particles", "pendulum",   "rope",
                                      "hanging_cloth",   "jelly_drop", "bouncing_balls"};
  char path[512];
  msim_scene *scene;
  if (i >= sizeof names / sizeof *names) return NULL;
  snprintf(path, sizeof path, "%s/../tools/scenes/%s.json", TEST_SOURCE_DIR, names[i]);
  assert_ok(msim_scene_load(NULL, path, &scene, err));
  return scene;
}

/* One particle of mass 1 at x with velocity v, gravity g along -z. */
static inline msim_scene *make_single_particle(const double x[3], const double v[3], double g) {
  const double gravity[3] = {0, 0, -g}, mass = 1;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 1, x, v, &mass, err));
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  return scene;
}

/* Two particles of 1 kg joined by a spring without rest length; the first one is pinned. */
static inline msim_scene *make_oscillator(const double x[6], const double v[6], double k) {
  const double mass[2] = {1, 1}, rest = 0;
  const int32_t ij[2] = {0, 1}, pin = 0;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  assert_ok(msim_scene_pin(scene, 1, &pin, err));
  return scene;
}

static inline void plane(msim_scene *scene, double nx, double ny, double nz, double offset,
                         double restitution, double friction) {
  const msim_plane p = {{nx, ny, nz}, offset, restitution, friction};
  assert_ok(msim_scene_add_plane(scene, &p, err));
}

/* A rope along x that swings from its first particle, which is pinned. */
static inline msim_scene *swinging_rope(int32_t n, double k, double damping) {
  const double g[3] = {0, 0, -9.81};
  const int32_t first = 0;
  const msim_rope rope = {.size = sizeof rope,
                          .n = n,
                          .to = {1, 0, 0},
                          .mass = 0.2,
                          .k = k,
                          .damping = damping,
                          .npinned = 1,
                          .pinned = &first};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_rope(scene, &rope, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

/* A compressed zigzag rope of n particles, the first pinned: it springs apart under large
 * rotations. */
static inline msim_scene *folded_rope(int32_t n) {
  const double mass = 0.05, k = 2000, rest = 0.3, g[3] = {0, 0, -9.81};
  const int32_t first = 0;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int32_t i = 0; i < n; i++) {
    const double x[3] = {0.02 * i, 0, 0.1 * (i % 2)};
    const int32_t ij[2] = {i - 1, i};
    assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
    if (i) assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  }
  assert_ok(msim_scene_pin(scene, 1, &first, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

/* A strut of two springs of k = 100 N/m along x, each compressed from 1.25 m to 1 m between pinned
 * ends; the particle in the middle has this mass. */
static inline msim_scene *compressed_strut(double mass) {
  const double x[9] = {0, 0, 0, 1, 0, 0, 2, 0, 0}, masses[3] = {mass, mass, mass},
               k[2] = {100, 100}, rest[2] = {1.25, 1.25};
  const int32_t ij[4] = {0, 1, 1, 2}, ends[2] = {0, 2};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 3, x, NULL, masses, err));
  assert_ok(msim_scene_add_springs(scene, 2, ij, k, rest, NULL, err));
  assert_ok(msim_scene_pin(scene, 2, ends, err));
  return scene;
}

/* Fixed steps of h; dop853 takes them only where the number of steps is given. */
static inline msim_options options(const char *integrator, double h) {
  msim_options opt;
  msim_options_init(&opt, sizeof opt);
  opt.integrator = integrator;
  opt.h = h;
  if (integrator && strcmp(integrator, "dop853") == 0) opt.steps = 1000000000;
  return opt;
}

static inline msim_sim *make_sim(const msim_scene *scene, const msim_options *opt) {
  msim_sim *sim;
  assert_ok(msim_sim_create(scene, opt, &sim, err));
  return sim;
}

static inline msim_state state_of(msim_sim *sim) {
  msim_state state = {.size = sizeof state};
  msim_sim_state(sim, &state);
  return state;
}

/* x and v are the same to the bit. */
/* The largest difference of n numbers */
static inline double largest_difference(const double *x, const double *y, int n) {
  double most = 0;
  for (int i = 0; i < n; i++) most = fmax(most, fabs(x[i] - y[i]));
  return most;
}

static inline void expect_same_motion(msim_sim *a, msim_sim *b) {
  const msim_state s = state_of(a), t = state_of(b);
  assert_memory_equal(s.x, t.x, 3 * (size_t)s.n * sizeof *s.x);
  assert_memory_equal(s.v, t.v, 3 * (size_t)s.n * sizeof *s.v);
}

static inline msim_stats stats_of(const msim_sim *sim) {
  msim_stats stats = {.size = sizeof stats};
  msim_sim_stats(sim, &stats);
  return stats;
}

/* Method i of this version; NULL past the end. */
static inline const char *method_at(int32_t i) {
  const msim_integrator_entry *entry = msim_integrator_info(i);
  return entry && entry->order > 0 ? entry->name : NULL;
}

/* A mass of 1 kg on a pinned spring of 1 m, stretched by 1 %, with a speed along it */
static inline msim_scene *mass_on_spring(double k, double damping, double speed) {
  const double x[6] = {0, 0, 0, 1.01, 0, 0}, v[6] = {0, 0, 0, speed, 0, 0}, mass[2] = {1, 1},
               rest = 1;
  const int32_t ij[2] = {0, 1}, pin = 0;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, &damping, err));
  assert_ok(msim_scene_pin(scene, 1, &pin, err));
  return scene;
}

/* 1 if each step solves a system. */
static inline int is_implicit(const char *method) {
  const msim_integrator_entry *entry;
  for (int32_t i = 0; (entry = msim_integrator_info(i)) != NULL; i++)
    if (strcmp(entry->name, method) == 0) return entry->implicit;
  return 0;
}

/* 1 if the method takes no forces that depend on velocities. */
static inline int takes_positions_only(const char *method) {
  return strcmp(method, "rkn6") == 0 || strcmp(method, "force-gradient") == 0;
}

/* 1 if the method takes no planes. */
static inline int refuses_planes(const char *method) {
  return strcmp(method, "takahashi-imada") == 0;
}

/* The energy less the work done on the scene: constant without dissipation */
static inline double energy_less_work(msim_sim *sim) {
  msim_energy e = {.size = sizeof e};
  assert_int_equal(msim_sim_energy(sim, &e), MSIM_OK);
  return e.total - e.work;
}

/* An accurate run of 1 s keeps the energy less the work, which is not small. */
static inline void expect_work_is_balanced(const msim_scene *scene) {
  msim_options opt = options("dop853", 1e-3);
  opt.tol = 1e-12, opt.steps = -1, opt.t_end = 1;
  msim_sim *sim = make_sim(scene, &opt);
  const double start = energy_less_work(sim);
  double most = 0, largest = 0;
  while (state_of(sim).t < 1) {
    assert_ok(msim_sim_step(sim, 1, err));
    most = fmax(most, fabs(energy_less_work(sim) - start));
    largest = fmax(largest, fabs(state_of(sim).work));
  }
  print_message("  imbalance %.3g J of %.3g J\n", most, largest);
  assert_true(largest > 0.1 && most <= 1e-10 * largest);
  msim_sim_destroy(sim);
}

/* 1 if the solver is available. */
static inline int is_solver_available(const char *name) {
  msim_plugin_entry entry = {.size = sizeof entry};
  msim_error err;
  for (int32_t i = 0; msim_solver_info(i, NULL, &entry, &err); i++)
    if (strcmp(entry.name, name) == 0) return entry.available;
  return 0;
}

/* The flags MSIM_BACKEND_... of an available solver. */
static inline uint32_t solver_flags(const char *name) {
  const msim_backend *backend;
  if (strcmp(name, "pcg") == 0) return MSIM_BACKEND_ITERATIVE;
  assert_ok(msim_solver_backend(name, NULL, &backend, err));
  return backend->flags;
}

#endif
