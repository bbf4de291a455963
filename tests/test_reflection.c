/* Tests of reflection at planes: bounce, sliding, corner, incline, and the variants of Heun's
 * method. */
#include <math.h>
#include <string.h>

#include "contact/impacts.h"
#include "scenes.h"

/* One step of free flight into a plane: the reflected state in closed form, for every method.
 * Without gravity all of them predict x + h v, v. */
static void one_reflection_in_closed_form(void **state) {
  (void)state;
  const double x[3] = {0, 0, 0.1}, v[3] = {3, 4, -2}, e = 0.5, mu = 0.25, h = 0.1;
  /* s = -0.1, J = 1.5 * 2 = 3, |v_t| = 5: tangential part times 1 - 0.25 * 3/5 = 0.85 */
  const double x1[3] = {0.3, 0.4, 0.05}, v1[3] = {2.55, 3.4, 1};
  for (int32_t m = 0; method_at(m); m++) {
    if (refuses_planes(method_at(m))) continue;
    msim_scene *scene = make_single_particle(x, v, 0);
    plane(scene, 0, 0, 2, 0, e, mu);
    msim_options opt = options(method_at(m), h);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 1, err));
    msim_state s = state_of(sim);
    /* heun takes the mean of the velocities before and after: the same here, as a = 0 */
    for (int c = 0; c < 3; c++) assert_close(s.x[c], x1[c], 1e-15);
    for (int c = 0; c < 3; c++) assert_close(s.v[c], v1[c], 1e-15);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* e = 1: dropped from 1 m the ball returns to 1 m, up to the first order of the reflection */
static void ball_bounces_back(void **state) {
  (void)state;
  const double x[3] = {0, 0, 1}, v[3] = {0, 0, 0}, period = 2 * sqrt(2 / 9.81);
  for (int32_t m = 0; method_at(m); m++) {
    if (refuses_planes(method_at(m))) continue;
    msim_scene *scene = make_single_particle(x, v, 9.81);
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

/* The step after a reflection is that from the reflected state: a stage at the end of the step
 * before, of the state before reflection, is not used. */
static void no_stage_outlives_a_reflection(void **state) {
  (void)state;
  const double x[6] = {0, 0, 0.05, 0, 0, 0.15}, v[6] = {0, 0, -1, 0, 0, -1}, mass[2] = {1, 1};
  const double k = 300, rest = 0.1, damping = 0.1;
  const int32_t ij[2] = {0, 1};
  const char *const methods[] = {"velocity-verlet", "rk4", "ssprk102", "ssprk104", "rk6", "dop853"};
  for (int m = 0; m < 6; m++) {
    msim_scene *scene;
    assert_ok(msim_scene_create(NULL, &scene, err));
    assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, &damping, err));
    plane(scene, 0, 0, 1, 0, 0.5, 0);
    msim_options opt = options(methods[m], 0.01);
    opt.steps = 100;
    msim_sim *sim = make_sim(scene, &opt), *fresh = make_sim(scene, &opt);
    while (stats_of(sim).contacts == 0) assert_ok(msim_sim_step(sim, 1, err));
    const msim_state bounced = state_of(sim);
    assert_ok(msim_sim_set_state(fresh, &bounced, err));
    assert_ok(msim_sim_step(sim, 1, err));
    assert_ok(msim_sim_step(fresh, 1, err));
    assert_memory_equal(state_of(sim).x, state_of(fresh).x, sizeof x);
    assert_memory_equal(state_of(sim).v, state_of(fresh).v, sizeof v);
    msim_sim_destroy(sim), msim_sim_destroy(fresh);
    msim_scene_destroy(scene);
  }
}

/* heun.collision = literal reflects only the stage x* = x + h v, v* = v + h a, as Teschner's
 * exercises print it, and not the result: with e = 1 the particle slides into the plane for ever,
 * with e < 1 it sinks through. The other two variants bounce. */
