/* Tests of constant forces on particles, and of gravity, drag and forces that are changed in a
 * running sim: forces against formulas and against gravity, steps after a change against a new sim,
 * the energy balance, checkpoints, and refused input. */
#include <math.h>
#include <stdio.h>

#include "checkpoints.h"
#include "state_hash.h"

enum { SIDE = 5, N = SIDE * SIDE };

static const double zero[3];

/* Pairwise different, of the size of the weights */
static void fill_forces(double *force, int32_t n, double scale) {
  for (int32_t i = 0; i < 3 * n; i++) force[i] = scale * cos(1.7 * i + 0.3);
}

static msim_scene *cloth_with_forces(const char *method, double scale) {
  double force[3 * N];
  msim_scene *scene = hanging_cloth(SIDE, 300, takes_positions_only(method) ? 0 : 0.01);
  fill_forces(force, N, scale);
  assert_ok(msim_scene_set_forces(scene, force, err));
  return scene;
}

static msim_scene_view view_of(const msim_scene *scene) {
  msim_scene_view view = {.size = sizeof view};
  assert_int_equal(msim_scene_get(scene, &view), MSIM_OK);
  return view;
}

/* auto, then all methods */
static const char *method_or_auto(int32_t i) { return i ? method_at(i - 1) : "auto"; }

/* Fixed steps, or a tolerance for dop853, up to t = 1 s. */
static msim_options run_options(const char *method, int controlled) {
  msim_options opt = options(method, 1.0 / 1024);
  if (controlled) opt.tol = 1e-4, opt.steps = -1, opt.t_end = 1;
  else if (strcmp(method, "auto") == 0) opt.tol = 1e-3, opt.t_end = 1;
  else opt.steps = 1024;
  return opt;
}

/*------------------------------------- the force ------------------------------------------------*/

/* Force of a spring without damping: k (l - rest) d/l on i */
static void add_spring_forces(const msim_scene_view *s, const double *x, double *f) {
  for (int32_t e = 0; e < s->nsprings; e++) {
    const int32_t i = s->ij[2 * e], j = s->ij[2 * e + 1];
    double d[3], l = 0;
    for (int c = 0; c < 3; c++) d[c] = x[3 * j + c] - x[3 * i + c], l += d[c] * d[c];
    l = sqrt(l);
    for (int c = 0; c < 3; c++) {
      f[3 * i + c] += s->k[e] * (l - s->rest[e]) * d[c] / l;
      f[3 * j + c] -= s->k[e] * (l - s->rest[e]) * d[c] / l;
    }
  }
}

/* A particle with many springs, whose row is split, in the middle of a sphere of others */
static msim_scene *hub(int32_t n) {
  const double mass = 0.1, k = 10, rest = 0.5, g[3] = {0, 0, -9.81};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int32_t i = 0; i < n; i++) {
    const double x[3] = {i ? cos(i) : 0, i ? sin(i) : 0, i ? 0.01 * i : 0};
    const int32_t ij[2] = {0, i};
    assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
    if (i) assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  }
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

