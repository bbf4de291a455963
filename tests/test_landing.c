/* Tests of stiff solids that land on planes, many particles in one step, for implicit methods with
 * collision = event: energy does not grow, and the solid slides or sticks as a rigid body does. And
 * of soft ones for integrator = auto: errors keep tol. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "contact/impact_location.h"
#include "event_options.h"
#include "sim/sim.h"

enum { CASES = 16, SIDE = 4, N = SIDE * SIDE * SIDE };

static const double G = 9.81, SLOPE = 0.1; /* angle of the slope, by tilted gravity, rad */

static msim_scene *block(double k, double height, double restitution, double friction) {
  const double gravity[3] = {G * sin(SLOPE), 0, -G * cos(SLOPE)};
  const msim_lattice lattice = {.size = sizeof lattice,
                                .n = {SIDE, SIDE, SIDE},
                                .origin = {0, 0, height},
                                .extent = {0.3, 0.3, 0.3},
                                .mass = 1,
                                .k = k,
                                .damping = 0.5};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  plane(scene, 0, 0, 1, 0, restitution, friction);
  return scene;
}

/* Mean of the components along the slope and normal to it. */
static void mean(const double *of, double to[2]) {
  to[0] = to[1] = 0;
  for (int p = 0; p < N; p++) to[0] += of[3 * p] / N, to[1] += of[3 * p + 2] / N;
}

/* Velocity after one second */
static void land(const char *method, msim_scene *scene, double v[2]) {
  msim_options opt = options(method, 1.0 / 60);
  opt.collision = MSIM_COLLISION_EVENT;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 60, err));
  const msim_state s = state_of(sim);
  mean(s.v, v);
  for (int p = 0; p < N; p++) assert_true(s.x[3 * p + 2] > -1e-9 && s.x[3 * p + 2] < 0.31);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static const char *const methods[] = {"linearly-implicit-euler", "implicit-euler", "bdf2",
                                      "tr-bdf2"};
static const double stiffness[] = {1e4, 3e5}, heights[] = {0, 0.2};

static void without_friction_it_slides_freely(void **state) {
  (void)state;
  for (int i = 0; i < CASES; i++) {
    double v[2];
    land(methods[i % 4], block(stiffness[i / 4 % 2], heights[i / 8], 0.5 * (i % 3), 0), v);
    assert_close(v[0], G * sin(SLOPE), 1e-4);
    assert_close(v[1], 0, 1e-3);
  }
}

/* From rest to rest the impulse of the planes equals that of the weight, bounces included, so that
 * friction slows the block as it does without bounces. The friction of an impact, which is computed
 * with the start of a substep, is right in order of magnitude only. */
static void on_a_rough_slope_it_slides_slower(void **state) {
  (void)state;
  const double mu = 0.05, slides = G * (sin(SLOPE) - mu * cos(SLOPE));
  for (int i = 0; i < CASES; i++) {
    const double e = 0.5 * (i % 3), fallen = sqrt(2 * heights[i / 8] * G * cos(SLOPE));
    double v[2];
    land(methods[i % 4], block(stiffness[i / 4 % 2], heights[i / 8], e, mu), v);
    print_message("  %-24s %6g N/m, from %3g m: %.4f m/s, rigid %.4f\n", methods[i % 4],
                  stiffness[i / 4 % 2], heights[i / 8], v[0], slides);
    assert_close(v[0], slides, 0.02 + 1.5 * mu * (1 + e) * fallen);
  }
}

static void on_a_rougher_one_it_sticks(void **state) {
  (void)state;
  for (int i = 0; i < CASES; i++) {
    double v[2];
    land(methods[i % 4], block(stiffness[i / 4 % 2], heights[i / 8], 0.5 * (i % 3), 0.5), v);
    assert_close(v[0], 0, 1e-3);
    assert_close(v[1], 0, 1e-3);
  }
}

/*------------------------------------- in a wedge -----------------------------------------------*/

static int are_neighbours(int p, int q) {
  return abs(p / (SIDE * SIDE) - q / (SIDE * SIDE)) <= 1 &&
         abs(p / SIDE % SIDE - q / SIDE % SIDE) <= 1 && abs(p % SIDE - q % SIDE) <= 1;
}

