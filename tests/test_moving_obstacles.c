/* Tests of the kinematics of solids that move (contact/moving_obstacles.h) against differences of
 * their poses in time, and of the bounds that location of impacts relies on. */
#include <string.h>

#include "base/vec3.h"
#include "contact/moving_obstacles.h"
#include "moving_colliders.h"

enum { KNOTS = 6, MOST = 2 };
static const double KNOT = 0.2; /* s: between the times of a motion */

typedef struct fixture {
  msim_scene *scene;
  ms_obstacles obstacles;
  ms_collision_planes planes;
} fixture;

static double between(unsigned *seed, double low, double high) {
  return low + (high - low) * uniform(seed);
}

static void random_vector(unsigned *seed, double size, double x[3]) {
  for (int c = 0; c < 3; c++) x[c] = between(seed, -size, size);
}

static msim_collider random_solid(unsigned *seed) {
  double along[3];
  const double none[3] = {0};
  random_vector(seed, 0.6, along);
  along[0] += 0.8;
  switch ((int)(4 * uniform(seed))) {
    case 0:
      return sphere(0, 0, 0, between(seed, 0.2, 0.7), 1, 0);
    case 1:
      return box(0, 0, 0, between(seed, 0.3, 0.9), 1, 0);
    case 2:
      return round_bar(MSIM_COLLIDER_CAPSULE, none, along, between(seed, 0.1, 0.4), 1, 0);
    default:
      return round_bar(MSIM_COLLIDER_CYLINDER, none, along, between(seed, 0.1, 0.4), 1, 0);
  }
}

/* Solids whose centers, on cubic or linear paths, stay within `room` of 0, and that turn by up to
 * `turn` between the times of their motions */
static void set_up(fixture *f, unsigned *seed, int n, int interpolation, double room, double turn) {
  f->scene = new_scene();
  for (int i = 0; i < n; i++) {
    double t[KNOTS], x[3 * KNOTS], w[3 * KNOTS] = {0};
    for (int k = 0; k < KNOTS; k++) {
      t[k] = KNOT * k;
      random_vector(seed, room, x + 3 * k);
      random_vector(seed, turn, w + 3 * k);
      for (int c = 0; c < 3 && k; c++) w[3 * k + c] += w[3 * k + c - 3];
    }
    add(f->scene, random_solid(seed), uniform(seed) < 0.3);
    set_motion(f->scene, i, KNOTS, t, x, w, interpolation);
  }
  assert_true(ms_obstacles_create(f->scene->data, &f->obstacles));
  ms_obstacles *o = &f->obstacles;
  f->planes = (ms_collision_planes){.n = o->nplanes + o->nsolids,
                                    .plane = o->plane,
                                    .scene_size = 1,
                                    .nsolids = o->nsolids,
                                    .solid = o->solid,
                                    .tangent = o->plane + o->nplanes,
                                    .moving = o,
                                    .scene = f->scene->data};
}

static void tear_down(fixture *f) {
  ms_obstacles_destroy(f->scene->data, &f->obstacles);
  msim_scene_destroy(f->scene);
}

static const ms_solid *place(fixture *f, int32_t i, double t) {
  ms_moving_obstacles_place(&f->planes, (ms_instant){.t = t});
  return &f->planes.solid[i];
}

/* Between two times of the motion, far enough from both for differences */
static double random_time(unsigned *seed) {
  return KNOT * ((int)((KNOTS - 1) * uniform(seed)) + between(seed, 0.1, 0.9));
}

/* The first and second derivative of y(0) by differences of fourth order from values at -2 dt to
 * 2 dt. */
static void differentiate(double y[5], double dt, double derivative[2]) {
  derivative[0] = (y[0] - 8 * y[1] + 8 * y[3] - y[4]) / (12 * dt);
  derivative[1] = (-y[0] + 16 * y[1] - 30 * y[2] + 16 * y[3] - y[4]) / (12 * dt * dt);
}

/* The point of the first collider that has the coordinates q in its axes */
static void find_material_point(const fixture *f, double t, const double q[3], double x[3]) {
  ms_solid room;
  const ms_solid *solid = ms_collider_motion_place(f->scene->data, 0, (ms_instant){.t = t}, &room);
  memcpy(x, solid->center, sizeof solid->center);
  for (int k = 0; k < 3; k++) ms_vec3_axpy(q[k], solid->axis[k], x);
}