static void expect_forces(msim_scene *scene, const char *method) {
  enum { MOST = 400 };
  double force[3 * MOST], expected[3 * MOST], there[3 * MOST];
  const msim_options opt = options(method, 1e-4);
  fill_forces(force, view_of(scene).nparticles, 0.3);
  assert_ok(msim_scene_set_forces(scene, force, err));
  const msim_scene_view s = view_of(scene);
  for (int32_t i = 0; i < 3 * s.nparticles; i++)
    expected[i] = s.mass[i / 3] * s.gravity[i % 3] + force[i];
  add_spring_forces(&s, s.x, expected);
  msim_sim *sim = make_sim(scene, &opt);
  msim_sim_force(sim, s.x, s.v, there);
  for (int32_t i = 0; i < 3 * s.nparticles; i++)
    assert_close(there[i], s.pinned[i / 3] ? 0 : expected[i], 1e-11);
  assert_ok(msim_sim_set_forces(sim, NULL, err));
  msim_sim_force(sim, s.x, s.v, there);
  for (int32_t i = 0; i < 3 * s.nparticles; i++)
    assert_close(there[i], s.pinned[i / 3] ? 0 : expected[i] - force[i], 1e-11);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void forces_are_added(void **state) {
  (void)state;
  expect_forces(hanging_cloth(SIDE, 300, 0), "velocity-verlet");
  expect_forces(hub(300), "velocity-verlet");
  expect_forces(hub(300), "respa");
}

/* A force of m g on each particle of 1/4 kg has the bits of gravity with any method. */
static void forces_are_gravity(void **state) {
  (void)state;
  const double g[3] = {0, 0, -8}, mass = 0.25;
  const char *method;
  for (int32_t i = 0; (method = method_or_auto(i)) != NULL; i++) {
    uint64_t hash[2];
    for (int by_force = 0; by_force < 2; by_force++) {
      double force[15] = {0};
      msim_scene *scene;
      assert_ok(msim_scene_create(NULL, &scene, err));
      for (int32_t p = 0; p < 5; p++) {
        const double x[3] = {p, 0.125 * (p % 2), 0}, k = 64, rest = 1;
        const int32_t ij[2] = {p - 1, p}, first = 0;
        assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
        if (p) assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
        else assert_ok(msim_scene_pin(scene, 1, &first, err));
      }
      for (int p = 1; p < 5; p++) force[3 * p + 2] = mass * g[2];
      if (by_force) assert_ok(msim_scene_set_forces(scene, force, err));
      else assert_ok(msim_scene_set_gravity(scene, g, err));
      const msim_options opt = run_options(method, 0);
      msim_sim *sim = make_sim(scene, &opt);
      assert_ok(msim_sim_step(sim, 100, err));
      hash[by_force] = hash_sim(sim);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
    if (hash[0] != hash[1]) fail_msg("%s: the force m g is not gravity", method);
  }
}

/* x = x0 + v0 t + F t^2/(2 m), without springs */
static void free_particles_are_accelerated(void **state) {
  (void)state;
  const char *method;
  for (int32_t i = 0; (method = method_at(i)) != NULL; i++) {
    const double x[3] = {0, 0, 0}, v[3] = {1, 0, 0}, force[3] = {0.5, -1, 2}, h = 1e-3;
    const msim_options opt = options(method, h);
    msim_scene *scene = make_single_particle(x, v, 0);
    assert_ok(msim_scene_set_forces(scene, force, err));
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 1000, err));
    for (int c = 0; c < 3; c++) {
      assert_close(state_of(sim).v[c], v[c] + force[c], 1e-11);
      assert_close(state_of(sim).x[c], v[c] + force[c] / 2, h * fabs(force[c]) / 2 + 1e-11);
    }
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- changes of a running sim ---------------------------------*/

typedef enum change { GRAVITY, DRAG, FORCES, NO_FORCES, CHANGES } change;

static const char *const names[] = {"gravity", "drag", "forces", "no forces"};

static void apply_to_sim(msim_sim *sim, int what) {
  const double g[3] = {1, 2, -3};
  double force[3 * N];
  fill_forces(force, N, 0.02);
  if (what == GRAVITY) assert_ok(msim_sim_set_gravity(sim, g, err));
  if (what == DRAG) assert_ok(msim_sim_set_drag(sim, 0.03, err));
  if (what == FORCES) assert_ok(msim_sim_set_forces(sim, force, err));
  if (what == NO_FORCES) assert_ok(msim_sim_set_forces(sim, NULL, err));
}

static void apply_to_scene(msim_scene *scene, change what) {
  const double g[3] = {1, 2, -3};
  double force[3 * N];
  fill_forces(force, N, 0.02);
  if (what == GRAVITY) assert_ok(msim_scene_set_gravity(scene, g, err));
  if (what == DRAG) assert_ok(msim_scene_set_drag(scene, 0.03, err));
  if (what == FORCES) assert_ok(msim_scene_set_forces(scene, force, err));
  if (what == NO_FORCES) assert_ok(msim_scene_set_forces(scene, NULL, err));
}

static void expect_fresh(const char *method, change what, int controlled, int32_t threads) {
  msim_scene *scene = cloth_with_forces(method, what == FORCES ? 0 : 0.01);
  msim_options opt = run_options(method, controlled);
  opt.threads = threads;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 20, err));
  apply_to_sim(sim, what);
  const msim_state now = state_of(sim);
  apply_to_scene(scene, what);
  if (opt.steps >= 0) opt.steps -= 20;
  msim_sim *fresh = make_sim(scene, &opt);
  assert_ok(msim_sim_set_state(fresh, &now, err));
  for (int k = 0; k < 5; k++) {
    assert_ok(msim_sim_step(sim, 8, err));
    assert_ok(msim_sim_step(fresh, 8, err));
    if (hash_sim(sim) != hash_sim(fresh))
      fail_msg("%s%s, %s: differs from a new sim after %d steps", method, controlled ? ", tol" : "",
               names[what], 8 * k + 8);
  }
  msim_sim_destroy(sim), msim_sim_destroy(fresh);
  msim_scene_destroy(scene);
}