/* The same lattice rotated about y, its lowest particles at z = 0.05 m. */
static msim_scene *turned_block(double k, double angle) {
  const double gravity[3] = {0, 0, -G};
  double x[3 * N], mass[N], ks[13 * N], damping[13 * N], lowest = INFINITY;
  int32_t ij[2 * 13 * N], n = 0;
  msim_scene *scene;
  for (int p = 0; p < N; p++) {
    const double a = 0.1 * (p / (SIDE * SIDE)), c = 0.1 * (p % SIDE);
    x[3 * p] = a * cos(angle) - c * sin(angle);
    x[3 * p + 1] = 0.1 * (p / SIDE % SIDE);
    x[3 * p + 2] = a * sin(angle) + c * cos(angle);
    lowest = fmin(lowest, x[3 * p + 2]);
    mass[p] = 1. / N;
    for (int q = p + 1; q < N; q++)
      if (are_neighbours(p, q)) ks[n] = k, damping[n] = 0.5, ij[2 * n] = p, ij[2 * n + 1] = q, n++;
  }
  for (int p = 0; p < N; p++) x[3 * p + 2] += 0.05 - lowest;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, N, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, n, ij, ks, NULL, damping, err));
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  return scene;
}

typedef struct wedge_case {
  const char *method;
  double k, angle, restitution; /* angle in degrees */
} wedge_case;

/* Particles less than 1e-11 of the scene's extent behind a plane count as in contact (impacts.h);
 * this scene is smaller than 1 m. Few scenes show each fault, so all digits matter. Regressions:
 * contacts released by their acceleration alone, without the impulses of the step, ended 4.7e-6 m
 * behind a plane (first scene); particles that stuck at one plane and hit the other were returned
 * to the start of the step, which gave the springs up to 1500 J; the last pass left particles
 * behind planes. The implicit midpoint rule stretches stiff rotating springs, also in free flight:
 * its energy is not checked. */
static const wedge_case wedge_cases[] = {
    {"implicit-midpoint", 334080.2909315968, 27.785363420975248, 1},
    {"implicit-midpoint", 1e6, 6.6, 1},
    {"implicit-midpoint", 1e6, 39.6, 0.5},
    {"trapezoidal", 1e6, 33, 1},
    {"newmark", 1e6, 6.6, 0.5},
    {"linearly-implicit-euler", 1e6, 16.5, 0.5},
    {"implicit-euler", 1e6, 26.4, 1},
    {"bdf2", 1e6, 0, 1},
    {"tr-bdf2", 1e6, 3.3, 1},
    {"sdirk2", 1e6, 36.3, 0.5},
};

