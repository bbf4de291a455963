/* Stiff solids land on planes, many particles in one step, under implicit methods and collision =
 * event: nothing blows up, what is left slides or sticks as a rigid body does. */
#include <math.h>

#include "events.h"

enum { CASES = 16, SIDE = 4, N = SIDE * SIDE * SIDE };

static const double G = 9.81, SLOPE = 0.1; /* the angle of gravity */

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

/* The means along the slope and normal to it. */
static void mean(const double *of, double to[2]) {
  to[0] = to[1] = 0;
  for (int p = 0; p < N; p++) to[0] += of[3 * p] / N, to[1] += of[3 * p + 2] / N;
}

/* After a second */
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

static void without_friction_it_slides_as_gravity_has_it(void **state) {
  (void)state;
  for (int i = 0; i < CASES; i++) {
    double v[2];
    land(methods[i % 4], block(stiffness[i / 4 % 2], heights[i / 8], 0.5 * (i % 3), 0), v);
    assert_close(v[0], G * sin(SLOPE), 1e-4);
    assert_close(v[1], 0, 1e-3);
  }
}

/* From rest to rest planes push as much as weight pulls, bounces included, so friction takes what
 * it takes without any. That of an impact, being that of the start of a part, is of the right size
 * only. */
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

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(without_friction_it_slides_as_gravity_has_it),
                                     cmocka_unit_test(on_a_rough_slope_it_slides_slower),
                                     cmocka_unit_test(on_a_rougher_one_it_sticks)};
  return cmocka_run_group_tests_name("landing", tests, NULL, NULL);
}
