/* Tests of runs with forces that the program computes: what a call gets, threads, checkpoints and
 * clones, impacts, and refusals. */
#include <math.h>
#include <pthread.h>

#include "checkpoints.h"
#include "force_functions.h"
#include "state_hash.h"

enum { T = MSIM_FORCE_TIME, V = MSIM_FORCE_VELOCITY, J = MSIM_FORCE_JACOBIAN };

/*------------------------------------- calls ----------------------------------------------------*/

enum { LENGTH = 600, ROPES = 4, ALL = LENGTH * ROPES };

/* What a function saw */
typedef struct record {
  pthread_t thread;
  int32_t calls, seen[ALL];
  double last_t;
} record;

static int32_t record_call(void *data, const msim_force_batch *b) {
  record *r = data;
  assert_true(pthread_equal(r->thread, pthread_self()));
  assert_int_equal(b->size, sizeof *b);
  assert_null(b->v);
  assert_true(!b->dfdx == !b->dfdv);
  for (int32_t i = 0; i < b->n; i++) {
    assert_true(i == 0 || b->particles[i] > b->particles[i - 1]);
    assert_true(b->particles[i] / LENGTH == b->particles[0] / LENGTH); /* of one rope */
    assert_true(b->particles[i] % LENGTH != 0);                        /* not pinned */
    r->seen[b->particles[i]]++;
    for (int c = 0; c < 3; c++) {
      assert_true(b->f[3 * i + c] == 0);
      b->f[3 * i + c] = sin(b->particles[i] + b->t);
    }
  }
  r->calls++, r->last_t = b->t;
  return 0;
}

/* Ropes whose first particle is pinned, long enough to be islands of their own */
static msim_scene *long_ropes(void) {
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  const int32_t pinned = 0;
  for (int i = 0; i < ROPES; i++) {
    const msim_rope rope = {.size = sizeof rope,
                            .n = LENGTH,
                            .from = {0, i, 0},
                            .to = {1, i, 0.2 * i},
                            .mass = 1,
                            .k = 2,
                            .npinned = 1,
                            .pinned = &pinned};
    assert_ok(msim_scene_add_rope(scene, &rope, err));
  }
  return scene;
}