static void fall_into_a_wedge(const wedge_case *c) {
  const double n = sqrt(0.5), offset[2] = {-0.05, -0.25};
  msim_scene *scene = turned_block(c->k, c->angle * acos(-1) / 180);
  plane(scene, n, 0, n, offset[0], c->restitution, 0.1);
  plane(scene, -n, 0, n, offset[1], c->restitution, 0.1);
  msim_options opt = options(c->method, 1.0 / 60);
  opt.collision = MSIM_COLLISION_EVENT;
  msim_sim *sim = make_sim(scene, &opt);
  msim_energy energy = {.size = sizeof energy};
  msim_sim_energy(sim, &energy);
  const double gains = strcmp(c->method, "implicit-midpoint") == 0, start = energy.total;
  for (int step = 0; step < 60; step++) {
    assert_ok(msim_sim_step(sim, 1, err));
    const double *x = state_of(sim).x;
    for (int p = 0; p < N; p++) {
      assert_true(n * (x[3 * p] + x[3 * p + 2]) - offset[0] >= -1e-11);
      assert_true(n * (x[3 * p + 2] - x[3 * p]) - offset[1] >= -1e-11);
    }
    msim_sim_energy(sim, &energy);
    assert_true(gains || energy.total <= start + 1e-9);
  }
  assert_true(stats_of(sim).contacts > 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void in_a_wedge_energy_does_not_grow_and_nothing_ends_behind_a_plane(void **state) {
  (void)state;
  for (size_t i = 0; i < sizeof wedge_cases / sizeof *wedge_cases; i++)
    fall_into_a_wedge(&wedge_cases[i]);
}

/* Dampers that exceed the stiffness of bending springs, c > k_bend h/10: the full matrix is of no
 * use where the cloth buckles, and the velocities of contacts have to be kept from the start.
 * Neither may keep Newton's method from converging in half of newton.max_iterations. */
/* Stiff solids that fall on a ball and roll off it: with h w > 2 Newton's method may arrive at
 * another minimum, with cells inside out, whose energy a step must not take. */
static void on_a_ball_solids_do_not_turn_inside_out(void **state) {
  (void)state;
  static const struct {
    int32_t n[3];
    double origin[3], k, mass, gravity[3];
  } cases[] = {{{3, 5, 3}, {-0.01, -0.23, 0.01}, 1145, 0.45, {-1.4, -1.6, -9.81}},
               {{5, 5, 3}, {-0.22, -0.07, 0.02}, 4903, 0.25, {1.1, 0.6, -9.81}},
               {{5, 3, 3}, {0.06, -0.2, 0.27}, 1036, 0.14, {1, -2.7, -9.81}}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    msim_lattice lattice = {
        .size = sizeof lattice, .extent = {0.3, 0.3, 0.3}, .mass = cases[i].mass, .k = cases[i].k};
    msim_collider ball = {.size = sizeof ball,
                          .type = MSIM_COLLIDER_SPHERE,
                          .center = {0, 0, -0.6},
                          .radius = 0.6,
                          .restitution = 0.3};
    msim_scene *scene;
    memcpy(lattice.n, cases[i].n, sizeof lattice.n);
    memcpy(lattice.origin, cases[i].origin, sizeof lattice.origin);
    assert_ok(msim_scene_create(NULL, &scene, err));
    assert_ok(msim_scene_add_lattice(scene, &lattice, err));
    assert_ok(msim_scene_set_gravity(scene, cases[i].gravity, err));
    assert_ok(msim_scene_add_collider(scene, &ball, err));
    plane(scene, 0, 0, 1, -1.5, 0.3, 0);
    msim_options opt = options("implicit-euler", 1.0 / 60);
    opt.collision = MSIM_COLLISION_EVENT;
    msim_sim *sim = make_sim(scene, &opt);
    const double start = energy_less_work(sim);
    for (int step = 0; step < 300; step++) {
      assert_ok(msim_sim_step(sim, 1, err));
      assert_true(energy_less_work(sim) < start + 1e-3);
    }
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

static void a_damped_cloth_on_a_ball_takes_few_iterations(void **state) {
  (void)state;
  enum { WIDE = 20, STEPS = 10, MOST_IN_A_STEP = 500 };
  const double gravity[3] = {0, 0, -9.81};
  const msim_cloth cloth = {.size = sizeof cloth,
                            .rows = WIDE,
                            .columns = WIDE,
                            .origin = {-0.5, -0.5, 0},
                            .row = {0, 1, 0},
                            .column = {1, 0, 0},
                            .mass = 0.03,
                            .k_structural = 100,
                            .k_shear = 50,
                            .k_bend = 5,
                            .damping = 0.01};
  const msim_collider ball = {.size = sizeof ball,
                              .type = MSIM_COLLIDER_SPHERE,
                              .center = {0.05, 0.03, -0.22},
                              .radius = 0.2,
                              .friction = 0.3};
  for (int32_t collision = 0; collision < 2; collision++) {
    msim_options opt = options("implicit-euler", 1.0 / 60);
    opt.collision = collision ? MSIM_COLLISION_EVENT : MSIM_COLLISION_REFLECT;
    msim_scene *scene;
    assert_ok(msim_scene_create(NULL, &scene, err));
    assert_ok(msim_scene_add_cloth(scene, &cloth, err));
    assert_ok(msim_scene_set_gravity(scene, gravity, err));
    assert_ok(msim_scene_add_collider(scene, &ball, err));
    msim_sim *sim = make_sim(scene, &opt);
    for (int64_t before = 0; state_of(sim).step < STEPS; before = stats_of(sim).newton_iterations) {
      assert_ok(msim_sim_step(sim, 1, err));
      assert_true(stats_of(sim).newton_iterations - before <= MOST_IN_A_STEP);
    }
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* A soft block that falls onto a plane, with its own damping, restitution and friction */
static msim_scene *falling_block(unsigned *seed) {
  const double g[3] = {0, 0, -9.81}, damped = uniform(seed), rough = uniform(seed);
  const int32_t side = 5;
  const msim_lattice block = {.size = sizeof block,
                              .n = {side, side, side},
                              .origin = {0, 0, 0.02 + 0.04 * uniform(seed)},
                              .extent = {0.2, 0.2, 0.2},
                              .mass = 1,
                              .k = 400 * pow(10, uniform(seed)),
                              .damping = fmax(0, damped - 0.4)};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &block, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  plane(scene, 0.4 * uniform(seed) - 0.2, 0.1, 1, 0, uniform(seed), fmax(0, rough - 0.4));
  return scene;
}

/* Fixed steps that are divided at impacts do not exceed the limit that the steps use. */
static void check_located_steps(const msim_sim *sim) {
  const ms_method_choice *s = &sim->config.choice;
  const double omega = ms_bounds_compute_island(&sim->islands[0].model).omega;
  for (const ms_candidate *c = s->candidates; c < s->candidates + MS_CANDIDATES; c++) {
    const double limit = ms_impact_location_longest_step(c->method, omega);
    if (c->control_tol > 0 || c->collision != MSIM_COLLISION_EVENT || limit == 0) continue;
    assert_true(c->h <= limit);
  }
}

/* Root mean square of the difference of positions from those of error control, relative to the
 * extent */
static double block_error(const msim_scene *scene, double t_end, double tol) {
  const double EXACT = 1e-6, EXTENT = 0.2;
  msim_sim *sim[2];
  msim_state end[2] = {{.size = sizeof *end}, {.size = sizeof *end}};
  double sum = 0;
  for (int i = 0; i < 2; i++) {
    msim_options o;
    msim_options_init(&o, sizeof o);
    o.integrator = i ? "dop853" : "auto", o.tol = i ? EXACT : tol, o.t_end = t_end, o.threads = 1;
    assert_ok(msim_sim_create(scene, &o, &sim[i], err));
    assert_ok(msim_sim_run(sim[i], NULL, NULL, err));
    msim_sim_state(sim[i], &end[i]);
  }
  check_located_steps(sim[0]);
  for (int32_t k = 0; k < 3 * end[0].n; k++) sum += pow((end[0].x[k] - end[1].x[k]) / EXTENT, 2);
  for (int i = 0; i < 2; i++) msim_sim_destroy(sim[i]);
  return sqrt(sum / (2 * end[0].n));
}

/* Blocks whose errors depend most on impacts after the trials of `auto`, of 60 at random */
static void auto_keeps_tol_for_soft_blocks(void **state) {
  (void)state;
  enum { COUNT = 5 };
  static const int hard[COUNT] = {10, 44, 54, 55, 59};
  unsigned seed = 1;
  for (int i = 0, k = 0; i < 60; i++) {
    const double tol = pow(10, -3 - 1.5 * uniform(&seed)), t_end = 0.1 + 0.1 * uniform(&seed);
    msim_scene *scene = falling_block(&seed);
    if (k < COUNT && i == hard[k]) k++, assert_true(block_error(scene, t_end, tol) < tol);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(on_a_ball_solids_do_not_turn_inside_out),
      cmocka_unit_test(a_damped_cloth_on_a_ball_takes_few_iterations),
      cmocka_unit_test(auto_keeps_tol_for_soft_blocks),
      cmocka_unit_test(without_friction_it_slides_freely),
      cmocka_unit_test(on_a_rough_slope_it_slides_slower),
      cmocka_unit_test(on_a_rougher_one_it_sticks),
      cmocka_unit_test(in_a_wedge_energy_does_not_grow_and_nothing_ends_behind_a_plane)};
  return cmocka_run_group_tests_name("landing", tests, NULL, NULL);
}
