/* Tests of the forces that ranks support, with explicit methods: laws of springs, angular springs,
 * force functions, pins and colliders that move: the bits of one process. */
#include "angle_scenes.h"
#include "laws.h"
#include "moving_colliders.h"
#include "rank_implicit.h"

static void laws_of_springs(void **state) {
  (void)state;
  msim_scene *undamped = law_net(90, 600, 0, 0, 3), *damped = law_net(91, 600, 0, 0.3, 4),
             *planar = law_net(60, 300, 1, 0.1, 5);
  check_methods("laws", undamped, 1e-3, 20, 1, 0);
  check_methods("damped laws", damped, 1e-3, 20, 0, 0);
  check_run("planar laws", planar, options("velocity-verlet", 1e-3), 60, 4);
  msim_scene_destroy(undamped);
  msim_scene_destroy(damped);
  msim_scene_destroy(planar);
}

static void angular_springs(void **state) {
  (void)state;
  msim_scene *undamped = bent_scene((chain){60, 100, 0.1, 0, 0}),
             *damped = bent_scene((chain){61, 100, 0.1, 0.05, 0}),
             *cloth = bending_cloth(12, 400, 0.01, 0.001);
  check_methods("chain", undamped, 1e-4, 20, 1, 0);
  check_methods("damped chain", damped, 1e-4, 20, 0, 0);
  check_methods("bending cloth", cloth, 1e-4, 15, 0, 0);
  msim_scene_destroy(undamped);
  msim_scene_destroy(damped);
  msim_scene_destroy(cloth);
}

/* f = 5 sin(9 t) x - c v, of each particle by itself */
static int32_t push_and_brake(void *data, const msim_force_batch *b) {
  (void)data;
  for (int32_t i = 0; i < 3 * b->n; i++)
    b->f[i] += 5 * sin(9 * b->t) * b->x[i] * 1e-3 - (b->v ? 1e-4 * b->v[i] : 0);
  return 0;
}

static double bowl(void *data, int32_t n, const int32_t *particles, const double *x) {
  double sum = 0;
  (void)data, (void)particles;
  for (int32_t i = 0; i < 3 * n; i++) sum += 0.5 * x[i] * x[i];
  return sum;
}

static int32_t bowl_force(void *data, const msim_force_batch *b) {
  (void)data;
  for (int32_t i = 0; i < 3 * b->n; i++) b->f[i] -= b->x[i];
  return 0;
}

static void force_functions(void **state) {
  (void)state;
  const msim_force_function gusts = {.size = sizeof gusts,
                                     .flags = MSIM_FORCE_TIME | MSIM_FORCE_VELOCITY,
                                     .name = "gusts",
                                     .evaluate = push_and_brake},
                            trap = {.size = sizeof trap,
                                    .name = "trap",
                                    .evaluate = bowl_force,
                                    .potential = bowl};
  const char *methods[] = {"velocity-verlet", "rk4",  "ssprk102", "ssprk104", "rk6",
                           "dop853",          "heun", "rkc"};
  msim_scene *scene = random_mesh(300, 8, 0.01), *short_rope = folded_rope(4);
  assert_ok(msim_scene_set_force_function(scene, &gusts, err));
  assert_ok(msim_scene_set_force_function(short_rope, &trap, err));
  for (size_t i = 0; i < sizeof methods / sizeof *methods; i++) {
    check_run("gusts", scene, options(methods[i], 1e-4), 40, 4);
    check_run("trap", short_rope, options(methods[i], 1e-3), 40, MOST_RANKS);
  }
  assert_ok(msim_scene_set_force_function(scene, &trap, err));
  check_run("trap", scene, options("velocity-verlet", 1e-4), 40, 4);
  msim_scene_destroy(scene);
  msim_scene_destroy(short_rope);
}

/* One rank alone has a damped spring, but all send velocities. */
static void one_damped_spring(void **state) {
  (void)state;
  msim_scene *rope = folded_rope(41);
  const int32_t ij[2] = {3, 5};
  const double k = 10, rest = 0.1, damping = 0.5;
  assert_ok(msim_scene_add_springs(rope, 1, ij, &k, &rest, &damping, err));
  check_run("one damped spring", rope, options("velocity-verlet", 1e-4), 40, 4);
  check_run("one damped spring", rope, options("rk4", 1e-4), 40, 4);
  msim_scene_destroy(rope);
}

/* A cloth with laws of all kinds, whose springs break at different strains, those between ranks as
 * well; dampers are lost with them */
static msim_scene *breaking_cloth(int32_t side, double damping) {
  msim_scene *scene = hanging_cloth(side, 300, damping);
  msim_scene_view w = {.size = sizeof w};
  int32_t index[1 + LAW_KINDS];
  for (int i = 0; i <= LAW_KINDS; i++) {
    msim_law law = i ? make_law(i - 1) : (msim_law){.size = sizeof law, .kind = MSIM_LAW_LINEAR};
    law.break_strain = 0.01 * (1 + i % 3);
    assert_ok(msim_scene_add_law(scene, &law, &index[i], err));
  }
  msim_scene_get(scene, &w);
  for (int32_t e = 0; e < w.nsprings; e++)
    if (e % 4 != 3)
      assert_ok(msim_scene_set_law(scene, 1, &e, index[e % 7 ? 0 : e / 7 % (1 + LAW_KINDS)], err));
  return scene;
}

