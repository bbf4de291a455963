/* Reflection at planes: bounce, slide, corner, incline, and what the notes' Heun does instead. */
#include <math.h>
#include <string.h>

#include "scenes.h"

/* One step of free flight into a plane: the reflected state in closed form, for every method.
 * Without gravity all of them predict x + h v, v. */
static void one_reflection_in_closed_form(void **state) {
  (void)state;
  const double x[3] = {0, 0, 0.1}, v[3] = {3, 4, -2}, e = 0.5, mu = 0.25, h = 0.1;
  /* s = -0.1, J = 1.5 * 2 = 3, |v_t| = 5: tangential part times 1 - 0.25 * 3/5 = 0.85 */
  const double x1[3] = {0.3, 0.4, 0.05}, v1[3] = {2.55, 3.4, 1};
  for (int32_t m = 0; method_at(m); m++) {
    msim_scene *scene = single(x, v, 0);
    plane(scene, 0, 0, 2, 0, e, mu);
    msim_options opt = options(method_at(m), h);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 1, err));
    msim_state s = state_of(sim);
    /* heun takes the mean of the velocities before and after: same here, as a = 0 */
    for (int c = 0; c < 3; c++) assert_close(s.x[c], x1[c], 1e-15);
    for (int c = 0; c < 3; c++) assert_close(s.v[c], v1[c], 1e-15);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* e = 1: dropped from 1 m it comes back to 1 m, up to the first order of the reflection */
static void ball_bounces_back(void **state) {
  (void)state;
  const double x[3] = {0, 0, 1}, v[3] = {0, 0, 0}, period = 2 * sqrt(2 / 9.81);
  for (int32_t m = 0; method_at(m); m++) {
    msim_scene *scene = single(x, v, 9.81);
    plane(scene, 0, 0, 1, 0, 1, 0);
    msim_options opt = options(method_at(m), period / 20000);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 20000, err));
    assert_close(state_of(sim).x[2], 1, 2e-3);
    assert_int_equal(stats_of(sim).contacts > 0, 1);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* The notes' Heun reflects the stage only: with e = 1 the particle slides into the plane for ever,
 * with e < 1 it sinks through. The other two bounce. */