/* Points fixed to a solid: u is the derivative of their position, A its second derivative. */
static void material_points_have_velocity_and_acceleration(void **state) {
  (void)state;
  const double dt = 1e-3;
  unsigned seed = 3;
  for (int i = 0; i < 200; i++) {
    fixture f;
    double q[3], x[5][3], u[3], a[3];
    set_up(&f, &seed, 1, i % 2, 0.5, 1);
    const double t = random_time(&seed);
    random_vector(&seed, 1, q);
    for (int j = 0; j < 5; j++) find_material_point(&f, t + (j - 2) * dt, q, x[j]);
    place(&f, 0, t);
    const ms_plane_set on = {1, {f.planes.tangent}};
    ms_moving_obstacles_find_velocity(&f.planes, &on, x[2], u);
    ms_moving_obstacles_find_acceleration(&f.planes, &on, x[2], u, a);
    for (int c = 0; c < 3; c++) {
      double y[5], exact[2];
      for (int j = 0; j < 5; j++) y[j] = x[j][c];
      differentiate(y, dt, exact);
      if (!(fabs(u[c] - exact[0]) <= 1e-5)) fail_msg("case %d: u %g, %g", i, u[c], exact[0]);
      if (!(fabs(a[c] - exact[1]) <= 2e-3)) fail_msg("case %d: A %g, %g", i, a[c], exact[1]);
    }
    tear_down(&f);
  }
}

/* s of a particle on a parabola through a point of the surface: s'' = n.a - (n.a of one that stays
 * on it). Differences over two intervals agree where no edge is passed. */
static void normal_acceleration_is_that_of_the_distance(void **state) {
  (void)state;
  const int cases = 400;
  unsigned seed = 5;
  int checked = 0;
  for (int i = 0; i < cases; i++) {
    fixture f;
    double x[3], v[3], a[3], n[3], by[2];
    set_up(&f, &seed, 1, i % 2, 0.5, 1);
    const double t = random_time(&seed);
    const int32_t number = (int32_t)(f.planes.nsolids * uniform(&seed));
    random_vector(&seed, 0.1, x), random_vector(&seed, 3, v), random_vector(&seed, 10, a);
    const ms_solid *solid = place(&f, number, t);
    ms_vec3_axpy(1, solid->center, x);
    ms_vec3_axpy(-ms_signed_distance(solid, x, n), n, x);
    for (int k = 0; k < 2; k++) {
      const double dt = 1e-3 / (1 + k);
      double s[5], derivative[2];
      for (int j = 0; j < 5; j++) {
        const double later = (j - 2) * dt;
        double y[3], unused[3];
        for (int c = 0; c < 3; c++) y[c] = x[c] + later * (v[c] + later * a[c] / 2);
        s[j] = ms_signed_distance(place(&f, number, t + later), y, unused);
      }
      differentiate(s, dt, derivative);
      by[k] = derivative[1];
    }
    if (fabs(by[0] - by[1]) <= 1e-4 * (1 + fabs(by[0]))) {
      solid = place(&f, number, t);
      ms_signed_distance(solid, x, n);
      const double found =
          ms_vec3_dot(n, a) - ms_moving_obstacles_find_normal_acceleration(solid, n, x, v);
      if (!(fabs(found - by[0]) <= 1e-3 * (1 + fabs(by[0]))))
        fail_msg("case %d, type %d: %g, differences %g", i, solid->type, found, by[0]);
      checked++;
    }
    tear_down(&f);
  }
  assert_true(checked > cases * 3 / 4);
}

/* The formulas for small angles, below 0.1 and 0.03, and for others meet there. */
static void spin_is_continuous_in_the_angle(void **state) {
  (void)state;
  const double limits[2] = {0.1, 0.03}, t[2] = {0, 1}, x[6] = {0}, axis[3] = {0.48, 0.6, 0.64};
  const double fast = 8, turn[3] = {fast * 0.6, fast * 0.8, 0}, dt = 1e-13;
  for (int i = 0; i < 2; i++) {
    double w[6];
    ms_solid room[2];
    for (int c = 0; c < 3; c++) w[c] = limits[i] * axis[c] - turn[c] / 2, w[3 + c] = w[c] + turn[c];
    msim_scene *scene = new_scene();
    add(scene, sphere(0, 0, 0, 1, 1, 0), 0);
    set_motion(scene, 0, 2, t, x, w, MSIM_MOTION_LINEAR);
    for (int k = 0; k < 2; k++) {
      const ms_instant at = {.t = 0.5 + (k ? dt : -dt)};
      assert_ptr_equal(ms_collider_motion_place(scene->data, 0, at, &room[k]), &room[k]);
    }
    for (int c = 0; c < 3; c++) {
      assert_close(room[0].spin[c], room[1].spin[c], 2e-10);
      assert_close(room[0].spin_rate[c], room[1].spin_rate[c], 2e-10);
    }
    msim_scene_destroy(scene);
  }
}

