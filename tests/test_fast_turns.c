/* Tests of integrator = auto where springs swing through short lengths: many short events, which
 * fixed steps miss. It takes error control, and keeps tol. */
#include <math.h>
#include <string.h>

#include "auto_scenes.h"
#include "choose/fast_turns.h"
#include "choose/rejection_reasons.h"
#include "methods/methods.h"

enum { MOST_PARTICLES = 80 };

/* Numbers without a pattern in [-1/2, 1/2) */
static double scatter(int i, double ratio) { return fmod((i + 1) * ratio, 1) - 0.5; }

/* Each particle hangs on two others by springs of this part of their length at rest; masses of 0.05
 * kg move at up to 2 m/s. */
static msim_scene *network(int n, double part) {
  const double mass = 0.05, k = 300;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int i = 0; i < n; i++) {
    const double x[3] = {scatter(i, 0.8191725134), scatter(i, 0.6710436067), scatter(i, 0.5497)};
    const double v[3] = {4 * scatter(i, 0.237), 4 * scatter(i, 0.3719), 4 * scatter(i, 0.1573)};
    assert_ok(msim_scene_add_particles(scene, 1, x, v, &mass, err));
  }
  for (int i = 2; i < n; i++)
    for (int to = 0; to < 2; to++) {
      const int32_t ij[2] = {to ? i - 1 : i / 2 - (i < 4), i};
      const double *a = scene->data->x + 3 * ij[0], *b = scene->data->x + 3 * ij[1];
      const double rest = part * hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
      assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
    }
  return scene;
}

static msim_sim *run(const msim_scene *scene, const char *method, double tol, double t_end) {
  const msim_options opt = options_of(method, tol, t_end);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  return sim;
}

/* The candidates that are rejected for this reason */
static int count_rejected(const msim_sim *sim) {
  const ms_candidate *all = sim->config.choice.candidates;
  int n = 0;
  for (const ms_candidate *c = all; c < all + MS_CANDIDATES; c++)
    n += c->rejection == MS_REASON_FAST_TURNS;
  return n;
}

/* With fixed steps the largest network has errors of 0.04 with tol = 1e-3, 9e-5 with 1e-8. */
static void error_control_keeps_tol(void **state) {
  (void)state;
  const int sizes[] = {16, 40, MOST_PARTICLES};
  const double t_end = 0.15;
  for (int s = 0; s < 3; s++) {
    msim_scene *scene = network(sizes[s], 0.4);
    double exact[3 * MOST_PARTICLES];
    msim_sim *sim = run(scene, "dop853", 1e-11, t_end);
    memcpy(exact, state_of(sim).x, sizeof *exact * 3 * (size_t)sizes[s]);
    msim_sim_destroy(sim);
    for (double tol = 1e-3; tol > 1e-8; tol /= 10) {
      sim = run(scene, "auto", tol, t_end);
      assert_ptr_equal(sim->config.integrator, &ms_dop853);
      assert_close(sim->config.opt.tol, tol, 0);
      assert_true(count_rejected(sim) > 0);
      assert_true(largest_difference(state_of(sim).x, exact, 3 * sizes[s]) < tol);
      msim_sim_destroy(sim);
    }
    msim_scene_destroy(scene);
  }
}

/* Springs of rest length 0 are linear, so that their direction does not matter; those of a rope
 * and of a cloth turn slowly. */
static void fixed_steps_stay_where_springs_turn_slowly(void **state) {
  (void)state;
  msim_scene *const scene[] = {network(40, 0), swinging_rope(40, 500, 0), hanging_cloth(9, 500, 0)};
  for (size_t i = 0; i < sizeof scene / sizeof *scene; i++) {
    const msim_options opt = options_of("auto", 1e-4, 0.5);
    msim_sim *sim = make_sim(scene[i], &opt);
    assert_true(sim->config.opt.tol == 0);
    assert_int_equal(count_rejected(sim), 0);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene[i]);
  }
}

/* Two particles turn about each other, by less than 8 degrees within h or by more, or pass through
 * each other. */
static void the_angle_decides(void **state) {
  (void)state;
  const double x[6] = {0, 0, 0, 1, 0, 0}, mass[2] = {1, 1}, k = 1;
  const double speed[3][2] = {{0, 0.139}, {0, 0.143}, {-1.5, 0}};
  const int32_t ij[2] = {0, 1};
  for (int of = 0; of < 3; of++)
    for (int way = 0; way < 3; way++) {
      const double v[6] = {0, 0, 0, speed[way][0], 0, speed[way][1]}, still[6] = {0}, rest = 1;
      msim_scene *scene;
      assert_ok(msim_scene_create(NULL, &scene, err));
      assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
      assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
      const msim_options opt = options("velocity-verlet", 1);
      msim_sim *sim = make_sim(scene, &opt);
      double at[6], moving[6], resting[6];
      memcpy(at, x, sizeof at), memcpy(moving, v, sizeof moving);
      memcpy(resting, still, sizeof resting);
      const ms_pilot_run p = {.sim = sim,
                              .start = {.x = at, .v = of == 0 ? moving : resting},
                              .middle = {.x = at, .v = of == 1 ? moving : resting},
                              .end = {.x = at, .v = of == 2 ? moving : resting}};
      assert_int_equal(ms_fast_turns_are_there(&p, 1), way > 0);
      assert_int_equal(ms_fast_turns_are_there(&p, 0.5), 0);
      assert_int_equal(ms_fast_turns_are_there(&p, 2), 1);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(error_control_keeps_tol),
                                     cmocka_unit_test(fixed_steps_stay_where_springs_turn_slowly),
                                     cmocka_unit_test(the_angle_decides)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
