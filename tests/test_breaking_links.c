/* Tests of links that break against closed forms, by hand, and in scene files */
#include <math.h>
#include <stdio.h>

#include "breaking.h"
#include "checkpoints.h"

/*------------------------------------- closed forms ---------------------------------------------*/

enum { LINKS = 8 };

/* A chain at rest under its weight, pinned at the top: link i carries LINKS - i masses. */
static msim_scene *hanging_chain(double mass, double k, double g) {
  const double gravity[3] = {0, 0, -g}, rest = 0.1;
  const int32_t top = 0;
  double z = 0;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int32_t p = 0; p <= LINKS; p++) {
    const double x[3] = {0, 0, z};
    const int32_t ij[2] = {p - 1, p};
    assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
    if (p) assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
    z -= rest + (LINKS - p) * mass * g / k;
  }
  assert_ok(msim_scene_pin(scene, 1, &top, err));
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  return scene;
}

/* The only link whose tension exceeds its threshold breaks, by force or by strain: the links below
 * fall, and their center of mass by g t^2/2. */
static void chains_break_where_tension_is_too_large(void **state) {
  (void)state;
  const double m = 0.25, k = 64, g = 8, h = 1.0 / 512;
  for (int32_t weak = 0; weak < LINKS; weak++) {
    msim_scene *scene = hanging_chain(m, k, g);
    for (int32_t e = 0; e < LINKS; e++) {
      const double tension = (LINKS - e) * m * g * (1 + (e == weak ? -1e-9 : 1e-9));
      const int32_t law =
          e % 2 ? add_linear(scene, 0, tension) : add_linear(scene, tension / k / 0.1, 0);
      assert_ok(msim_scene_set_law(scene, 1, &e, law, err));
    }
    const msim_options opt = options("velocity-verlet", h);
    msim_sim *sim = make_sim(scene, &opt);
    double start = 0, end = 0, tension[LINKS];
    for (int32_t p = weak + 1; p <= LINKS; p++) start += state_of(sim).x[3 * p + 2];
    assert_ok(msim_sim_step(sim, 1, err));
    for (int32_t e = 0; e < LINKS; e++) assert_int_equal(is_broken(sim, e), e == weak);
    assert_ok(msim_sim_step(sim, 31, err));
    for (int32_t p = weak + 1; p <= LINKS; p++) end += state_of(sim).x[3 * p + 2];
    const double t = 31 * h; /* the first step is at rest */
    assert_close((end - start) / (LINKS - weak), -g * t * t / 2, 1e-13);
    assert_int_equal(msim_sim_springs(sim, tension, NULL, NULL), MSIM_OK);
    assert_true(tension[weak] == 0);
    assert_int_equal(stats_of(sim).broken, 1);
    msim_sim_destroy(sim), msim_scene_destroy(scene);
  }
}

/* A mass dropped on a spring, e = (m g/k) (1 - cos wt): it breaks at the first step with e > s L,
 * and the mass falls. */