static int64_t count_broken(const msim_scene *scene, msim_options opt, int32_t steps) {
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, steps, err));
  const int64_t n = stats_of(sim).broken;
  msim_sim_destroy(sim);
  return n;
}

static void springs_that_break(void **state) {
  (void)state;
  const char *methods[] = {"velocity-verlet", "rk4", "dop853", "verlet", "rkc"};
  msim_scene *cloth = breaking_cloth(15, 0.01);
  for (size_t i = 0; i < sizeof methods / sizeof *methods; i++) {
    const msim_options opt = options(methods[i], 5e-4);
    assert_in_range(count_broken(cloth, opt, 120), 20, 400);
    check_run("breaking cloth", cloth, opt, 120, 4);
  }
  const msim_options midpoint = options("implicit-midpoint", 2e-3);
  assert_in_range(count_broken(cloth, midpoint, 30), 20, 400);
  check_implicit("breaking cloth", cloth, midpoint, 30, 1.25);
  msim_scene_destroy(cloth);
  const double k = 10, rest = 0.1, damping = 0.05; /* of the only damper, which does not break */
  cloth = breaking_cloth(15, 0);
  assert_ok(msim_scene_add_springs(cloth, 1, (int32_t[]){16, 18}, &k, &rest, &damping, err));
  check_run("one damper", cloth, options("velocity-verlet", 5e-4), 120, 4);
  msim_scene_destroy(cloth);
}

static void moving_pins(void **state) {
  (void)state;
  const int32_t corners[2] = {0, 14};
  const double t[3] = {0, 0.003, 0.009},
               x[18] = {0, 0, 0, 1, 0, 0, 0.1, 0, 0.1, 0.9, 0, 0.1, 0, 0.2, 0, 1, 0.1, 0};
  for (int damped = 0; damped < 2; damped++) {
    msim_scene *scene = hanging_cloth(15, 400, damped ? 0.01 : 0);
    const msim_motion motion = {.size = sizeof motion,
                                .n = 2,
                                .particles = corners,
                                .nt = 3,
                                .t = t,
                                .x = x,
                                .interpolation = damped};
    assert_ok(msim_scene_add_motion(scene, &motion, err));
    const char *methods[] = {"velocity-verlet", "rk4", "verlet", "dop853", "rkc"};
    for (size_t i = 0; i < sizeof methods / sizeof *methods; i++)
      check_run("moving pins", scene, options(methods[i], 1e-4), 120, 4);
    msim_scene_destroy(scene);
  }
  msim_scene *bending = bending_cloth(15, 400, 0.01, 0.001);
  move_corners(bending, 15);
  check_run("bending cloth", bending, options("velocity-verlet", 1e-4), 120, 4);
  check_run("bending cloth", bending, options("rk4", 1e-4), 120, 4);
  msim_scene_destroy(bending);
  const int32_t first = 0;
  msim_scene *chain_of_9 = make_chain((chain){9, 100, 0.1, 0.05, 0});
  assert_ok(msim_scene_pin(chain_of_9, 1, &first, err));
  assert_ok(msim_scene_set_gravity(chain_of_9, (double[3]){0, 0, -9.81}, err));
  const msim_motion slide = {.size = sizeof slide,
                             .n = 1,
                             .particles = &first,
                             .nt = 3,
                             .t = t,
                             .x = (double[9]){[3] = 0.01, [7] = 0.02}};
  assert_ok(msim_scene_add_motion(chain_of_9, &slide, err));
  check_run("chain", chain_of_9, options("velocity-verlet", 1e-4), 120, MOST_RANKS);
  check_run("chain", chain_of_9, options("rk4", 1e-4), 120, MOST_RANKS);
  msim_scene_destroy(chain_of_9);
}

static void moving_collider(void **state) {
  (void)state;
  msim_scene *scene = random_mesh(300, 9, 0);
  const double u[3] = {0.2, 0, 3}, w[3] = {0, 2, 0}, at[3] = {0.5, 0.5, -0.4};
  const msim_collider box = {.size = sizeof box,
                             .type = MSIM_COLLIDER_BOX,
                             .center = {0.5, 0.5, -0.4},
                             .extent = {2, 2, 0.6},
                             .restitution = 0.3,
                             .friction = 0.2};
  assert_ok(msim_scene_add_collider(scene, &box, err));
  set_uniform(scene, at, u, w);
  check_run("moving collider", scene, options("velocity-verlet", 1e-4), 200, 4);
  check_run("moving collider", scene, options("rk4", 1e-4), 200, 4);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(laws_of_springs),    cmocka_unit_test(angular_springs),
      cmocka_unit_test(force_functions),    cmocka_unit_test(one_damped_spring),
      cmocka_unit_test(springs_that_break), cmocka_unit_test(moving_pins),
      cmocka_unit_test(moving_collider),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
