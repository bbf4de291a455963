/* Tests of msim_sim_reactions, msim_sim_springs and msim_sim_advice: the balance of momentum by all
 * methods, forces written out spring by spring, the order of scenes that are renumbered; and whole
 * sentences of advice. */
#include <math.h>
#include <stdio.h>

#include "scenes.h"

enum { SIDE = 6, N = SIDE * SIDE };

/* Cloth 1 m wide, with its numbers shuffled, so that it is renumbered; a spring between two pinned
 * particles; a particle without springs; a spring of rest length 0. */
static msim_scene *shuffled_cloth(double damping, double drag) {
  static int32_t number[N];
  msim_scene *cloth = hanging_cloth(SIDE, 200, damping), *scene;
  msim_scene_view view = {.size = sizeof view};
  unsigned seed = 5;
  assert_int_equal(msim_scene_get(cloth, &view), MSIM_OK);
  for (int32_t i = 0; i < N; i++) number[i] = i;
  for (int32_t i = N - 1; i > 0; i--) {
    const int32_t other = (int32_t)(uniform(&seed) * (i + 1)), between = number[i];
    number[i] = number[other], number[other] = between;
  }
  double x[3 * N], mass[N];
  for (int32_t i = 0; i < N; i++) {
    memcpy(x + 3 * number[i], view.x + 3 * i, 3 * sizeof *x);
    x[3 * number[i] + 2] += 0.02 * uniform(&seed);
    mass[number[i]] = view.mass[i] * (1 + uniform(&seed));
  }
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, N, x, NULL, mass, err));
  for (int32_t e = 0; e < view.nsprings; e++) {
    const int32_t ij[2] = {number[view.ij[2 * e]], number[view.ij[2 * e + 1]]};
    const double k = view.k[e] * (1 + uniform(&seed)), *rest = e == 7 ? (double[]){0} : NULL;
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, rest, &damping, err));
  }
  const int32_t pins[3] = {number[0], number[SIDE - 1], number[N - 1]},
                between[2] = {pins[0], pins[1]};
  assert_ok(msim_scene_add_springs(scene, 1, between, (double[]){50}, (double[]){0.3}, NULL, err));
  assert_ok(msim_scene_pin(scene, 3, pins, err));
  assert_ok(msim_scene_set_gravity(scene, (double[]){0.3, -0.2, -9.81}, err));
  assert_ok(msim_scene_set_drag(scene, drag, err));
  msim_scene_destroy(cloth);
  return scene;
}

static msim_scene_view view_of(const msim_scene *scene) {
  msim_scene_view view = {.size = sizeof view};
  assert_int_equal(msim_scene_get(scene, &view), MSIM_OK);
  return view;
}

/* Sum of reactions + sum of (m g - b v) = dP/dt, the sum of all forces on free particles */
static void expect_balance(msim_sim *sim, const msim_scene *scene, double drag, const char *label) {
  const double g[3] = {0.3, -0.2, -9.81};
  const msim_scene_view view = view_of(scene);
  const msim_state s = state_of(sim);
  double force[3 * N], reaction[3 * N];
  msim_sim_force(sim, s.x, s.v, force);
  assert_int_equal(msim_sim_reactions(sim, reaction), MSIM_OK);
  for (int c = 0; c < 3; c++) {
    double rate = 0, sum = 0;
    for (int32_t p = 0; p < N; p++) {
      rate += force[3 * p + c];
      sum += reaction[3 * p + c] + view.mass[p] * g[c] - drag * s.v[3 * p + c];
      if (!view.pinned[p] && reaction[3 * p + c] != 0) fail_msg("%s: %d is free", label, (int)p);
    }
    if (!(fabs(rate - sum) <= 1e-12)) fail_msg("%s: %g N of momentum", label, rate - sum);
  }
}