static void expect_in_time(msim_law law) {
  const double mass = 1, k = 100, rest = 1, g = 10, h = 1e-4, threshold = 0.15;
  const double w = sqrt(k / mass), t = acos(1 - threshold * rest * k / (mass * g)) / w;
  const double x[6] = {0, 0, 0, 0, 0, -1}, masses[2] = {1, mass}, gravity[3] = {0, 0, -g};
  const int32_t ij[2] = {0, 1}, zero = 0;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, NULL, masses, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  assert_ok(msim_scene_pin(scene, 1, &zero, err));
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  assert_ok(msim_scene_set_law(scene, 1, &zero, add_law(scene, law, threshold, 0), err));
  const msim_options opt = options("velocity-verlet", h);
  msim_sim *sim = make_sim(scene, &opt);
  while (!stats_of(sim).broken) assert_ok(msim_sim_step(sim, 1, err));
  const double late = state_of(sim).t - t;
  assert_true(late >= -1e-6 && late <= h + 1e-6);
  const double v = state_of(sim).v[5];
  assert_close(v, -g / w * sin(w * state_of(sim).t), 1e-6);
  assert_ok(msim_sim_step(sim, 1000, err));
  assert_close(state_of(sim).v[5], v - g * 0.1, 1e-9);
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

/* The same law as k e and as a table, which does not scale with k */
static void oscillators_break_in_time(void **state) {
  (void)state;
  const double stretch[2] = {-1, 1}, force[2] = {-100, 100};
  const msim_law linear = {.size = sizeof linear, .kind = MSIM_LAW_LINEAR};
  msim_law table = {.size = sizeof table, .kind = MSIM_LAW_TABLE, .n = 2};
  table.stretch = stretch, table.force = force;
  expect_in_time(linear);
  expect_in_time(table);
}

/* A spring that pushes its ends apart, with an energy below 0: what the scene gains counts as work,
 * also where the spring is broken by hand. */
static void negative_energy_is_work(void **state) {
  (void)state;
  const double x[6] = {0, 0, 0, 1.01, 0, 0}, mass[2] = {1, 1}, k = 4, rest = 1, minus = -1;
  const int32_t ij[2] = {0, 1}, zero = 0;
  const msim_law law = {
      .size = sizeof law, .kind = MSIM_LAW_POLYNOMIAL, .n = 1, .coefficients = &minus, .limit = 10};
  for (int by_hand = 0; by_hand < 2; by_hand++) {
    msim_scene *scene;
    assert_ok(msim_scene_create(NULL, &scene, err));
    assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
    const double strain = by_hand ? never : 0.5;
    assert_ok(msim_scene_set_law(scene, 1, &zero, add_law(scene, law, strain, 0), err));
    msim_options opt = options("dop853", 1e-3);
    opt.steps = -1, opt.tol = 1e-12;
    msim_sim *sim = make_sim(scene, &opt);
    const double start = energy_of(sim).total;
    while (!stats_of(sim).broken) {
      assert_ok(msim_sim_step(sim, 1, err));
      if (by_hand && energy_of(sim).elastic < -0.45) assert_ok(msim_sim_break(sim, 1, &zero, err));
    }
    assert_true(energy_of(sim).work > 0.4 && energy_of(sim).elastic == 0);
    assert_close(energy_of(sim).total - energy_of(sim).work, start, 1e-11);
    msim_sim_destroy(sim), msim_scene_destroy(scene);
  }
}

/*------------------------------------- by hand, files, refusals ---------------------------------*/

static void springs_are_broken_by_hand(void **state) {
  (void)state;
  const int32_t top[3] = {0, 0, 4}, beyond = LINKS;
  msim_error why;
  msim_scene *scene = hanging_chain(0.25, 64, 8);
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_int_equal(msim_sim_break(sim, 1, top, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "no law of the scene has break_strain"));
  msim_sim_destroy(sim);
  add_linear(scene, never, 0);
  sim = make_sim(scene, &opt);
  assert_int_equal(msim_sim_break(sim, 1, &beyond, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "springs[0] is 8; there are 8 springs"));
  assert_int_equal(msim_sim_break(sim, -1, top, &why), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_break(sim, 1, NULL, &why), MSIM_ERR_ARG);
  assert_ok(msim_sim_step(sim, 10, err));
  assert_ok(msim_sim_break(sim, 3, top, err));
  assert_int_equal(stats_of(sim).broken, 2);
  assert_ok(msim_sim_step(sim, 100, err));
  double sum = 0;
  for (int32_t p = 1; p <= LINKS; p++) sum += state_of(sim).v[3 * p + 2];
  assert_close(sum / LINKS, -8 * 0.1, 1e-9);
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

/* The factor of the matrix with all springs is not used once some are broken. */
static void lagged_factors_are_discarded(void **state) {
  (void)state;
  require(is_solver_available("cholmod"), "the solver cholmod");
  const int32_t some[3] = {20, 71, 200};
  msim_scene *scene = pinned_block(5, 1, 1e8, 0);
  add_linear(scene, never, 0);
  const msim_scene_view s = view_of(scene);
  const size_t bytes = 3 * (size_t)s.nparticles * sizeof(double);
  double *k = malloc((size_t)s.nsprings * sizeof *k);
  const msim_options opt = options("linearly-implicit-euler", 1e-2);
  msim_sim *sim = make_sim(scene, &opt), *softer = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 10, err));
  assert_in_range(stats_of(sim).kept_factors, 5, 9);
  const msim_state now = state_of(sim);
  memcpy(k, s.k, (size_t)s.nsprings * sizeof *k);
  for (int i = 0; i < 3; i++) k[some[i]] = 0;
  assert_ok(msim_sim_set_springs(softer, k, NULL, NULL, err));
  assert_ok(msim_sim_set_state(softer, &now, err));
  assert_ok(msim_sim_break(sim, 3, some, err));
  for (int i = 0; i < 3; i++) {
    assert_ok(msim_sim_step(sim, 1, err));
    assert_ok(msim_sim_step(softer, 1, err));
    assert_memory_equal(state_of(sim).x, state_of(softer).x, bytes);
    assert_memory_equal(state_of(sim).v, state_of(softer).v, bytes);
  }
  free(k);
  msim_sim_destroy(sim), msim_sim_destroy(softer), msim_scene_destroy(scene);
}

