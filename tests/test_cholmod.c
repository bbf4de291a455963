/* Tests that the plugin cholmod limits the threads of BLAS and OpenMP to one while it works,
 * whatever the program has set, and restores the settings afterwards. */
#define _GNU_SOURCE /* RTLD_NOLOAD */
#include <dlfcn.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "scenes.h"

static int (*get_blas)(void), (*get_levels)(void);
static void (*set_blas)(int), (*set_levels)(int);

static void *symbol(void *plugin, const char *name) {
  void *found = dlsym(plugin, name);
  if (!found) print_message("  this plugin has no %s\n", name);
  return found;
}

/* 0 if the settings of this BLAS and this OpenMP can be read, else the exit status of the
 * program. */
static int find_controls(void) {
  char path[4096];
  snprintf(path, sizeof path, "%s/msim_backend_cholmod.so", getenv("MSIM_PLUGIN_PATH"));
  void *plugin = dlopen(path, RTLD_NOW | RTLD_NOLOAD);
  if (!plugin) return 77; /* linked in */
  void *found[] = {
      symbol(plugin, "openblas_get_num_threads"), symbol(plugin, "omp_get_max_active_levels"),
      symbol(plugin, "openblas_set_num_threads"), symbol(plugin, "omp_set_max_active_levels")};
  memcpy(&get_blas, found + 0, sizeof(void *)), memcpy(&get_levels, found + 1, sizeof(void *));
  memcpy(&set_blas, found + 2, sizeof(void *)), memcpy(&set_levels, found + 3, sizeof(void *));
  return found[0] && found[1] && found[2] && found[3] ? 0 : missing_status("OpenBLAS or OpenMP");
}

static msim_sim *cloth_sim(void) {
  msim_scene *scene = hanging_cloth(24, 1000, 0);
  msim_options opt = options("linearly-implicit-euler", 1.0 / 60);
  opt.solver = "cholmod";
  msim_sim *sim = make_sim(scene, &opt);
  msim_scene_destroy(scene);
  return sim;
}

static void threads_are_as_they_were(void **state) {
  (void)state;
  msim_sim *sim = cloth_sim();
  for (int wanted = 1; wanted <= 3; wanted++) {
    set_blas(wanted), set_levels(wanted + 1);
    const int threads = get_blas(); /* no more than the machine has */
    assert_ok(msim_sim_step(sim, 2, err));
    assert_int_equal(get_blas(), threads);
    assert_int_equal(get_levels(), wanted + 1);
  }
  msim_sim_destroy(sim);
}

static void *step_often(void *sim) { return msim_sim_step(sim, 60, NULL) == MSIM_OK ? NULL : sim; }

/* When several solvers work at the same time, the last one restores what the first has changed. */
static void nor_do_solvers_in_other_threads_change_them(void **state) {
  (void)state;
  enum { SIMS = 4 };
  msim_sim *sims[SIMS];
  pthread_t threads[SIMS];
  for (int i = 0; i < SIMS; i++) sims[i] = cloth_sim();
  set_blas(2);
  const int before = get_blas();
  for (int i = 0; i < SIMS; i++)
    assert_int_equal(pthread_create(&threads[i], NULL, step_often, sims[i]), 0);
  for (int i = 0; i < SIMS; i++) {
    void *failed;
    pthread_join(threads[i], &failed);
    assert_null(failed);
    msim_sim_destroy(sims[i]);
  }
  assert_int_equal(get_blas(), before);
}

static void bits_do_not_depend_on_them(void **state) {
  (void)state;
  msim_sim *one = cloth_sim(), *two = cloth_sim();
  set_blas(1), set_levels(1);
  assert_ok(msim_sim_step(one, 20, err));
  set_blas(2), set_levels(2);
  assert_ok(msim_sim_step(two, 20, err));
  assert_memory_equal(state_of(one).x, state_of(two).x, 3 * 24 * 24 * sizeof(double));
  msim_sim_destroy(one), msim_sim_destroy(two);
}