/* Each island is computed by itself, from the caller's thread, whatever the number of threads. */
static void calls_have_one_island(void **state) {
  (void)state;
  const char *const methods[] = {"velocity-verlet", "implicit-euler", "dop853"};
  for (int i = 0; i < 3; i++) {
    uint64_t hash = 0;
    for (int threads = 1; threads <= 3; threads++) {
      record r = {.thread = pthread_self()};
      const msim_force_function is = {
          .size = sizeof is, .flags = T | J, .name = "r", .evaluate = record_call, .data = &r};
      msim_scene *scene = long_ropes();
      assert_ok(msim_scene_set_force_function(scene, &is, err));
      msim_options opt = options(methods[i], 0.01);
      opt.threads = threads;
      msim_sim *sim = make_sim(scene, &opt);
      assert_ok(msim_sim_step(sim, 20, err));
      for (int32_t p = 0; p < ALL; p++) assert_int_equal(r.seen[p] > 0, p % LENGTH != 0);
      assert_true(r.calls % ROPES == 0 || i == 1);
      assert_close(r.last_t, 0.2, 1e-12);
      if (threads > 1) assert_true(hash == hash_sim(sim));
      hash = hash_sim(sim);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
  }
}

/* Also where rows are split and springs have laws, each sweep has the constant forces and that of
 * the function once: springs are at rest here. */
static void forces_reach_all_rows(void **state) {
  (void)state;
  enum { N = 600 };
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int32_t p = 0; p < N; p++) {
    const double x[3] = {p * 0.01, 1, 2}, mass = 2;
    assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
    const int32_t ij[2] = {0, p};
    const double k = 5;
    if (p) assert_ok(msim_scene_add_springs(scene, 1, ij, &k, NULL, NULL, err));
  }
  const msim_law law = {.size = sizeof law, .kind = MSIM_LAW_TENSION};
  assert_ok(msim_scene_add_law(scene, &law, NULL, err));
  for (int32_t e = 0; e < N - 1; e += 3) assert_ok(msim_scene_set_law(scene, 1, &e, 1, err));
  field of = {.push = {3, -4, 5}, .omega = 1};
  set_field(scene, &of, T);
  double constant[3 * N] = {0};
  for (int32_t i = 0; i < 3 * N; i++) constant[i] = i % 7;
  assert_ok(msim_scene_set_forces(scene, constant, err));
  const msim_options opt = options("symplectic-euler", 0.125);
  msim_sim *sim = make_sim(scene, &opt);
  double force[3 * N], x[3 * N], zero[3 * N] = {0};
  memcpy(x, state_of(sim).x, sizeof x);
  assert_ok(msim_sim_step(sim, 1, err)); /* the function's force is 0 at t = 0 */
  for (int32_t i = 0; i < 3 * N; i++)
    assert_close(state_of(sim).v[i], constant[i] * 0.125 / 2, 1e-15);
  for (int again = 0; again < 2; again++) { /* at t = 0.125 */
    msim_sim_force(sim, x, zero, force);
    for (int32_t i = 0; i < 3 * N; i++)
      assert_close(force[i], constant[i] + of.push[i % 3] * sin(0.125), 1e-13);
  }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* An island at rest is stepped where forces depend on time; others rest, and are skipped. */
static void resting_islands_wake(void **state) {
  (void)state;
  const double zero[3] = {0};
  for (int by_time = 0; by_time < 2; by_time++) {
    field of = {.k = 5, .push = {by_time, 0, 0}, .omega = 1};
    msim_scene *scene = make_single_particle(zero, zero, 0);
    set_field(scene, &of, by_time ? T : 0);
    const msim_options opt = options("symplectic-euler", 0.25);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 8, err));
    assert_int_equal(state_of(sim).x[0] > 0.1, by_time);
    assert_int_equal(stats_of(sim).steps_at_rest > 0, !by_time);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- checkpoints ----------------------------------------------*/

static void runs_are_resumable(void **state) {
  (void)state;
  const char *method;
  const int64_t at[] = {3, 61, 110}, early[] = {2, 9};
  for (int32_t i = 0; (method = method_at(i)) != NULL; i++) {
    if (!takes_functions(method)) continue;
    field of = gusts;
    msim_scene *scene = hanging_cloth(5, 50, takes_positions_only(method) ? 0 : 0.02);
    set_field(scene, &of, flags_for(method));
    msim_options opt = options(method, strcmp(method, "explicit-euler") ? 1e-3 : 1e-4);
    opt.threads = 1 + i % 2;
    expect_resumable(scene, &opt, 150, 3, at, method);
    opt.tol = 1e-4, opt.steps = -1, opt.t_end = 1;
    expect_resumable(scene, &opt, 14, 2, early, method);
    msim_scene_destroy(scene);
  }
}

/* A lagged factor would hold derivatives of an earlier call, which no checkpoint has. */
static void factors_are_not_lagged(void **state) {
  (void)state;
  field of = {.k = 10};
  const int64_t at[2] = {3, 8};
  msim_scene *scene = pinned_block(5, 1, 1e8, 0);
  msim_options opt = options("linearly-implicit-euler", 1e-2);
  opt.solver_rtol = 1e-10;
  set_field(scene, &of, J);
  const msim_stats made = expect_resumable(scene, &opt, 12, 2, at, "stiff block");
  assert_int_equal(made.kept_factors, 0);
  msim_scene_destroy(scene);
}

static void other_functions_are_refused(void **state) {
  (void)state;
  field of = gusts;
  msim_force_function is = field_function(&of, T | V);
  msim_scene *scene = hanging_cloth(4, 50, 0), *none = hanging_cloth(4, 50, 0);
  assert_ok(msim_scene_set_force_function(scene, &is, err));
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt), *without = make_sim(none, &opt);
  const checkpoint c = save(sim), d = save(without);
  is.name = "storm";
  assert_ok(msim_scene_set_force_function(scene, &is, err));
  msim_sim *other = make_sim(scene, &opt);
  msim_error why;
  assert_int_equal(msim_sim_load(other, c.bytes, c.length, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text,
                      "the force function is storm (flags 3, bounds 0 N/m and 0 N s/m) here and "
                      "field (flags 3, bounds 0 N/m and 0 N s/m) in the checkpoint");
  assert_int_equal(msim_sim_load(without, c.bytes, c.length, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "the force function is not given here and field"));
  assert_int_equal(msim_sim_load(other, d.bytes, d.length, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "the force function is storm"));
  free(c.bytes), free(d.bytes);
  msim_sim_destroy(sim), msim_sim_destroy(other), msim_sim_destroy(without);
  msim_scene_destroy(scene), msim_scene_destroy(none);
}

/* Pins, forces and springs may be changed while a function acts. */
static void sims_may_be_changed(void **state) {
  (void)state;
  field of = gusts;
  msim_scene *scene = hanging_cloth(4, 50, 0.01);
  set_field(scene, &of, T | V | J);
  const msim_options opt = options("implicit-euler", 1e-3);
  msim_sim *sim = make_sim(scene, &opt), *copy;
  const int32_t corner = 0;
  double force[48] = {0}, k[200];
  msim_scene_view view = {.size = sizeof view};
  assert_int_equal(msim_scene_get(scene, &view), MSIM_OK);
  assert_string_equal(view.force_function->name, "field");
  for (int i = 0; i < view.nsprings; i++) k[i] = 80;
  force[47] = 1;
  assert_ok(msim_sim_step(sim, 10, err));
  assert_ok(msim_sim_set_pinned(sim, 1, &corner, 0, err));
  assert_ok(msim_sim_set_forces(sim, force, err));
  assert_ok(msim_sim_set_springs(sim, k, NULL, NULL, err));
  assert_ok(msim_sim_step(sim, 10, err));
  assert_ok(msim_sim_clone(sim, &copy, err));
  assert_ok(msim_sim_step(sim, 10, err));
  assert_ok(msim_sim_step(copy, 10, err));
  expect_same_save(sim, copy, "a changed sim");
  msim_sim_destroy(sim), msim_sim_destroy(copy);
  msim_scene_destroy(scene);
}

/*------------------------------------- planes ---------------------------------------------------*/

/* x'' = -push at a plane, with impacts located: the same as gravity of that size. */
static int32_t fall(void *data, const msim_force_batch *b) {
  (void)data;
  for (int32_t i = 0; i < b->n; i++) b->f[3 * i + 2] = -9.81;
  return 0;
}

static void impacts_are_located(void **state) {
  (void)state;
  const char *const methods[] = {"velocity-verlet", "dop853", "implicit-midpoint"};
  const double x[3] = {0, 0, 1}, v[3] = {1, 0, 0};
  for (int i = 0; i < 3; i++) {
    msim_scene *scenes[] = {make_single_particle(x, v, 9.81), make_single_particle(x, v, 0)};
    const msim_force_function is = {.size = sizeof is, .name = "g", .evaluate = fall};
    msim_sim *sims[2];
    msim_options opt = options(methods[i], 1e-2);
    opt.collision = MSIM_COLLISION_EVENT;
    assert_ok(msim_scene_set_force_function(scenes[1], &is, err));
    for (int k = 0; k < 2; k++) {
      plane(scenes[k], 0, 0, 1, 0, 0.6, 0.1);
      sims[k] = make_sim(scenes[k], &opt);
      assert_ok(msim_sim_step(sims[k], 300, err));
    }
    assert_true(stats_of(sims[1]).contacts > 2);
    for (int c = 0; c < 3; c++) assert_close(state_of(sims[0]).x[c], state_of(sims[1]).x[c], 1e-9);
    for (int k = 0; k < 2; k++) msim_sim_destroy(sims[k]), msim_scene_destroy(scenes[k]);
  }
}

/*------------------------------------- refusals -------------------------------------------------*/

static void expect_refused(msim_force_function is, const char *sentence) {
  msim_scene *scene = hanging_cloth(2, 50, 0);
  msim_error why;
  assert_int_equal(msim_scene_set_force_function(scene, &is, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text, sentence);
  msim_scene_destroy(scene);
}

static void bad_functions_are_refused(void **state) {
  (void)state;
  field of = gusts;
  const char too_long[65] = "0123456789012345678901234567890123456789012345678901234567890123";
  msim_force_function is = field_function(&of, 8);
  expect_refused(is, "flags is 8; it must be a sum of MSIM_FORCE_... flags");
  is = field_function(&of, T), is.potential = field_potential;
  expect_refused(is,
                 "potential is set, but the force depends on time; remove the potential, and "
                 "the work of the force is integrated");
  is = field_function(&of, 0), is.evaluate = NULL;
  expect_refused(is, "evaluate is NULL");
  const char *const names[] = {NULL, "", too_long, "a\nb"};
  const char *const found[] = {"NULL", "empty", "longer than that", "of several lines"};
  for (int i = 0; i < 4; i++) {
    char text[200];
    is = field_function(&of, 0), is.name = names[i];
    snprintf(text, sizeof text,
             "name of the force function is %s; it must have 1 to 63 bytes and no line ends",
             found[i]);
    expect_refused(is, text);
  }
  is = field_function(&of, 0), is.largest_stiffness = -1;
  expect_refused(is, "largest_stiffness is -1; it must be a finite number >= 0");
  is = field_function(&of, 0), is.largest_damping = INFINITY;
  expect_refused(is, "largest_damping is inf; it must be a finite number >= 0");
  msim_error why;
  is.size = 8;
  msim_scene *scene = hanging_cloth(2, 50, 0);
  assert_int_equal(msim_scene_set_force_function(scene, &is, &why), MSIM_ERR_SIZE);
  is = field_function(&of, 0);
  assert_ok(msim_scene_set_force_function(scene, &is, err));
  assert_int_equal(msim_scene_save(scene, "test_force_function_runs.json", &why),
                   MSIM_ERR_UNSUPPORTED);
  assert_string_equal(why.text,
                      "force function 'field' is part of the program, and scene files "
                      "cannot represent it; remove it before the scene is saved");
  assert_ok(msim_scene_set_force_function(scene, NULL, err));
  assert_ok(msim_scene_save(scene, "test_force_function_runs.json", err));
  remove("test_force_function_runs.json");
  msim_scene_destroy(scene);
}

static void expect_refused_sim(uint32_t flags, const char *method, const char *sentence) {
  field of = gusts;
  msim_scene *scene = hanging_cloth(2, 50, 0);
  set_field(scene, &of, flags);
  msim_options opt = options(method, 1e-3);
  if (strcmp(method, "auto") == 0) opt.t_end = 1;
  msim_sim *sim;
  msim_error why;
  assert_int_equal(msim_sim_create(scene, &opt, &sim, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text, sentence);
  msim_scene_destroy(scene);
}

static void unfit_methods_are_refused(void **state) {
  (void)state;
  const char *const methods[] = {"auto",   "respa", "takahashi-imada",
                                 "verlet", "rkn6",  "force-gradient"};
  for (int i = 0; i < 6; i++) {
    char text[300];
    snprintf(text, sizeof text,
             "integrator '%s' does not support force function 'field'%s; use dop853, "
             "velocity-verlet or implicit-midpoint, or remove the function",
             methods[i], i < 4 ? "" : ", which depends on velocities");
    expect_refused_sim(i < 4 ? 0 : V, methods[i], text);
  }
}

static void sims_explain_functions(void **state) {
  (void)state;
  field of = gusts;
  msim_force_function is = field_function(&of, T | V);
  const char *const lines[] = {
      "force function 'field' of x, t, v; without derivatives, which count as 0; its work is "
      "integrated\n",
      "force function 'field' of x; derivatives in the matrix; its potential is part of the "
      "energy\n"};
  for (int i = 0; i < 2; i++) {
    msim_scene *scene = hanging_cloth(2, 50, 0);
    const char *text;
    if (i) is.flags = J, is.potential = field_potential;
    assert_ok(msim_scene_set_force_function(scene, &is, err));
    const msim_options opt = options("implicit-euler", 1e-3);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_explain(sim, &text, err));
    assert_non_null(strstr(text, lines[i]));
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(calls_have_one_island),     cmocka_unit_test(forces_reach_all_rows),
      cmocka_unit_test(resting_islands_wake),      cmocka_unit_test(runs_are_resumable),
      cmocka_unit_test(factors_are_not_lagged),    cmocka_unit_test(other_functions_are_refused),
      cmocka_unit_test(sims_may_be_changed),       cmocka_unit_test(impacts_are_located),
      cmocka_unit_test(bad_functions_are_refused), cmocka_unit_test(unfit_methods_are_refused),
      cmocka_unit_test(sims_explain_functions),
  };
  return cmocka_run_group_tests_name("force_function_runs", tests, NULL, NULL);
}