/* A chain that is exactly at rest, so that its steps are skipped, falls once its top spring is
 * broken. */
static void resting_islands_wake(void **state) {
  (void)state;
  const double x[6] = {0, 0, 0, 0, 0, -0.125}, mass[2] = {0.25, 0.25}, k = 64, rest = 0.09375;
  const double gravity[3] = {0, 0, -8};
  const int32_t ij[2] = {0, 1}, top = 0;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  assert_ok(msim_scene_pin(scene, 1, &top, err));
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  add_linear(scene, never, 0);
  const msim_options opt = options("symplectic-euler", 1.0 / 64);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 8, err));
  assert_in_range(stats_of(sim).steps_at_rest, 1, 8);
  assert_ok(msim_sim_break(sim, 1, &top, err));
  assert_ok(msim_sim_step(sim, 8, err));
  assert_true(state_of(sim).v[5] == -1);
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

/* What depends on the stiffest spring, such as the number of stages of rkc, follows when that
 * breaks; so does the matrix that the program gets. */
static void bounds_and_matrices_follow(void **state) {
  (void)state;
  const char *const methods[] = {"rkc", "implicit-euler"};
  const int32_t ij[2] = {1, 3}, stiff = LINKS;
  const double k_stiff = 1e6;
  double k[LINKS + 1];
  msim_scene *scene = hanging_chain(0.25, 64, 8);
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k_stiff, NULL, NULL, err));
  add_linear(scene, never, 0);
  for (int32_t e = 0; e <= LINKS; e++) k[e] = e == stiff ? 0 : view_of(scene).k[e];
  for (int i = 0; i < 2; i++) {
    const msim_options opt = options(methods[i], 1e-2);
    msim_sim *sim = make_sim(scene, &opt), *softer = make_sim(scene, &opt);
    msim_csr A = {.size = sizeof A}, B = A;
    if (i) assert_ok(msim_sim_matrix(sim, &A, err));
    assert_ok(msim_sim_set_springs(softer, k, NULL, NULL, err));
    assert_ok(msim_sim_break(sim, 1, &stiff, err));
    if (i) {
      assert_ok(msim_sim_matrix(sim, &A, err));
      assert_ok(msim_sim_matrix(softer, &B, err));
      assert_int_equal(A.rowptr[A.n], B.rowptr[B.n]);
      assert_memory_equal(A.val, B.val, (size_t)A.rowptr[A.n] * sizeof *A.val);
    }
    const int64_t before = stats_of(sim).force_evaluations;
    const int64_t others = stats_of(softer).force_evaluations;
    assert_ok(msim_sim_step(sim, 5, err));
    assert_ok(msim_sim_step(softer, 5, err));
    assert_int_equal(stats_of(sim).force_evaluations - before,
                     stats_of(softer).force_evaluations - others);
    assert_memory_equal(state_of(sim).x, state_of(softer).x, 3 * (LINKS + 1) * sizeof(double));
    msim_sim_destroy(sim), msim_sim_destroy(softer);
  }
  msim_scene_destroy(scene);
}