static void changes_continue_as_new_sims(void **state) {
  (void)state;
  const char *method;
  for (int32_t i = 0; (method = method_or_auto(i)) != NULL; i++)
    for (change what = 0; what < CHANGES; what++) {
      const int keeps_tol = i > 0 && strcmp(method, "verlet") != 0 &&
                            strcmp(method, "respa") != 0 && strcmp(method, "takahashi-imada") != 0;
      if (what == DRAG && takes_positions_only(method)) continue;
      expect_fresh(method, what, 0, 1 + i % 2);
      if (keeps_tol) expect_fresh(method, what, 1, 1);
    }
}

/* A force, or gravity, out of the plane of a planar scene moves particles out of it. */
static void forces_leave_the_plane(void **state) {
  (void)state;
  const char *const methods[] = {"velocity-verlet", "implicit-midpoint"};
  for (int i = 0; i < 2; i++) {
    double force[3 * 9] = {0};
    msim_scene *scene = hanging_cloth(3, 300, 0);
    assert_ok(msim_scene_set_gravity(scene, zero, err));
    const msim_options opt = options(methods[i], 1e-3);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 3, err));
    force[3 * 8 + 2] = 1;
    assert_ok(msim_sim_set_forces(sim, force, err));
    assert_ok(msim_sim_step(sim, 10, err));
    assert_true(state_of(sim).x[3 * 8 + 2] > 1e-5);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- energy ---------------------------------------------------*/

static void expect_parts_to_add_up(msim_sim *sim) {
  msim_energy e = {.size = sizeof e};
  assert_int_equal(msim_sim_energy(sim, &e), MSIM_OK);
  assert_close(e.total, e.kinetic + e.elastic + e.gravitational, 1e-12);
  assert_true(e.work == state_of(sim).work);
}

/* Twelve changes of forces and gravity: energy less work stays. */
static void energy_is_balanced(void **state) {
  (void)state;
  msim_scene *scene = cloth_with_forces("rkn6", 0.02);
  msim_options opt = options("dop853", 1e-3);
  opt.tol = 1e-13, opt.steps = -1, opt.t_end = 10;
  msim_sim *sim = make_sim(scene, &opt);
  const double start = energy_less_work(sim);
  double work = 0;
  for (int i = 0; i < 12; i++) {
    double force[3 * N];
    const double g[3] = {0.3 * i, -0.2 * i, -9.81 + i};
    fill_forces(force, N, 0.01 * (i % 3));
    assert_ok(msim_sim_step(sim, 7, err));
    if (i % 2) assert_ok(msim_sim_set_gravity(sim, g, err));
    else assert_ok(msim_sim_set_forces(sim, force, err));
    assert_true(state_of(sim).work != work);
    work = state_of(sim).work;
    expect_parts_to_add_up(sim);
    assert_close(energy_less_work(sim), start, 1e-12);
  }
  assert_true(state_of(sim).t > 0.05);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* The energy monitor allows what forces supply: 1 kg, 1e4 N, from rest */
static void forces_supply_energy(void **state) {
  (void)state;
  const double force[3] = {1e4, 0, 0};
  msim_scene *scene = make_single_particle(zero, zero, 0);
  assert_ok(msim_scene_set_forces(scene, force, err));
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 10000, err));
  msim_energy e = {.size = sizeof e};
  assert_int_equal(msim_sim_energy(sim, &e), MSIM_OK);
  assert_close(e.kinetic / 5e9, 1, 1e-9);
  assert_close(e.total / 5e9, 0, 1e-9);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- checkpoints ----------------------------------------------*/

static void changes_are_in_checkpoints(void **state) {
  (void)state;
  const char *method;
  for (int32_t i = 0; (method = method_or_auto(i)) != NULL; i++)
    for (change what = 0; what < CHANGES; what++) {
      if (what == DRAG && takes_positions_only(method)) continue;
      msim_scene *scene = cloth_with_forces(method, what == FORCES ? 0 : 0.01);
      const msim_options opt = run_options(method, 0);
      expect_change_is_saved(scene, &opt, apply_to_sim, what, method);
      msim_scene_destroy(scene);
    }
}