static void momentum_is_balanced(void **state) {
  (void)state;
  const char *method;
  for (int32_t m = 0; (method = method_at(m)) != NULL; m++) {
    const int smooth = takes_positions_only(method);
    const double drag = smooth ? 0 : 0.02;
    msim_scene *scene = shuffled_cloth(smooth ? 0 : 0.05, drag);
    const msim_options opt = options(method, 5e-4);
    msim_sim *sim = make_sim(scene, &opt);
    expect_balance(sim, scene, drag, method);
    for (int i = 0; i < 5; i++) {
      assert_ok(msim_sim_step(sim, 7, err));
      expect_balance(sim, scene, drag, method);
    }
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* (k (l - L) + c dl/dt) u, spring by spring, as the text of the law says */
static void springs_pull_as_their_tension_says(void **state) {
  (void)state;
  enum { MOST = 400 };
  double tension[MOST], elongation[MOST], strain[MOST], sum[3 * N] = {0}, force[3 * N];
  double reaction[3 * N];
  const double g[3] = {0.3, -0.2, -9.81};
  msim_scene *scene = shuffled_cloth(0.05, 0);
  const msim_scene_view view = view_of(scene);
  const msim_options opt = options("velocity-verlet", 5e-4);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 40, err));
  const msim_state s = state_of(sim);
  assert_true(view.nsprings <= MOST);
  assert_int_equal(msim_sim_springs(sim, tension, elongation, strain), MSIM_OK);
  for (int32_t e = 0; e < view.nsprings; e++) {
    const int32_t i = view.ij[2 * e], j = view.ij[2 * e + 1];
    double d[3], l = 0, rate = 0;
    for (int c = 0; c < 3; c++) d[c] = s.x[3 * j + c] - s.x[3 * i + c], l += d[c] * d[c];
    l = sqrt(l);
    for (int c = 0; c < 3; c++) rate += d[c] / l * (s.v[3 * j + c] - s.v[3 * i + c]);
    const double rest = view.rest[e];
    assert_close(tension[e], view.k[e] * (l - rest) + view.damping[e] * rate, 1e-12);
    assert_close(elongation[e], l - rest, 1e-15);
    assert_close(strain[e], rest > 0 ? (l - rest) / rest : 0, 1e-14);
    for (int c = 0; c < 3; c++) {
      sum[3 * i + c] += tension[e] * d[c] / l;
      sum[3 * j + c] -= tension[e] * d[c] / l;
    }
  }
  msim_sim_force(sim, s.x, s.v, force);
  msim_sim_reactions(sim, reaction);
  for (int32_t i = 0; i < 3 * N; i++) { /* F + R = tensions + m g, where F or R is 0 */
    const double expected = sum[i] + view.mass[i / 3] * g[i % 3];
    assert_close(force[i] - reaction[i], expected, 1e-12);
  }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A hanging weight at rest: the support carries weight and spring; tension is the weight. A spring
 * whose ends coincide has no direction, and its damper no rate. */
static void closed_solutions(void **state) {
  (void)state;
  const double x[9] = {0, 0, 0, 0, 0, -1.5, 0, 0, -1.5}, mass[3] = {0.5, 2, 1}, k = 40, rest = 1;
  const int32_t ij[4] = {0, 1, 1, 2}, pin[1] = {0};
  const double ks[2] = {k, 3}, rests[2] = {rest, 0.5}, dampings[2] = {0.1, 7};
  double tension[2], strain[2], reaction[9];
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 3, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 2, ij, ks, rests, dampings, err));
  assert_ok(msim_scene_pin(scene, 1, pin, err));
  assert_ok(msim_scene_set_gravity(scene, (double[]){0, 0, -10}, err));
  const msim_options opt = options("implicit-euler", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_int_equal(msim_sim_springs(sim, tension, NULL, strain), MSIM_OK);
  assert_int_equal(msim_sim_reactions(sim, reaction), MSIM_OK);
  assert_true(tension[0] == 20 && strain[0] == 0.5);
  assert_true(tension[1] == -1.5 && strain[1] == -1);
  assert_true(reaction[0] == 0 && reaction[1] == 0 && reaction[2] == 25 && reaction[5] == 0);
  const double stiffer[2] = {80, 3};
  assert_ok(msim_sim_set_springs(sim, stiffer, NULL, NULL, err));
  assert_int_equal(msim_sim_springs(sim, tension, NULL, NULL), MSIM_OK);
  assert_true(tension[0] == 40); /* the springs of the sim */
  assert_int_equal(msim_sim_springs(sim, NULL, NULL, NULL), MSIM_OK);
  assert_int_equal(msim_sim_springs(NULL, tension, NULL, NULL), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_reactions(sim, NULL), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_reactions(NULL, reaction), MSIM_ERR_ARG);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* "" unless steps have failed; whole sentences, as many as fit. */
static void advice_fits_its_memory(void **state) {
  (void)state;
  char text[1024], part[1024];
  msim_scene *scene = shuffled_cloth(0, 0);
  const msim_options opt = options("velocity-verlet", 0.2);
  msim_sim *sim = make_sim(scene, &opt);
  assert_int_equal(msim_sim_advice(sim, text, sizeof text), MSIM_OK);
  assert_string_equal(text, "");
  assert_true(msim_sim_step(sim, 1000, NULL) > 0);
  assert_int_equal(msim_sim_advice(sim, text, sizeof text), MSIM_OK);
  assert_memory_equal(text, "Set h = 0.0", 11);
  int sentences = 1;
  for (const char *at = text; (at = strchr(at, '\n')) != NULL; at++) sentences++;
  assert_in_range(sentences, 2, 5);
  for (size_t size = 1; size <= strlen(text) + 1; size++) {
    memset(part, 'x', sizeof part);
    assert_int_equal(msim_sim_advice(sim, part, size), MSIM_OK);
    const size_t length = strlen(part);
    assert_true(length < size && part[size] == 'x');
    assert_memory_equal(part, text, length);
    assert_true(length == 0 || text[length] == '\n' || text[length] == 0);
  }
  assert_string_equal(part, text);
  assert_int_equal(msim_sim_advice(sim, part, 0), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_advice(sim, NULL, 9), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_advice(NULL, part, 9), MSIM_ERR_ARG);
  assert_ok(msim_sim_set_step(sim, 1e-3, err));
  assert_ok(msim_sim_step(sim, 1, err));
  assert_int_equal(msim_sim_advice(sim, text, sizeof text), MSIM_OK);
  assert_string_equal(text, "");
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(momentum_is_balanced), cmocka_unit_test(springs_pull_as_their_tension_says),
      cmocka_unit_test(closed_solutions), cmocka_unit_test(advice_fits_its_memory)};
  return cmocka_run_group_tests_name("queries", tests, NULL, NULL);
}