/* On a solid minimum degree needs about twice the flops of the order that the plugin finds. */
static void solids_are_dissected(void **state) {
  (void)state;
  const msim_lattice block = {
      .size = sizeof block, .n = {17, 17, 17}, .extent = {1, 1, 1}, .mass = 1, .k = 1000};
  msim_scene *scene;
  const char *text;
  double flops = 0;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &block, err));
  msim_options opt = options("linearly-implicit-euler", 1e-3);
  opt.solver = "cholmod";
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_explain(sim, &text, err));
  text = strstr(text, "nonzeros, ");
  assert_non_null(text);
  assert_int_equal(sscanf(text, "nonzeros, %lf flops", &flops), 1);
  assert_true(flops < 5e9); /* minimum degree: 9e9 */
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- constant matrices ----------------------------------------*/

enum { MOST = 70 };

/* Particles in a row, the first one pinned, each connected with the next `reach` ones by springs of
 * rest length 0: a chain, a band, or one dense block. depth 0: planar, two components. */
static msim_scene *connected_row(int32_t n, int32_t reach, double depth) {
  static int32_t ij[MOST * MOST];
  static double x[3 * MOST], mass[MOST], k[MOST * MOST / 2], rest[MOST * MOST / 2];
  const double g[3] = {0, -9.81, depth};
  const int32_t pinned = 0;
  int32_t springs = 0;
  msim_scene *scene;
  for (int32_t i = 0; i < n; i++) {
    x[3 * i] = 0.1 * i, x[3 * i + 1] = 0.01 * (i % 5), x[3 * i + 2] = depth * (i % 3);
    mass[i] = 0.01 + 0.001 * (i % 7);
    for (int32_t j = i + 1; j < n && j <= i + reach; j++, springs++)
      ij[2 * springs] = i, ij[2 * springs + 1] = j, k[springs] = 10 + springs % 4;
  }
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, n, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, springs, ij, k, rest, NULL, err));
  assert_ok(msim_scene_pin(scene, 1, &pinned, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

static msim_sim *connected_row_sim(const msim_scene *scene, const char *solver) {
  msim_options opt = options("linearly-implicit-euler", 0.02);
  opt.solver = solver, opt.solver_rtol = 1e-13;
  return make_sim(scene, &opt);
}

/* Supernodes of every width, two and three right-hand sides: the same motion as with pcg,
 * without refinement, and from the same state the same bits, with a new factorization and with
 * an old one. */
static void factors_of_scalars_serve_a_run(void **state) {
  (void)state;
  static const int32_t counts[] = {2, 3, 4, 5, 6, 7, 8, 9, 18, 33, MOST};
  for (int i = 0; i < 6 * (int)(sizeof counts / sizeof *counts); i++) {
    const int32_t n = counts[i / 6], reach[] = {1, 6, MOST};
    const size_t size = 3 * (size_t)n * sizeof(double);
    msim_scene *scene = connected_row(n, reach[i % 3], i / 3 % 2 ? 0.05 : 0);
    msim_sim *sim = connected_row_sim(scene, "cholmod"), *other = connected_row_sim(scene, "pcg");
    double x[3 * MOST];
    assert_ok(msim_sim_step(other, 20, err));
    const msim_state first = state_of(sim);
    double x0[3 * MOST], v0[3 * MOST];
    memcpy(x0, first.x, size), memcpy(v0, first.v, size);
    for (int round = 0; round < 2; round++) {
      msim_state start = state_of(sim);
      start.x = x0, start.v = v0;
      assert_ok(msim_sim_set_state(sim, &start, err));
      assert_ok(msim_sim_step(sim, 20, err));
      if (round) assert_memory_equal(state_of(sim).x, x, size);
      memcpy(x, state_of(sim).x, size);
    }
    for (int32_t c = 0; c < 3 * n; c++) assert_close(x[c], state_of(other).x[c], 1e-11);
    assert_int_equal(stats_of(sim).factorizations, 1);
    assert_int_equal(stats_of(sim).refinements, 0);
    msim_sim_destroy(sim), msim_sim_destroy(other);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  if (!is_solver_available("cholmod")) return missing_status("the solver cholmod");
  const int status = find_controls();
  if (status) return status;
  const struct CMUnitTest tests[] = {cmocka_unit_test(threads_are_as_they_were),
                                     cmocka_unit_test(nor_do_solvers_in_other_threads_change_them),
                                     cmocka_unit_test(bits_do_not_depend_on_them),
                                     cmocka_unit_test(solids_are_dissected),
                                     cmocka_unit_test(factors_of_scalars_serve_a_run)};
  return cmocka_run_group_tests_name("cholmod", tests, NULL, NULL);
}