/* A scene with other forces has another fingerprint. */
static void other_forces_are_refused(void **state) {
  (void)state;
  msim_scene *scene = cloth_with_forces("rk4", 0.01), *other = cloth_with_forces("rk4", 0.02);
  const msim_options opt = options("rk4", 1e-3);
  msim_sim *a = make_sim(scene, &opt), *b = make_sim(other, &opt);
  const checkpoint c = save(a);
  msim_error why;
  assert_int_equal(msim_sim_load(b, c.bytes, c.length, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text, "particles.force differs from that in the checkpoint");
  free(c.bytes);
  msim_sim_destroy(a), msim_sim_destroy(b);
  msim_scene_destroy(scene), msim_scene_destroy(other);
}

/*------------------------------------- scenes and refusals --------------------------------------*/

static void scenes_keep_forces(void **state) {
  (void)state;
  static const char text[] =
      "{\"msim\": 1, \"particles\": {\"x\": [[0, 0, 0], [1, 0, 0]], "
      "\"mass\": 1, \"force\": [[0, 0, 0], [0.1, -2, 3e5]]},"
      "\"objects\": [{\"type\": \"rope\", \"n\": 3, \"from\": [0, 0, 1], "
      "\"to\": [1, 0, 1], \"mass\": 1, \"k\": 10}]}";
  const double expected[15] = {0, 0, 0, 0.1, -2, 3e5};
  msim_scene *scene, *again;
  assert_ok(msim_scene_parse(NULL, "text", text, sizeof text - 1, &scene, err));
  assert_memory_equal(view_of(scene).force, expected, sizeof expected);
  assert_ok(msim_scene_set_name(scene, "changed", err)); /* so that it is written anew */
  assert_ok(msim_scene_save(scene, "test_forces.json", err));
  assert_ok(msim_scene_load(NULL, "test_forces.json", &again, err));
  assert_memory_equal(view_of(again).force, expected, sizeof expected);
  assert_ok(msim_scene_set_forces(again, NULL, err));
  assert_null(view_of(again).force);
  remove("test_forces.json");
  msim_scene_destroy(scene), msim_scene_destroy(again);
}

static void bad_forces_are_refused(void **state) {
  (void)state;
  const double bad[3] = {0, NAN, 0};
  double forces[3 * N] = {0};
  msim_error why;
  forces[3 * 7 + 1] = INFINITY;
  msim_scene *scene = cloth_with_forces("rkn6", 0.01);
  const msim_options opt = options("rkn6", 1e-3);
  msim_sim *sim = make_sim(scene, &opt), *twin = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 3, err));
  assert_int_equal(msim_sim_set_forces(sim, forces, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text, "particles.force[7] is inf; it must be finite");
  assert_int_equal(msim_sim_set_gravity(sim, bad, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text, "gravity[1] is nan; it must be finite");
  assert_int_equal(msim_sim_set_drag(sim, -1, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text, "drag is -1; it must be a finite number >= 0");
  assert_int_equal(msim_sim_set_drag(sim, 1, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "drag is set"));
  assert_int_equal(msim_sim_set_drag(NULL, 1, &why), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_set_gravity(sim, NULL, &why), MSIM_ERR_ARG);
  assert_int_equal(msim_scene_set_forces(scene, forces, &why), MSIM_ERR_ARG);
  assert_ok(msim_sim_step(sim, 3, err));
  assert_ok(msim_sim_step(twin, 6, err));
  expect_same(sim, twin, "after refused forces");
  expect_same_save(sim, twin, "after refused forces");
  msim_sim_destroy(sim), msim_sim_destroy(twin);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(forces_are_added),
                                     cmocka_unit_test(forces_are_gravity),
                                     cmocka_unit_test(free_particles_are_accelerated),
                                     cmocka_unit_test(changes_continue_as_new_sims),
                                     cmocka_unit_test(forces_leave_the_plane),
                                     cmocka_unit_test(energy_is_balanced),
                                     cmocka_unit_test(forces_supply_energy),
                                     cmocka_unit_test(changes_are_in_checkpoints),
                                     cmocka_unit_test(other_forces_are_refused),
                                     cmocka_unit_test(scenes_keep_forces),
                                     cmocka_unit_test(bad_forces_are_refused)};
  return cmocka_run_group_tests_name("forces", tests, NULL, NULL);
}