/* Resumed sims and clones have the preconditioner that was chosen for all springs, also once they
 * are broken. */
static void copies_keep_the_coarse_space(void **state) {
  (void)state;
  msim_scene *scene = pinned_block(9, 1, 3000, 0);
  add_linear(scene, never, 0);
  const int32_t n = view_of(scene).nsprings;
  const msim_options opt = options("linearly-implicit-euler", 1.0 / 60);
  msim_sim *sim = make_sim(scene, &opt);
  int32_t *all = malloc((size_t)n * sizeof *all);
  for (int32_t e = 0; e < n; e++) all[e] = e;
  assert_ok(msim_sim_break(sim, n, all, err));
  assert_ok(msim_sim_step(sim, 3, err));
  const checkpoint c = save(sim);
  msim_sim *copies[2] = {resume(scene, &opt, &c)};
  assert_ok(msim_sim_clone(sim, &copies[1], err));
  assert_ok(msim_sim_step(sim, 2, err));
  for (int i = 0; i < 2; i++) {
    const char *text;
    assert_ok(msim_sim_explain(copies[i], &text, err));
    assert_non_null(strstr(text, "iterations with a coarse space"));
    expect_same_end(sim, copies[i], 2, i ? "clone" : "resumed");
    msim_sim_destroy(copies[i]);
  }
  free(c.bytes), free(all);
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

static void scene_files_have_thresholds(void **state) {
  (void)state;
  static const char text[] =
      "{\"msim\": 1, \"particles\": {\"x\": [[0,0,0],[1,0,0],[2,0,0]], \"mass\": 1},"
      "\"laws\": [{\"type\": \"linear\", \"break_strain\": 0.25},"
      "{\"type\": \"tension\", \"break_force\": 7, \"break_strain\": 0.5}],"
      "\"springs\": {\"ij\": [[0,1],[1,2]], \"k\": 10, \"law\": [1, 2]}}";
  const char *const files[] = {"test_breaking.json", "test_breaking.h5"};
  msim_scene *scene, *again;
  assert_ok(msim_scene_parse(NULL, "text", text, sizeof text - 1, &scene, err));
  assert_ok(msim_scene_set_drag(scene, 0.5, err)); /* the text is no longer that of the scene */
  for (int i = 0; i < 2; i++) {
    msim_error why;
    if (msim_scene_save(scene, files[i], &why) != MSIM_OK && i) continue; /* without HDF5 */
    assert_ok(msim_scene_load(NULL, files[i], &again, err));
    msim_law law = {.size = sizeof law};
    assert_int_equal(view_of(again).nlaws, 2);
    assert_int_equal(msim_scene_get_law(again, 1, &law), MSIM_OK);
    assert_true(law.kind == MSIM_LAW_LINEAR && law.break_strain == 0.25 && law.break_force == 0);
    assert_int_equal(msim_scene_get_law(again, 2, &law), MSIM_OK);
    assert_true(law.kind == MSIM_LAW_TENSION && law.break_strain == 0.5 && law.break_force == 7);
    assert_int_equal(view_of(again).law[0], 1);
    assert_int_equal(view_of(again).law[1], 2);
    msim_scene_destroy(again);
    remove(files[i]);
  }
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(chains_break_where_tension_is_too_large),
                                     cmocka_unit_test(oscillators_break_in_time),
                                     cmocka_unit_test(negative_energy_is_work),
                                     cmocka_unit_test(springs_are_broken_by_hand),
                                     cmocka_unit_test(lagged_factors_are_discarded),
                                     cmocka_unit_test(resting_islands_wake),
                                     cmocka_unit_test(bounds_and_matrices_follow),
                                     cmocka_unit_test(copies_keep_the_coarse_space),
                                     cmocka_unit_test(scene_files_have_thresholds)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