static void literal_heun_never_bounces(void **state) {
  (void)state;
  const double x[3] = {0, 0, 1}, v[3] = {0, 0, 0}, h = 1e-3;
  for (int mode = MSIM_HEUN_FINAL; mode <= MSIM_HEUN_LITERAL; mode++)
    for (int soft = 0; soft < 2; soft++) {
      msim_scene *scene = single(x, v, 9.81);
      plane(scene, 0, 0, 1, 0, soft ? 0.8 : 1, 0);
      msim_options opt = options("heun", h);
      opt.heun_collision = mode;
      msim_sim *sim = make_sim(scene, &opt);
      double after = -1, fastest = -1;
      for (int i = 0; i < 3000; i++) {
        assert_ok(msim_sim_step(sim, 1, err));
        if (i < 460) continue; /* the impact is at 0.4515 s */
        after = fmax(after, state_of(sim).x[2]);
        fastest = fmax(fastest, state_of(sim).v[2]);
      }
      if (mode == MSIM_HEUN_LITERAL) {
        /* v' = v + h g for ever; with e = 1 x' = x + g h^2/2 while the stage is reflected */
        assert_true(fastest < 0);
        assert_close(state_of(sim).v[2], -9.81 * 3000 * h, 1e-9);
        assert_true(after < h * 4.43 + 3000 * 9.81 * h * h / 2);
        if (soft) assert_true(state_of(sim).x[2] < -0.5);
      } else {
        assert_true(after > (soft ? 0.6 : 0.98));
        assert_true(state_of(sim).x[2] > -1e-12);
      }
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

/* Sliding on the floor with e = 0: each step takes mu g h from the speed, v^2 / (2 mu g) in all */
static void friction_stops_a_slider(void **state) {
  (void)state;
  const double x[3] = {0, 0, 0}, v[3] = {2, 0, 0}, mu = 0.5, g = 10, h = 1e-4;
  msim_scene *scene = single(x, v, g);
  plane(scene, 0, 0, 1, 0, 0, mu);
  msim_options opt = options("symplectic-euler", h);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 10000, err));
  msim_state s = state_of(sim);
  assert_close(s.x[0], 2 * 2 / (2 * mu * g), 2 * h);
  assert_close(s.v[0], 0, 1e-12);
  assert_close(s.x[2], 0, 1e-12);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* An incline of slope angle a. mu > tan a: it sticks, and creeps g sin(a) h^2 a step, as only the
 * normal position is put back. mu < tan a: it slides with g (sin a - mu cos a). */
static void incline_sticks_or_slides(void **state) {
  (void)state;
  const double a = 0.3, g = 10, h = 1e-3, x[3] = {0, 0, 0}, v[3] = {0, 0, 0};
  const int steps = 1000;
  for (int slides = 0; slides < 2; slides++) {
    msim_scene *scene = single(x, v, g);
    double mu = slides ? 0.1 : 0.5;
    plane(scene, sin(a), 0, cos(a), 0, 0, mu);
    msim_options opt = options("symplectic-euler", h);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, steps, err));
    msim_state s = state_of(sim);
    double along = s.x[0] * cos(a) - s.x[2] * sin(a), t = steps * h;
    if (slides) assert_close(along, 0.5 * g * (sin(a) - mu * cos(a)) * t * t, 5e-3);
    else assert_close(along, steps * g * sin(a) * h * h, 1e-10);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* A corner of floor and wall: planes in their order, each sees the result of the one before; the
 * particle counts once. */
static void corner_reflects_twice_and_counts_once(void **state) {
  (void)state;
  const double x[3] = {0.05, 0, 0.1}, v[3] = {-1, 0, -2};
  msim_scene *scene = single(x, v, 0);
  plane(scene, 0, 0, 1, 0, 0.5, 0);
  plane(scene, 1, 0, 0, 0, 1, 0);
  msim_options opt = options("explicit-euler", 0.1);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 1, err));
  msim_state s = state_of(sim);
  assert_close(s.x[0], 0.05, 1e-15);
  assert_close(s.x[2], 0.05, 1e-15);
  assert_close(s.v[0], 1, 1e-15);
  assert_close(s.v[2], 1, 1e-15);
  assert_int_equal(stats_of(sim).contacts, 1);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void leaving_particle_keeps_its_velocity(void **state) {
  (void)state;
  const double x[3] = {0, 0, -1}, v[3] = {0, 0, 2};
  msim_scene *scene = single(x, v, 0);
  plane(scene, 0, 0, 1, 0, 1, 0.5);
  msim_options opt = options("explicit-euler", 0.1);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 1, err));
  assert_close(state_of(sim).x[2], 0.8, 1e-15);
  assert_true(state_of(sim).v[2] == 2);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void pinned_particles_are_not_reflected(void **state) {
  (void)state;
  const double x[3] = {0, 0, -1}, v[3] = {0, 0, 0};
  const int32_t pin = 0;
  for (int32_t m = 0; method_at(m); m++) {
    msim_scene *scene = single(x, v, 9.81);
    plane(scene, 0, 0, 1, 0, 1, 0);
    assert_ok(msim_scene_pin(scene, 1, &pin, err));
    msim_options opt = options(method_at(m), 0.1);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 10, err));
    assert_memory_equal(state_of(sim).x, x, sizeof x);
    assert_memory_equal(state_of(sim).v, v, sizeof v);
    assert_int_equal(stats_of(sim).contacts, 0);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(one_reflection_in_closed_form),
                                     cmocka_unit_test(ball_bounces_back),
                                     cmocka_unit_test(literal_heun_never_bounces),
                                     cmocka_unit_test(friction_stops_a_slider),
                                     cmocka_unit_test(incline_sticks_or_slides),
                                     cmocka_unit_test(corner_reflects_twice_and_counts_once),
                                     cmocka_unit_test(leaving_particle_keeps_its_velocity),
                                     cmocka_unit_test(pinned_particles_are_not_reflected)};
  return cmocka_run_group_tests_name("planes", tests, NULL, NULL);
}
