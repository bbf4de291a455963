/* Tests of springs of rest length 0: one scalar matrix and one factorization for a whole run, and
 * the same motion as with the general matrix. */
#include <math.h>
#include <string.h>

#include "counting_allocator.h"
#include "scenes.h"
#include "sim/sim.h"

enum { SIDE = 8, N = SIDE * SIDE, MOST = 6 * N };

static const char *const solvers[] = {
    "auto", "pcg", "cholmod", "klu", "sundials-pcg", "sundials-spgmr", "sundials-spbcgs"};
enum { NSOLVERS = sizeof solvers / sizeof *solvers };
static const double zeros[MOST];

/* A hanging cloth of springs of rest length 0; flat: gravity lies in its plane. */
static msim_scene *zero_rest_cloth(const msim_allocator *alloc, int flat) {
  const int32_t corners[2] = {0, SIDE - 1};
  const double g[3] = {0, flat ? -9.81 : 0.5, flat ? 0 : -9.81};
  msim_scene *like = hanging_cloth(SIDE, 100, 0), *scene;
  msim_scene_view view = {.size = sizeof view};
  double mass[N];
  for (int p = 0; p < N; p++) mass[p] = 0.01 + 0.001 * (p % 7);
  msim_scene_get(like, &view);
  assert_in_range(view.nsprings, 1, MOST);
  assert_ok(msim_scene_create(alloc, &scene, err));
  assert_ok(msim_scene_add_particles(scene, N, view.x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, view.nsprings, view.ij, view.k, zeros, NULL, err));
  assert_ok(msim_scene_pin(scene, 2, corners, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  assert_ok(msim_scene_set_drag(scene, 0.01, err));
  msim_scene_destroy(like);
  return scene;
}

static msim_sim *sim_with(const msim_scene *scene, const char *method, const char *solver,
                          int general) {
  msim_options opt = options(method, strcmp(method, "linearly-implicit-euler") ? 1e-3 : 0.05);
  opt.solver = solver, opt.solver_rtol = 1e-12;
  if (general) assert_ok(msim_options_set(&opt, "skip.zero_rest_length", "off", err));
  return make_sim(scene, &opt);
}

static msim_sim *implicit(const msim_scene *scene, const char *solver, int general) {
  return sim_with(scene, "linearly-implicit-euler", solver, general);
}

static void same_motion(msim_sim *a, msim_sim *b, double tolerance) {
  const msim_state s = state_of(a), t = state_of(b);
  for (int i = 0; i < 3 * N; i++) {
    assert_close(s.x[i], t.x[i], tolerance);
    assert_close(s.v[i], t.v[i], 100 * tolerance);
  }
}

/* One assembly and one factorization for any number of steps; further ones only after a change of h
 * or k. */
static void one_factorization_serves_a_run(void **state) {
  (void)state;
  for (int i = 0; i < 2 * NSOLVERS; i++) {
    const char *solver = solvers[i / 2];
    if (i > 1 && !is_solver_available(solver)) continue;
    msim_scene *scene = zero_rest_cloth(NULL, i % 2);
    msim_sim *lean = implicit(scene, solver, 0), *general = implicit(scene, solver, 1);
    assert_int_equal(lean->islands->stepper.solver->system.a.block, 1);
    assert_int_equal(general->islands->stepper.solver->system.a.block, 3 - i % 2);
    const int factorizes = lean->islands->stepper.solver->linear->factorizes;
    assert_ok(msim_sim_step(lean, 40, err));
    assert_ok(msim_sim_step(general, 40, err));
    same_motion(lean, general, 1e-10);
    msim_stats s = stats_of(lean);
    assert_int_equal(s.assemblies, 1);
    assert_int_equal(s.factorizations, factorizes);
    assert_int_equal(s.solves, 40);
    assert_int_equal(s.refinements + s.kept_factors + s.fallbacks + s.indefinite_steps, 0);

    msim_state now = state_of(lean);
    assert_ok(msim_sim_set_state(lean, &now, err));
    assert_ok(msim_sim_step(lean, 1, err));
    assert_int_equal(stats_of(lean).assemblies, 1);
    assert_ok(msim_sim_set_step(lean, 0.02, err));
    assert_ok(msim_sim_set_step(general, 0.02, err));
    assert_ok(msim_sim_step(general, 11, err));
    assert_ok(msim_sim_step(lean, 10, err));
    double k[MOST];
    for (int e = 0; e < MOST; e++) k[e] = 30 + e % 3;
    assert_ok(msim_sim_set_springs(lean, k, NULL, NULL, err));
    assert_ok(msim_sim_step(lean, 10, err));
    s = stats_of(lean);
    assert_int_equal(s.assemblies, 3);
    assert_int_equal(s.factorizations, 3 * factorizes);
    assert_true(s.analyses <= 1);
    msim_sim_destroy(lean), msim_sim_destroy(general);
    msim_scene_destroy(scene);
  }
}

/* The force factor k (l - 0)/l is k, up to rounding. */
static void forces_are_the_same(void **state) {
  (void)state;
  static const char *const methods[] = {"heun", "verlet", "velocity-verlet", "rk4"};
  for (int i = 0; i < 8; i++) {
    msim_scene *scene = zero_rest_cloth(NULL, i % 2);
    msim_sim *lean = sim_with(scene, methods[i / 2], "pcg", 0);
    msim_sim *general = sim_with(scene, methods[i / 2], "pcg", 1);
    assert_ok(msim_sim_step(lean, 300, err));
    assert_ok(msim_sim_step(general, 300, err));
    same_motion(lean, general, 1e-12);
    msim_sim_destroy(lean), msim_sim_destroy(general);
    msim_scene_destroy(scene);
  }
}

/* One spring with a rest length or a damping makes the matrix general, unless both its ends are
 * pinned. */
static void one_general_spring_is_detected(void **state) {
  (void)state;
  const double k = 1, some = 1e-300, none = 0;
  const int32_t free_pair[2] = {0, 9}, pinned_pair[2] = {0, SIDE - 1};
  for (int which = 0; which < 3; which++) {
    msim_scene *scene = zero_rest_cloth(NULL, 0);
    assert_ok(msim_scene_add_springs(scene, 1, which == 2 ? pinned_pair : free_pair, &k,
                                     which == 1 ? &none : &some, which == 1 ? &some : &none, err));
    msim_sim *sim = implicit(scene, "pcg", 0);
    assert_int_equal(sim->islands->stepper.solver->system.a.block, which == 2 ? 1 : 3);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* Springs whose rest lengths become nonzero or 0 in mid-run. */
static void springs_may_change_their_kind(void **state) {
  (void)state;
  double rest[MOST], damping[MOST];
  for (int e = 0; e < MOST; e++) rest[e] = 0.1, damping[e] = 0.001;
  for (int i = 1; i < NSOLVERS; i++) {
    if (!is_solver_available(solvers[i])) continue;
    msim_scene *scene = zero_rest_cloth(NULL, 0);
    msim_sim *lean = implicit(scene, solvers[i], 0), *general = implicit(scene, solvers[i], 1);
    const double *const rests[] = {rest, zeros, NULL}, *const dampings[] = {NULL, NULL, damping};
    for (int change = 0; change < 3; change++) {
      assert_ok(msim_sim_step(lean, 10, err));
      assert_ok(msim_sim_step(general, 10, err));
      assert_ok(msim_sim_set_springs(lean, NULL, rests[change], dampings[change], err));
      assert_ok(msim_sim_set_springs(general, NULL, rests[change], dampings[change], err));
      assert_int_equal(lean->islands->stepper.solver->system.a.block, change == 1 ? 1 : 3);
    }
    assert_ok(msim_sim_step(lean, 10, err));
    assert_ok(msim_sim_step(general, 10, err));
    same_motion(lean, general, 1e-9);
    msim_scene_view view = {.size = sizeof view};
    msim_scene_get(scene, &view);
    assert_true(view.rest[0] == 0); /* the scene itself is unchanged */
    msim_sim_destroy(lean), msim_sim_destroy(general);
    msim_scene_destroy(scene);
  }
}

/* If memory runs out while the solver is replaced, springs and motion stay as they were. */
static void a_change_that_fails_changes_nothing(void **state) {
  (void)state;
  double rest[MOST];
  for (int e = 0; e < MOST; e++) rest[e] = 0.1;
  counting_allocator b = {.fail_at = -1};
  const msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free,
                                &b};
  msim_scene *scene = zero_rest_cloth(&alloc, 0);
  msim_sim *sim = implicit(scene, "pcg", 0), *other = implicit(scene, "pcg", 0);
  const int64_t live = b.live;
  int64_t failures = 0;
  for (b.fail_at = b.calls; msim_sim_set_springs(sim, NULL, rest, NULL, NULL);
       b.fail_at = b.calls + failures) {
    failures++;
    assert_int_equal(b.live, live);
    assert_ok(msim_sim_step(sim, 1, err));
    assert_ok(msim_sim_step(other, 1, err));
    assert_memory_equal(state_of(sim).x, state_of(other).x, 3 * N * sizeof(double));
    assert_int_equal(stats_of(sim).assemblies, 1);
  }
  assert_in_range(failures, 10, 100);
  assert_int_equal(sim->islands->stepper.solver->system.a.block, 3);
  msim_sim_destroy(sim), msim_sim_destroy(other);
  msim_scene_destroy(scene);
  assert_int_equal(b.live, 0);
}

/* msim_sim_matrix() returns the matrix of three components; msim_sim_explain() states the
 * reason. */
static void the_matrix_and_the_reason_are_told(void **state) {
  (void)state;
  msim_scene *scene = zero_rest_cloth(NULL, 0);
  msim_sim *lean = implicit(scene, "pcg", 0), *general = implicit(scene, "pcg", 1);
  msim_csr A = {.size = sizeof A}, B = {.size = sizeof B};
  const char *text;
  assert_ok(msim_sim_matrix(lean, &A, err));
  assert_ok(msim_sim_matrix(general, &B, err));
  assert_int_equal(A.n, 3 * (N - 2));
  assert_int_equal(A.rowptr[A.n], B.rowptr[B.n]);
  for (int32_t e = 0; e < A.rowptr[A.n]; e++) assert_true(A.val[e] == B.val[e]);
  assert_null(lean->islands->stepper.solver->system.a.g);
  assert_ok(msim_sim_explain(lean, &text, err));
  assert_non_null(strstr(text, "all rest lengths and dampings are 0"));
  assert_non_null(strstr(text, "62 unknowns, one per free particle, and 3 right-hand sides"));
  assert_ok(msim_sim_explain(general, &text, err));
  assert_null(strstr(text, "all rest lengths"));
  msim_sim_destroy(lean), msim_sim_destroy(general);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(one_factorization_serves_a_run),
                                     cmocka_unit_test(forces_are_the_same),
                                     cmocka_unit_test(one_general_spring_is_detected),
                                     cmocka_unit_test(springs_may_change_their_kind),
                                     cmocka_unit_test(a_change_that_fails_changes_nothing),
                                     cmocka_unit_test(the_matrix_and_the_reason_are_told)};
  return cmocka_run_group_tests_name("zero_rest", tests, NULL, NULL);
}