static void literal_heun_never_bounces(void **state) {
  (void)state;
  const double x[3] = {0, 0, 1}, v[3] = {0, 0, 0}, h = 1e-3;
  for (int mode = MSIM_HEUN_FINAL; mode <= MSIM_HEUN_LITERAL; mode++)
    for (int soft = 0; soft < 2; soft++) {
      msim_scene *scene = make_single_particle(x, v, 9.81);
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

/* Sliding on the floor with e = 0: each step reduces the speed by mu g h; the way is v^2 / (2 mu
 * g) */
static void friction_stops_a_slider(void **state) {
  (void)state;
  const double x[3] = {0, 0, 0}, v[3] = {2, 0, 0}, mu = 0.5, g = 10, h = 1e-4;
  msim_scene *scene = make_single_particle(x, v, g);
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

/* An incline of angle a. mu > tan a: the particle sticks, and creeps by g sin(a) h^2 per step, as
 * only the normal position is corrected. mu < tan a: it slides with g (sin a - mu cos a). */
static void incline_sticks_or_slides(void **state) {
  (void)state;
  const double a = 0.3, g = 10, h = 1e-3, x[3] = {0, 0, 0}, v[3] = {0, 0, 0};
  const int steps = 1000;
  for (int slides = 0; slides < 2; slides++) {
    msim_scene *scene = make_single_particle(x, v, g);
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

/* A corner of floor and wall: planes act in their order, each on the result of the one before; the
 * particle counts once. */
static void corner_reflects_twice_and_counts_once(void **state) {
  (void)state;
  const double x[3] = {0.05, 0, 0.1}, v[3] = {-1, 0, -2};
  msim_scene *scene = make_single_particle(x, v, 0);
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
  msim_scene *scene = make_single_particle(x, v, 0);
  plane(scene, 0, 0, 1, 0, 1, 0.5);
  msim_options opt = options("explicit-euler", 0.1);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 1, err));
  assert_close(state_of(sim).x[2], 0.8, 1e-15);
  assert_true(state_of(sim).v[2] == 2);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static double norm(const double v[3]) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

/* Free flight between two walls: z and its velocity after a time h; gap: the distance of the
 * walls */
static void fly_between_walls(double gap, double e, double h, double *z, double *v) {
  while (*v != 0) {
    const double until = (*v > 0 ? gap - *z : -*z) / *v;
    if (until >= h) break;
    *z = *v > 0 ? gap : 0;
    h -= until;
    *v *= -e;
  }
  *z += h * *v;
}

/* A step many times as long as the flight across the gap: each reflection stands for a bounce. So
 * it does for e < 1, as the penetration shrinks with the velocity. */
static void slabs_confine_fast_particles(void **state) {
  (void)state;
  unsigned seed = 4;
  for (int i = 0; i < 150; i++) {
    const double gap = pow(10, -3 * uniform(&seed)), e = i % 3 ? 1 : 0.5 + 0.4 * uniform(&seed);
    const double speed = i % 2 ? 3 : -3, h = gap / 3 * 50 * uniform(&seed);
    double z = gap * uniform(&seed), vz = speed;
    const double x[3] = {0, 0, z + 0.3}, v[3] = {1, 0, speed};
    msim_scene *scene = make_single_particle(x, v, 0);
    plane(scene, 0, 0, i % 4 < 2 ? 1 : -1, i % 4 < 2 ? 0.3 : -0.3 - gap, e, 0);
    plane(scene, 0, 0, i % 4 < 2 ? -1 : 1, i % 4 < 2 ? -0.3 - gap : 0.3, e, 0);
    const msim_options opt = options("velocity-verlet", h);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 1, err));
    fly_between_walls(gap, e, h, &z, &vz);
    assert_close(state_of(sim).x[2], z + 0.3, 1e-12);
    assert_close(state_of(sim).v[2], vz, 1e-12);
    assert_close(state_of(sim).x[0], h, 1e-15);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* Acute wedges (down to 3 degrees), corners and rooms of up to 9 tilted planes, from a point inside
 * or on an edge: for any step no particle ends behind a plane. */
static void no_particle_ends_behind_a_plane(void **state) {
  (void)state;
  unsigned seed = 8;
  for (int i = 0; i < 300; i++) {
    const double angle = 0.05 + uniform(&seed), reach = pow(10, 3 * uniform(&seed));
    const int planes = i % 3 == 0 ? 2 : 3 + i % 7;
    double x[3] = {0, 0, i % 3 == 0 ? 1 : 0}, v[3], n[9][3];
    for (int c = 0; c < 3; c++) v[c] = reach * (uniform(&seed) - 0.5);
    msim_scene *scene = make_single_particle(x, v, i % 2 ? 9.81 : 0);
    for (int p = 0; p < planes; p++) {
      for (int c = 0; c < 3; c++) n[p][c] = uniform(&seed) - 0.5;
      if (planes == 2)
        n[p][0] = p ? cos(angle / 2) : -cos(angle / 2), n[p][1] = 0, n[p][2] = sin(angle / 2);
      const double length = norm(n[p]);
      for (int c = 0; c < 3; c++) n[p][c] /= length;
      plane(scene, n[p][0], n[p][1], n[p][2], i % 2 || planes == 2 ? 0 : -0.1, 0.25 * (i % 5),
            0.1 * (i % 4));
    }
    const msim_options opt = options("symplectic-euler", 0.1);
    msim_sim *sim = make_sim(scene, &opt);
    for (int step = 0; step < 3; step++) {
      assert_ok(msim_sim_step(sim, 1, err));
      for (int p = 0; p < planes; p++) {
        const double *at = state_of(sim).x, d = i % 2 || planes == 2 ? 0 : -0.1;
        const double s = n[p][0] * at[0] + n[p][1] * at[1] + n[p][2] * at[2] - d;
        if (!(s > -1e-12 * (1 + reach))) fail_msg("%d planes, seed %d: %g m behind", planes, i, -s);
      }
    }
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

static void planes_without_room_are_refused(void **state) {
  (void)state;
  const double x[3] = {0}, v[3] = {0, 0, 1};
  for (int gap = -1; gap < 2; gap++) {
    msim_scene *scene = make_single_particle(x, v, 9.81);
    plane(scene, 0, 0.6, 0.8, 0.2, 1, 0);
    plane(scene, 0, -0.6, -0.8, -0.2 - 1e-3 * gap, 1, 0);
    const msim_options opt = options("velocity-verlet", 0.1);
    msim_sim *sim;
    msim_error why;
    const msim_status status = msim_sim_create(scene, &opt, &sim, &why);
    assert_int_equal(status, gap < 0 ? MSIM_ERR_ARG : MSIM_OK);
    if (status)
      assert_non_null(strstr(why.text, "the planes leave no room: each point of space is behind"));
    else msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

static void pinned_particles_are_not_reflected(void **state) {
  (void)state;
  const double x[3] = {0, 0, -1}, v[3] = {0, 0, 0};
  const int32_t pin = 0;
  for (int32_t m = 0; method_at(m); m++) {
    if (refuses_planes(method_at(m))) continue;
    msim_scene *scene = make_single_particle(x, v, 9.81);
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

static msim_plane random_plane(unsigned *seed, double e, double mu) {
  msim_plane p = {{uniform(seed) - 0.5, uniform(seed) - 0.5, uniform(seed)}, 0, e, mu};
  const double size = norm(p.normal);
  for (int c = 0; c < 3; c++) p.normal[c] /= size;
  return p;
}

/* Corners of one to five planes: v' points into none of them; e = 1 keeps the speed, e < 1 and
 * friction reduce it; the order of the planes does not matter. */
static void corners_bounce_in_any_order(void **state) {
  (void)state;
  unsigned seed = 5;
  for (int i = 0; i < 2000; i++) {
    const double e = i % 3 ? 1 : 0.6, mu = i % 2 ? 0.3 : 0;
    msim_plane plane[5];
    ms_plane_set touch = {.n = 1 + i % 5}, turned = touch;
    for (int p = 0; p < touch.n; p++) plane[p] = random_plane(&seed, e, mu);
    for (int p = 0; p < touch.n; p++)
      touch.plane[p] = &plane[p], turned.plane[(p + 2) % touch.n] = &plane[p];
    double v[3], w[3];
    for (int c = 0; c < 3; c++) v[c] = w[c] = uniform(&seed) - 0.5;
    const double before = norm(v);
    const int bounced = ms_impacts_bounce(&touch, v);
    assert_int_equal(ms_impacts_bounce(&turned, w), bounced);
    for (int c = 0; c < 3; c++) assert_close(v[c], w[c], 1e-9);
    for (int p = 0; p < touch.n; p++) {
      const double *n = plane[p].normal;
      assert_true(n[0] * v[0] + n[1] * v[1] + n[2] * v[2] > -1e-14);
    }
    if (e == 1 && mu == 0 && touch.n == 1) assert_close(norm(v), before, 1e-14);
    assert_true(norm(v) <= before * (1 + 1e-14));
  }
}

/* A wedge with more bounces from wall to wall than are followed counts as one impact, and the
 * particle leaves it. */
static void a_narrow_wedge_is_one_impact(void **state) {
  (void)state;
  for (double angle = 0.001; angle < 1; angle *= 3) {
    const msim_plane plane[2] = {{{0, 0, 1}, 0, 1, 0}, {{sin(angle), 0, -cos(angle)}, 0, 1, 0}};
    const ms_plane_set touch = {.n = 2, .plane = {&plane[0], &plane[1]}};
    double v[3] = {-1, 0.25, -2 * angle}; /* into the first plane only */
    const double before = norm(v);
    assert_int_equal(ms_impacts_bounce(&touch, v), 1);
    assert_true(v[0] * sin(angle) - v[2] * cos(angle) > -1e-14 && v[2] > -1e-14);
    assert_true(norm(v) <= before * (1 + 1e-12));
    assert_close(v[1], 0.25, 1e-14);
  }
}

/* A particle that slides along a plane to one that overhangs it, at 127 degrees, bounces along it,
 * with any rounding of the velocity. */
static void a_slide_takes_part_in_an_impact(void **state) {
  (void)state;
  const msim_plane plane[2] = {{{0, 0, 1}, 0, 0, 0}, {{-0.8, 0, -0.6}, 0, 0.5, 0}};
  const ms_plane_set touch = {.n = 2, .plane = {&plane[0], &plane[1]}};
  for (int i = -1; i <= 1; i++) {
    double v[3] = {2, 1, i * 1e-16};
    assert_int_equal(ms_impacts_bounce(&touch, v), 1);
    assert_close(v[0], -1, 1e-14);
    assert_close(v[1], 1, 0);
    assert_close(v[2], 0, 1e-15);
  }
}

/* The vector nearest to u that points into no plane (Moreau): the correction by the planes is
 * perpendicular to the result. */
static void projection_is_the_nearest(void **state) {
  (void)state;
  static const double nothing[MS_MAX_TOUCHED_PLANES] = {0};
  unsigned seed = 7;
  for (int i = 0; i < 2000; i++) {
    msim_plane plane[4];
    ms_plane_set touch = {.n = 1 + i % 4};
    double u[3], J[MS_MAX_TOUCHED_PLANES] = {0}, given[3], product = 0;
    for (int p = 0; p < touch.n; p++)
      plane[p] = random_plane(&seed, 0, 0), touch.plane[p] = &plane[p];
    for (int c = 0; c < 3; c++) given[c] = u[c] = uniform(&seed) - 0.5;
    ms_impacts_project(&touch, nothing, u, J);
    for (int c = 0; c < 3; c++) given[c] = u[c] - given[c], product += given[c] * u[c];
    assert_close(product, 0, 1e-12);
    for (int p = 0; p < touch.n; p++) {
      const double *n = plane[p].normal;
      assert_true(n[0] * u[0] + n[1] * u[1] + n[2] * u[2] > -1e-12 && J[p] > -1e-12);
      for (int c = 0; c < 3; c++) given[c] -= J[p] * n[c];
    }
    assert_close(norm(given), 0, 1e-12);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(one_reflection_in_closed_form),
                                     cmocka_unit_test(ball_bounces_back),
                                     cmocka_unit_test(no_stage_outlives_a_reflection),
                                     cmocka_unit_test(literal_heun_never_bounces),
                                     cmocka_unit_test(friction_stops_a_slider),
                                     cmocka_unit_test(incline_sticks_or_slides),
                                     cmocka_unit_test(corner_reflects_twice_and_counts_once),
                                     cmocka_unit_test(leaving_particle_keeps_its_velocity),
                                     cmocka_unit_test(slabs_confine_fast_particles),
                                     cmocka_unit_test(no_particle_ends_behind_a_plane),
                                     cmocka_unit_test(planes_without_room_are_refused),
                                     cmocka_unit_test(pinned_particles_are_not_reflected),
                                     cmocka_unit_test(corners_bounce_in_any_order),
                                     cmocka_unit_test(a_narrow_wedge_is_one_impact),
                                     cmocka_unit_test(a_slide_takes_part_in_an_impact),
                                     cmocka_unit_test(projection_is_the_nearest)};
  return cmocka_run_group_tests_name("planes", tests, NULL, NULL);
}