/* Of surfaces with two velocities: along each normal that of its surface, across both the mean */
static void two_moving_surfaces_share_a_frame(void **state) {
  (void)state;
  unsigned seed = 7;
  for (int i = 0; i < 100; i++) {
    fixture f;
    double x[3], of[MOST][3], u[3], across[3], mean = 0;
    set_up(&f, &seed, MOST, i % 2, 0.5, 1);
    ms_moving_obstacles_place(&f.planes, (ms_instant){.t = random_time(&seed)});
    random_vector(&seed, 1, x);
    ms_obstacles_touch(&f.planes, x);
    const ms_plane_set on = {MOST, {&f.planes.tangent[0], &f.planes.tangent[f.planes.nsolids - 1]}};
    for (int k = 0; k < MOST; k++)
      ms_signed_distance_find_velocity(ms_obstacles_get_solid(&f.planes, on.plane[k]), x, of[k]);
    const double *n = on.plane[0]->normal, *m = on.plane[1]->normal;
    for (int c = 0; c < 3; c++)
      across[c] = n[(c + 1) % 3] * m[(c + 2) % 3] - n[(c + 2) % 3] * m[(c + 1) % 3];
    if (ms_vec3_norm(across) > 1e-2) {
      ms_moving_obstacles_find_velocity(&f.planes, &on, x, u);
      for (int k = 0; k < MOST; k++) {
        assert_close(ms_vec3_dot(on.plane[k]->normal, u), ms_vec3_dot(on.plane[k]->normal, of[k]),
                     1e-9);
        mean += ms_vec3_dot(across, of[k]) / MOST;
      }
      assert_close(ms_vec3_dot(across, u), mean, 1e-9);
    }
    tear_down(&f);
  }
}

/* Fast rotations, up to several turns between two times: bounds hold at all times, and points of
 * the solid that are near x at either end of an interval keep to the bound of their way. */
static void bounds_hold_in_fast_rotations(void **state) {
  (void)state;
  unsigned seed = 11;
  for (int i = 0; i < 300; i++) {
    fixture f;
    double x[3], q[3], from[3], to[3];
    set_up(&f, &seed, 1, i % 2, i % 5 ? 0.5 : 0, i % 3 ? 12 : 0.3);
    const ms_solid_bounds b = f.obstacles.bounds[0];
    const double t = between(&seed, 0, KNOT * KNOTS), time = between(&seed, 0, KNOT),
                 distance = between(&seed, 0, 1);
    const ms_solid *now = place(&f, 0, t);
    const double slack = 1 + 1e-12;
    assert_true(ms_vec3_norm(now->velocity) <= slack * b.speed);
    assert_true(ms_vec3_norm(now->acceleration) <= slack * b.acceleration);
    assert_true(ms_vec3_norm(now->spin) <= slack * b.spin);
    assert_true(ms_vec3_norm(now->spin_rate) <= slack * b.spin_rate);
    random_vector(&seed, 1, q);
    find_material_point(&f, t, q, from);
    find_material_point(&f, t + time, q, to);
    const double *met = i % 2 ? from : to; /* where it is within `way` of x */
    for (int c = 0; c < 3; c++) x[c] = now->center[c] - met[c];
    const double nearer = fmin(1, distance / ms_vec3_norm(x));
    for (int c = 0; c < 3; c++) x[c] = met[c] + nearer * x[c];
    const double most = ms_moving_obstacles_bound_displacement(&f.planes, 0, x, distance, time);
    ms_vec3_axpy(-1, from, to);
    assert_true(ms_vec3_norm(to) <= slack * most + 1e-12);
    tear_down(&f);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(material_points_have_velocity_and_acceleration),
      cmocka_unit_test(normal_acceleration_is_that_of_the_distance),
      cmocka_unit_test(spin_is_continuous_in_the_angle),
      cmocka_unit_test(two_moving_surfaces_share_a_frame),
      cmocka_unit_test(bounds_hold_in_fast_rotations),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
