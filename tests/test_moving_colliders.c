/* Tests of colliders that move: reflection in closed form, the velocity of their points, work,
 * bodies that are lifted and carried along, random motions by all methods. */
#include "base/vec3.h"
#include "checkpoints.h"
#include "moving_colliders.h"
#include "state_hash.h"

/*------------------------------------- closed forms ---------------------------------------------*/

/* A particle at rest, z = 0.05, and a surface that moves with u = (0.5, 0, 2) from z = 0 to 0.2:
 * s = -0.15. Relative velocity (-0.5, 0, -2): J = 1.5 * 2 = 3; the tangential part times
 * 1 - 0.05 * 3/0.5 = 0.7. */
static void one_reflection_in_closed_form(void **state) {
  (void)state;
  const double x[3] = {0, 0, 0.05}, v[3] = {0}, e = 0.5, mu = 0.05, h = 0.1, u[3] = {0.5, 0, 2};
  const double x1[3] = {0, 0, 0.275}, v1[3] = {0.15, 0, 3}, work = 0.15 * 0.5 + 3 * 2;
  const double zero[3] = {0}, along[3] = {40, 0, 0}, up[3] = {0, 0, 1};
  for (int32_t m = 0; method_at(m); m++)
    for (int i = 0; i < 4; i++) {
      if (refuses_planes(method_at(m))) continue;
      msim_scene *scene = make_single_particle(x, v, 0);
      const double at[3] = {0, 0, i == 0 ? -2 : i == 1 ? 2 : -1};
      if (i < 2) add(scene, box(0, 0, 0, 4, e, mu), i == 1);
      if (i == 2) add(scene, round_bar(MSIM_COLLIDER_CAPSULE, zero, along, 1, e, mu), 0);
      if (i == 3) add(scene, round_bar(MSIM_COLLIDER_CYLINDER, zero, up, 8, e, mu), 0);
      set_uniform(scene, at, u, NULL);
      msim_options opt = options(method_at(m), h);
      msim_sim *sim = make_sim(scene, &opt);
      assert_ok(msim_sim_step(sim, 1, err));
      const msim_state s = state_of(sim);
      for (int c = 0; c < 3; c++) assert_close(s.x[c], x1[c], 4e-15);
      for (int c = 0; c < 3; c++) assert_close(s.v[c], v1[c], 4e-15);
      assert_close(energies_of(sim).work, work, 2e-14);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

/* A motion that ends with the step: the velocity is that of the interval before. */
static void the_end_of_a_motion_reflects(void **state) {
  (void)state;
  const double x[3] = {0, 0, 0.05}, v[3] = {0}, t[2] = {0, 0.1}, points[6] = {0, 0, -2, 0, 0, -1.8};
  msim_scene *scene = make_single_particle(x, v, 0);
  add(scene, box(0, 0, 0, 4, 0.5, 0), 0);
  set_motion(scene, 0, 2, t, points, NULL, 0);
  const msim_options opt = options("symplectic-euler", 0.1);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 1, err));
  assert_close(state_of(sim).v[2], 1.5 * 2, 1e-14);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* With friction that sticks a particle gets the velocity of the surface: at the top of a sphere
 * that rotates about y by 2 rad/s, (2, 0, 0). */
static void rotating_surfaces_drag_particles(void **state) {
  (void)state;
  const double x[3] = {0, 0, 1e-4}, v[3] = {0, 0, -1}, at[3] = {0, 0, -1}, none[3] = {0},
               w[3] = {0, 2, 0};
  msim_scene *scene = make_single_particle(x, v, 0);
  add(scene, sphere(0, 0, 0, 1, 0, 1e9), 0);
  set_uniform(scene, at, none, w);
  const msim_options opt = options("symplectic-euler", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 1, err));
  assert_close(state_of(sim).v[0], 2, 1e-12);
  assert_close(state_of(sim).v[1], 0, 1e-12);
  assert_close(state_of(sim).v[2], 0, 1e-12);
  assert_close(energies_of(sim).work, 2 * 2, 1e-12);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* x of the point of the solid with coordinates q */
static void find_point(const ms_solid *s, const double q[3], double x[3]) {
  for (int c = 0; c < 3; c++)
    x[c] = s->center[c] + q[0] * s->axis[0][c] + q[1] * s->axis[1][c] + q[2] * s->axis[2][c];
}

/* Points of a solid on random paths against central differences of their positions, and axes that
 * stay orthonormal */
static void points_move_with_their_solid(void **state) {
  (void)state;
  unsigned seed = 5;
  for (int i = 0; i < 200; i++) {
    const double start[3] = {0}, t[3] = {0, 0.7, 1.5}, at = 1.5 * uniform(&seed), d = 1e-5;
    const double small = i % 4 ? 1 : 1e-3;
    double x[9], w[9], q[3], before[3], after[3], here[3], v[3];
    for (int k = 0; k < 9; k++) x[k] = uniform(&seed), w[k] = small * (4 * uniform(&seed) - 2);
    for (int c = 0; c < 3; c++) q[c] = 2 * uniform(&seed) - 1;
    msim_scene *scene = make_single_particle(start, start, 0);
    msim_collider c = box(9, 9, 9, 1, 1, 0);
    c.rotation[0] = 1, c.rotation[1] = 0.3;
    add(scene, c, 0);
    set_motion(scene, 0, 3, t, x, w, i % 2);
    ms_solid s[3];
    for (int k = 0; k < 3; k++) {
      const ms_instant when = {.t = at + (k - 1) * d};
      assert_ptr_equal(ms_collider_motion_place(scene->data, 0, when, &s[k]), &s[k]);
    }
    find_point(&s[0], q, before), find_point(&s[1], q, here), find_point(&s[2], q, after);
    ms_signed_distance_find_velocity(&s[1], here, v);
    const int knot = fabs(at - 0.7) < 2 * d || at < 2 * d || at > 1.5 - 2 * d;
    for (int k = 0; k < 3 && !knot; k++) assert_close(v[k], (after[k] - before[k]) / (2 * d), 2e-8);
    for (int a = 0; a < 3; a++)
      for (int b = 0; b < 3; b++)
        assert_close(ms_vec3_dot(s[1].axis[a], s[1].axis[b]), a == b, 1e-14);
    msim_scene_destroy(scene);
  }
}

/* A plate that rises by 2 m/s under a particle: the weight does -m g u t, the plate m g u t. */
static void a_lift_does_the_work_of_the_weight(void **state) {
  (void)state;
  const double x[3] = {0, 0, 0}, v[3] = {0, 0, 2}, u[3] = {0, 0, 2}, at[3] = {0, 0, -0.5};
  msim_scene *scene = make_single_particle(x, v, 9.81);
  add(scene, box(0, 0, 0, 1, 0, 0), 0);
  set_uniform(scene, at, u, NULL);
  const msim_options opt = options("symplectic-euler", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 1000, err));
  assert_close(state_of(sim).x[2], 2, 1e-12);
  assert_close(state_of(sim).v[2], 2, 1e-12);
  assert_close(energies_of(sim).work, 9.81 * 2, 1e-9);
  assert_close(balance_of(sim), 2, 1e-9);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A belt of 1 m/s: v = mu g t, up to its speed. */
static void a_belt_accelerates_by_friction(void **state) {
  (void)state;
  const double x[3] = {0}, v[3] = {0}, u[3] = {1, 0, 0}, at[3] = {0, 0, -10}, mu = 0.2, h = 1e-3;
  msim_scene *scene = make_single_particle(x, v, 9.81);
  add(scene, box(0, 0, 0, 20, 0, mu), 0);
  set_uniform(scene, at, u, NULL);
  const msim_options opt = options("symplectic-euler", h);
  msim_sim *sim = make_sim(scene, &opt);
  for (int k = 1; k <= 700; k++) {
    assert_ok(msim_sim_step(sim, 1, err));
    assert_close(state_of(sim).v[0], fmin(1, mu * 9.81 * k * h), 1e-12);
  }
  /* half of the work is kinetic energy, half is dissipated */
  assert_close(energies_of(sim).kinetic, 0.5, 1e-12);
  assert_close(energies_of(sim).work, 1, 1e-12);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A particle between a floor and a press that stops 0.2 above it, and a particle that the press
 * would push into the floor: it stays where it was. */
static void a_press_leaves_particles_outside_while_there_is_room(void **state) {
  (void)state;
  const double x[3] = {0.1, 0, 0.1}, v[3] = {0.3, 0.1, 1}, t[2] = {0, 1};
  for (int e = 0; e < 2; e++) {
    const double points[6] = {0, 0, 2, 0, 0, 0.7};
    msim_scene *scene = make_single_particle(x, v, 9.81);
    plane(scene, 0, 0, 1, 0, 0, 0.1);
    add(scene, box(0, 0, 2, 1, 0.5 * e, 0.1), 0);
    add(scene, box(0, 0, 0, 3, 0.5 * e, 0), 1);
    set_motion(scene, 0, 2, t, points, NULL, 0);
    const msim_options opt = options("velocity-verlet", 1e-2);
    msim_sim *sim = make_sim(scene, &opt);
    for (int k = 0; k < 150; k++) {
      assert_ok(msim_sim_step(sim, 1, err));
      assert_true(least_distance(sim) >= -1e-12 && state_of(sim).x[2] >= -1e-12);
    }
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- random motions -------------------------------------------*/

static msim_collider random_collider(unsigned *seed, double e, double mu) {
  const double x[3] = {0}, along[3] = {uniform(seed), uniform(seed) - 0.5, uniform(seed) - 0.5};
  const double size = 0.1 + 0.3 * uniform(seed);
  const int32_t type = MSIM_COLLIDER_SPHERE + (int32_t)(4 * uniform(seed));
  if (type == MSIM_COLLIDER_SPHERE) return sphere(0, 0, 0, size, e, mu);
  if (type != MSIM_COLLIDER_BOX) return round_bar(type, x, along, size, e, mu);
  return box(0, 0, 0, size, e, mu);
}

static void set_random_motion(msim_scene *scene, unsigned *seed) {
  const double t[4] = {-0.1, 0.2, 0.5, 0.8};
  double x[12], w[12];
  for (int k = 0; k < 12; k++) x[k] = 2 * uniform(seed) - 1, w[k] = 4 * uniform(seed) - 2;
  const int rotates = uniform(seed) < 0.7;
  set_motion(scene, scene->data->ncolliders - 1, 4, t, x, rotates ? w : NULL, uniform(seed) < 0.5);
}

/* n particles in a room with colliders on random paths */
static msim_scene *random_scene(unsigned *seed, int32_t n, double e, double mu) {
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int32_t i = 0; i < n; i++) {
    double x[3], v[3], mass = 0.5 + uniform(seed);
    for (int c = 0; c < 3; c++) x[c] = 2 * uniform(seed) - 1, v[c] = 2 * uniform(seed) - 1;
    assert_ok(msim_scene_add_particles(scene, 1, x, v, &mass, err));
  }
  for (int i = 0; i < 3; i++) {
    add(scene, random_collider(seed, e, mu), 0);
    set_random_motion(scene, seed);
  }
  add(scene, box(0, 0, 0, 6, e, mu), 1);
  return scene;
}

/* Without forces: with e = 1 and no friction the kinetic energy less work is constant; else it
 * never grows, as an impact dissipates energy in the frame of the surface. */
static void work_balances_energy(void **state) {
  (void)state;
  unsigned seed = 21;
  int64_t contacts = 0;
  for (int i = 0; i < 100; i++) {
    const int elastic = i % 2;
    const double e = elastic ? 1 : uniform(&seed), mu = elastic ? 0 : uniform(&seed);
    msim_scene *scene = random_scene(&seed, 200, e, mu);
    const msim_options opt = options(i % 3 ? "velocity-verlet" : "implicit-midpoint", 5e-3);
    msim_sim *sim = make_sim(scene, &opt);
    expect_balance(i, sim, elastic, 1e-12, 1e-12);
    contacts += stats_of(sim).contacts;
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
  print_message("  %lld contacts\n", (long long)contacts);
  assert_true(contacts > 5000);
}

/* Bodies with springs, by all methods, with 1 and 2 threads, from checkpoints and clones */
static void runs_resume_with_the_same_bits(void **state) {
  (void)state;
  const int64_t at[2] = {37, 110};
  unsigned seed = 8;
  for (int32_t m = 0; method_at(m); m++) {
    if (refuses_planes(method_at(m))) continue;
    msim_scene *scene = random_scene(&seed, 30, 0.3, 0.2);
    double k[29];
    int32_t ij[58];
    for (int i = 0; i < 29; i++) k[i] = 20, ij[2 * i] = i, ij[2 * i + 1] = i + 1;
    assert_ok(msim_scene_add_springs(scene, 29, ij, k, NULL, NULL, err));
    msim_options opt = options(method_at(m), 5e-3);
    opt.watch = MSIM_WATCH_ON;
    expect_resumable(scene, &opt, 200, 2, at, method_at(m));
    uint64_t hash[2];
    for (opt.threads = 1; opt.threads <= 2; opt.threads++) {
      msim_sim *sim = make_sim(scene, &opt);
      assert_ok(msim_sim_step(sim, 200, err));
      if (strcmp(method_at(m), "explicit-euler") != 0) assert_true(stats_of(sim).contacts > 0);
      hash[opt.threads - 1] = hash_sim(sim);
      msim_sim_destroy(sim);
    }
    assert_true(hash[0] == hash[1]);
    msim_scene_destroy(scene);
  }
}

/* A particle at exact rest is not stepped, until a collider comes; after it has passed it is in
 * uniform motion. */
static void bodies_at_rest_are_hit(void **state) {
  (void)state;
  const double x[3] = {0}, v[3] = {0}, t[2] = {0.5, 1}, points[6] = {-3, 0, 0, 1, 0, 0};
  for (int skips = 0; skips < 2; skips++) {
    msim_scene *scene = make_single_particle(x, v, 0);
    add(scene, sphere(9, 9, 9, 0.5, 1, 0), 0);
    set_motion(scene, 0, 2, t, points, NULL, 0);
    msim_options opt = options("velocity-verlet", 0.01);
    opt.skip_off = skips ? 0 : MSIM_SKIP_AT_REST;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 100, err));
    assert_close(state_of(sim).v[0], 16, 1e-12);
    assert_close(energies_of(sim).work, 16 * 8, 1e-10);
    assert_int_equal(stats_of(sim).contacts, 1);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(one_reflection_in_closed_form),
      cmocka_unit_test(the_end_of_a_motion_reflects),
      cmocka_unit_test(rotating_surfaces_drag_particles),
      cmocka_unit_test(points_move_with_their_solid),
      cmocka_unit_test(a_lift_does_the_work_of_the_weight),
      cmocka_unit_test(a_belt_accelerates_by_friction),
      cmocka_unit_test(a_press_leaves_particles_outside_while_there_is_room),
      cmocka_unit_test(work_balances_energy),
      cmocka_unit_test(runs_resume_with_the_same_bits),
      cmocka_unit_test(bodies_at_rest_are_hit)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
