/* Tests of planar scenes, in which nothing moves along one axis: two components give the same
 * results as three, for every method, solver and axis, and a state out of the plane is computed in
 * three. */
#include <math.h>
#include <string.h>

#include "counting_allocator.h"
#include "scenes.h"
#include "sim/sim.h"

enum { SIDE = 7, N = SIDE * SIDE, DROPPED = 0, KEPT = 1 };
#define LEVEL 0.3 /* the common coordinate of all particles along the axis */

static const char *const explicit_methods[] = {
    "explicit-euler", "heun", "verlet", "symplectic-euler", "velocity-verlet", "rk4"};

/* A damped cloth, pinned at one corner, that swings in the plane perpendicular to `axis` and falls
 * on a slope. */
static msim_scene *swing(const msim_allocator *alloc, int axis) {
  const int a = (axis + 1) % 3, b = (axis + 2) % 3, pin = 0;
  double x[3 * N], v[3 * N], mass[N], g[3] = {0}, normal[3] = {0};
  for (int p = 0; p < N; p++) {
    x[3 * p + axis] = LEVEL, x[3 * p + a] = 0.1 * (p % SIDE), x[3 * p + b] = 0.1 * (p / SIDE);
    v[3 * p + axis] = 0, v[3 * p + a] = p ? 0.01 * (p % 5) : 0, v[3 * p + b] = p ? 0.1 : 0;
    mass[p] = 0.01 + 0.001 * (p % 3);
  }
  msim_scene *scene;
  assert_ok(msim_scene_create(alloc, &scene, err));
  assert_ok(msim_scene_add_particles(scene, N, x, v, mass, err));
  for (int p = 0; p < N; p++) {
    const int32_t ij[8] = {p, p + 1, p, p + SIDE, p, p + SIDE + 1, p + 1, p + SIDE};
    const double k[4] = {50, 40, 30, 20}, damping[4] = {0.02, 0.01, 0, 0.01};
    const int right = p % SIDE < SIDE - 1, down = p < N - SIDE;
    if (right) assert_ok(msim_scene_add_springs(scene, 1, ij, k, NULL, damping, err));
    if (right && down)
      assert_ok(msim_scene_add_springs(scene, 3, ij + 2, k + 1, NULL, damping + 1, err));
  }
  g[a] = 1, g[b] = -9.81, normal[a] = -0.6, normal[b] = 0.8;
  assert_ok(msim_scene_pin(scene, 1, &pin, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  assert_ok(msim_scene_set_drag(scene, 0.001, err));
  plane(scene, normal[0], normal[1], normal[2], -0.4, 0.5, 0.3);
  return scene;
}

static msim_sim *sim_with(const msim_scene *scene, const char *method, const char *solver,
                          int third) {
  msim_options opt = options(method, 2e-3);
  opt.watch = MSIM_WATCH_OFF; /* the energy grows with explicit-euler */
  opt.solver = solver, opt.solver_rtol = 1e-13, opt.jacobian = MSIM_JACOBIAN_CLAMP;
  assert_ok(msim_options_set(&opt, "skip.two_d", third == KEPT ? "off" : "on", err));
  return make_sim(scene, &opt);
}

static void assert_planar(msim_sim *sim, int axis) {
  const msim_state s = state_of(sim);
  for (int p = 0; p < N; p++) {
    assert_true(s.x[3 * p + axis] == LEVEL && s.v[3 * p + axis] == 0);
    if (s.v_half) assert_true(s.v_half[3 * p + axis] == 0);
  }
}

/* A sum of three terms of which one is 0 has the bits of the sum of the other two. */
static void explicit_methods_give_the_same_bits(void **state) {
  (void)state;
  for (size_t m = 0; m < sizeof explicit_methods / sizeof *explicit_methods; m++)
    for (int axis = 0; axis < 3; axis++) {
      msim_scene *scene = swing(NULL, axis);
      msim_sim *two = sim_with(scene, explicit_methods[m], "pcg", DROPPED);
      msim_sim *three = sim_with(scene, explicit_methods[m], "pcg", KEPT);
      assert_int_equal(two->islands->model.unknowns.dims, 2);
      assert_int_equal(two->islands->model.unknowns.dropped_axis, axis);
      assert_int_equal(three->islands->model.unknowns.dims, 3);
      assert_ok(msim_sim_step(two, 400, err));
      assert_ok(msim_sim_step(three, 400, err));
      const msim_state a = state_of(two), b = state_of(three);
      assert_memory_equal(a.x, b.x, 3 * N * sizeof(double));
      for (int i = 0; i < 3 * N; i++) assert_true(a.v[i] == b.v[i]); /* 0 may be -0 */
      assert_planar(two, axis);
      assert_true(stats_of(two).contacts > 0);
      assert_int_equal(stats_of(two).contacts, stats_of(three).contacts);
      msim_sim_destroy(two), msim_sim_destroy(three);
      msim_scene_destroy(scene);
    }
}

static void every_solver_gives_the_same_motion(void **state) {
  (void)state;
  static const char *const solvers[] = {
      "auto", "pcg", "cholmod", "klu", "sundials-pcg", "sundials-spgmr", "sundials-sptfqmr"};
  for (size_t s = 0; s < sizeof solvers / sizeof *solvers; s++)
    for (int axis = 0; axis < 3; axis++) {
      if (s && !is_solver_available(solvers[s])) continue;
      msim_scene *scene = swing(NULL, axis);
      msim_sim *two = sim_with(scene, "linearly-implicit-euler", solvers[s], DROPPED);
      msim_sim *three = sim_with(scene, "linearly-implicit-euler", solvers[s], KEPT);
      assert_int_equal(two->islands->model.unknowns.dims, 2);
      assert_ok(msim_sim_step(two, 200, err));
      assert_ok(msim_sim_step(three, 200, err));
      const msim_state a = state_of(two), b = state_of(three);
      for (int i = 0; i < 3 * N; i++) {
        assert_close(a.x[i], b.x[i], 1e-11);
        assert_close(a.v[i], b.v[i], 1e-9);
      }
      assert_planar(two, axis);
      assert_int_equal(stats_of(two).contacts, stats_of(three).contacts);
      msim_sim_destroy(two), msim_sim_destroy(three);
      msim_scene_destroy(scene);
    }
}

static int32_t components(const msim_scene *scene) {
  msim_options opt = options("verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  const int32_t dims = sim->islands->model.unknowns.dims;
  msim_sim_destroy(sim);
  return dims;
}

/* Each condition for two components, violated alone. */
static void motion_out_of_the_plane_is_detected(void **state) {
  (void)state;
  for (int axis = 0; axis < 3; axis++) {
    double x[3] = {1, 2, 3}, v[3] = {4, 5, 6}, g[3] = {0}, normal[3] = {0}, mass = 1;
    normal[(axis + 1) % 3] = 1;
    x[axis] = LEVEL, v[axis] = 0;
    msim_scene *scene = swing(NULL, axis);
    assert_ok(msim_scene_add_particles(scene, 1, x, v, &mass, err));
    plane(scene, normal[0], normal[1], normal[2], -9, 1, 0);
    assert_int_equal(components(scene), 2);
    v[axis] = 1e-300;
    assert_ok(msim_scene_add_particles(scene, 1, x, v, &mass, err));
    assert_int_equal(components(scene), 3);
    msim_scene_destroy(scene);

    scene = swing(NULL, axis);
    v[axis] = 0, x[axis] = nextafter(LEVEL, 1);
    assert_ok(msim_scene_add_particles(scene, 1, x, v, &mass, err));
    assert_int_equal(components(scene), 3);
    msim_scene_destroy(scene);

    scene = swing(NULL, axis);
    g[axis] = -1e-300;
    assert_ok(msim_scene_set_gravity(scene, g, err));
    assert_int_equal(components(scene), 3);
    msim_scene_destroy(scene);

    scene = swing(NULL, axis);
    normal[axis] = 1e-10;
    plane(scene, normal[0], normal[1], normal[2], -9, 1, 0);
    assert_int_equal(components(scene), 3);
    msim_scene_destroy(scene);
  }
}

/* A straight rope that swings from one end is planar along one axis; hanging straight down, along
 * two. */
static void straight_scenes_are_planar(void **state) {
  (void)state;
  const int32_t pin = 0;
  const msim_rope rope = {sizeof rope, 5, {0, 0, 1}, {0, 0, 0}, 1, 100, 0, 1, &pin, 0, 0};
  const double g[3] = {0, 0, -9.81};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_rope(scene, &rope, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  const char *text;
  assert_ok(msim_sim_explain(sim, &text, err));
  assert_non_null(strstr(text, "component y: no velocity and no force has"));
  assert_ok(msim_sim_step(sim, 500, err));
  assert_true(state_of(sim).x[14] < -0.01);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Positions and velocities of a state out of the plane. */
typedef struct state_out_of_plane {
  double x[3 * N], v[3 * N];
} state_out_of_plane;

static state_out_of_plane out_of_plane(msim_sim *sim, int axis) {
  state_out_of_plane r;
  const msim_state s = state_of(sim);
  memcpy(r.x, s.x, sizeof r.x), memcpy(r.v, s.v, sizeof r.v);
  r.x[3 * 20 + axis] += 0.02, r.v[3 * 30 + axis] = 0.5;
  return r;
}

/* States out of the plane, and back into it. */
static void states_choose_the_components(void **state) {
  (void)state;
  static const char *const methods[] = {"verlet", "linearly-implicit-euler"};
  for (int m = 0; m < 2; m++)
    for (int axis = 0; axis < 3; axis++) {
      msim_scene *scene = swing(NULL, axis);
      msim_sim *sim = sim_with(scene, methods[m], "pcg", DROPPED);
      msim_sim *three = sim_with(scene, methods[m], "pcg", KEPT);
      state_out_of_plane r = out_of_plane(sim, axis);
      const msim_state out = {.size = sizeof out, .step = 5, .t = 1, .n = N, .x = r.x, .v = r.v};
      assert_ok(msim_sim_step(sim, 10, err));
      assert_ok(msim_sim_set_state(sim, &out, err));
      assert_int_equal(sim->islands->model.unknowns.dims, 3);
      assert_ok(msim_sim_set_state(three, &out, err));
      assert_ok(msim_sim_step(sim, 50, err));
      assert_ok(msim_sim_step(three, 50, err));
      assert_memory_equal(state_of(sim).x, state_of(three).x, sizeof r.x);
      assert_memory_equal(state_of(sim).v, state_of(three).v, sizeof r.v);
      assert_int_equal(stats_of(sim).steps, 60);

      msim_scene_view view = {.size = sizeof view};
      msim_scene_get(scene, &view);
      const msim_state in = {.size = sizeof in, .n = N, .x = view.x, .v = view.v};
      msim_sim *fresh = sim_with(scene, methods[m], "pcg", DROPPED);
      assert_ok(msim_sim_set_state(sim, &in, err));
      assert_int_equal(sim->islands->model.unknowns.dims, 2);
      assert_ok(msim_sim_step(sim, 50, err));
      assert_ok(msim_sim_step(fresh, 50, err));
      assert_memory_equal(state_of(sim).x, state_of(fresh).x, sizeof r.x);
      assert_planar(sim, axis);
      msim_sim_destroy(sim), msim_sim_destroy(three), msim_sim_destroy(fresh);
      msim_scene_destroy(scene);
    }
}

/* The half-step velocity of verlet alone may lead out of the plane. */
static void v_half_counts(void **state) {
  (void)state;
  msim_scene *scene = swing(NULL, 1);
  msim_sim *sim = sim_with(scene, "verlet", "pcg", DROPPED);
  msim_state s = state_of(sim);
  state_out_of_plane r = out_of_plane(sim, 1);
  s.v_half = r.v;
  assert_ok(msim_sim_set_state(sim, &s, err));
  assert_int_equal(sim->islands->model.unknowns.dims, 3);
  assert_memory_equal(state_of(sim).v_half, r.v, sizeof r.v);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* If memory runs out on the way to three components, the sim goes on in two, from its old state. */
static void a_state_that_fails_changes_nothing(void **state) {
  (void)state;
  counting_allocator b = {.fail_at = -1};
  const msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free,
                                &b};
  msim_scene *scene = swing(&alloc, 2);
  msim_sim *sim = sim_with(scene, "linearly-implicit-euler", "pcg", DROPPED);
  msim_sim *other = sim_with(scene, "linearly-implicit-euler", "pcg", DROPPED);
  state_out_of_plane r = out_of_plane(sim, 2);
  const msim_state out = {.size = sizeof out, .n = N, .x = r.x, .v = r.v};
  assert_ok(msim_sim_step(sim, 10, err));
  assert_ok(msim_sim_step(other, 10, err));
  const int64_t live = b.live;
  int64_t failures = 0;
  for (b.fail_at = b.calls; msim_sim_set_state(sim, &out, NULL); b.fail_at = b.calls + failures) {
    failures++;
    assert_int_equal(b.live, live);
    assert_ok(msim_sim_step(sim, 1, err));
    assert_ok(msim_sim_step(other, 1, err));
    assert_int_equal(state_of(sim).step, state_of(other).step);
    assert_memory_equal(state_of(sim).x, state_of(other).x, sizeof r.x);
  }
  assert_in_range(failures, 20, 100);
  assert_int_equal(sim->islands->model.unknowns.dims, 3);
  msim_sim_destroy(sim), msim_sim_destroy(other);
  msim_scene_destroy(scene);
  assert_int_equal(b.live, 0);
}

/* msim_sim_force() in any state and msim_sim_matrix() have three components per particle. */
static void queries_return_three_components(void **state) {
  (void)state;
  for (int axis = 0; axis < 3; axis++) {
    msim_scene *scene = swing(NULL, axis);
    msim_sim *two = sim_with(scene, "linearly-implicit-euler", "pcg", DROPPED);
    msim_sim *three = sim_with(scene, "linearly-implicit-euler", "pcg", KEPT);
    double f[3 * N], g[3 * N];
    msim_state s = state_of(two);
    for (int i = 0; i < 3 * N; i++) f[i] = g[i] = NAN;
    msim_sim_force(two, s.x, s.v, f), msim_sim_force(three, s.x, s.v, g);
    for (int i = 0; i < 3 * N; i++) assert_true(f[i] == g[i]);
    state_out_of_plane r = out_of_plane(two, axis);
    msim_sim_force(two, r.x, r.v, f), msim_sim_force(three, r.x, r.v, g);
    for (int i = 0; i < 3 * N; i++) assert_close(f[i], g[i], 1e-12);
    assert_true(f[3 * 20 + axis] != 0);

    msim_csr A = {.size = sizeof A}, B = {.size = sizeof B};
    assert_ok(msim_sim_step(two, 3, err));
    assert_ok(msim_sim_matrix(two, &A, err));
    s = state_of(two);
    assert_ok(msim_sim_set_state(three, &s, err));
    assert_ok(msim_sim_matrix(three, &B, err));
    assert_int_equal(A.n, 3 * (N - 1));
    assert_memory_equal(A.rowptr, B.rowptr, (size_t)(A.n + 1) * sizeof *A.rowptr);
    assert_memory_equal(A.colind, B.colind, (size_t)A.rowptr[A.n] * sizeof *A.colind);
    for (int32_t e = 0; e < A.rowptr[A.n]; e++) assert_true(A.val[e] == B.val[e]);
    msim_sim_destroy(two), msim_sim_destroy(three);
    msim_scene_destroy(scene);
  }
}

/* Vectors have no memory for the third component. */
static void less_is_allocated(void **state) {
  (void)state;
  size_t bytes[2];
  for (int third = 0; third < 2; third++) {
    counting_allocator b = {.fail_at = -1};
    const msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free,
                                  &b};
    msim_scene *scene = swing(&alloc, 2);
    const size_t before = b.bytes;
    msim_sim *sim = sim_with(scene, "linearly-implicit-euler", "pcg", third);
    bytes[third] = b.bytes - before;
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
  const size_t vectors = 5 + 2 + 4 + 4; /* at least */
  assert_true(bytes[KEPT] >= bytes[DROPPED] + vectors * N * sizeof(double));
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(explicit_methods_give_the_same_bits),
                                     cmocka_unit_test(every_solver_gives_the_same_motion),
                                     cmocka_unit_test(motion_out_of_the_plane_is_detected),
                                     cmocka_unit_test(straight_scenes_are_planar),
                                     cmocka_unit_test(states_choose_the_components),
                                     cmocka_unit_test(v_half_counts),
                                     cmocka_unit_test(a_state_that_fails_changes_nothing),
                                     cmocka_unit_test(queries_return_three_components),
                                     cmocka_unit_test(less_is_allocated)};
  return cmocka_run_group_tests_name("planar", tests, NULL, NULL);
}
