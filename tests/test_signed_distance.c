/* Tests of the distances from colliders, against other formulas, at random points and at those
 * where several points of the surface are nearest. */
#include <float.h>
#include <string.h>

#include "base/vec3.h"
#include "physics/signed_distance.h"
#include "scene_check.h"

enum { POINTS = 4000 };

static const ms_solid *solid_of(msim_scene *scene, const msim_collider *c) {
  assert_ok(msim_scene_add_collider(scene, c, err));
  return &scene->data->solids[scene->data->ncolliders - 1];
}

static msim_scene *new_scene(void) {
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  return scene;
}

static void random_vector(unsigned *seed, double size, double x[3]) {
  for (int c = 0; c < 3; c++) x[c] = size * (2 * uniform(seed) - 1);
}

static double distance_between(const double a[3], const double b[3]) {
  return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
}

/* x rotated by -w, by the quaternion (cos a/2, -sin(a/2) u), a = |w|, u = w/a */
static void rotate_back(const double w[3], const double x[3], double q[3]) {
  const double a = ms_vec3_norm(w), r = cos(a / 2), f = a > 0 ? -sin(a / 2) / a : 0;
  const double p[3] = {f * w[0], f * w[1], f * w[2]};
  double t[3];
  for (int c = 0; c < 3; c++) {
    const int d = (c + 1) % 3, e = (c + 2) % 3;
    t[c] = p[d] * x[e] - p[e] * x[d] + r * x[c];
  }
  for (int c = 0; c < 3; c++) {
    const int d = (c + 1) % 3, e = (c + 2) % 3;
    q[c] = x[c] + 2 * (p[d] * t[e] - p[e] * t[d]);
  }
}

/*------------------------------------- other formulas -------------------------------------------*/

static double sphere_formula(const msim_collider *c, const double x[3]) {
  return distance_between(x, c->center) - c->radius;
}

/* The least distance from the points from + t (to - from), by the projection of x on the line */
static double capsule_formula(const msim_collider *c, const double x[3]) {
  double u[3], d[3], at[3];
  for (int i = 0; i < 3; i++) u[i] = c->to[i] - c->from[i], d[i] = x[i] - c->from[i];
  double t = ms_vec3_dot(u, d) / ms_vec3_dot(u, u);
  t = t < 0 ? 0 : t > 1 ? 1 : t;
  for (int i = 0; i < 3; i++) at[i] = c->from[i] + t * u[i];
  return distance_between(x, at) - c->radius;
}

/* The least distance from the two discs and the tube between them */
static double cylinder_formula(const msim_collider *c, const double x[3]) {
  double u[3], d[3], least;
  const double length = distance_between(c->from, c->to);
  for (int i = 0; i < 3; i++) u[i] = (c->to[i] - c->from[i]) / length, d[i] = x[i] - c->from[i];
  const double z = ms_vec3_dot(u, d), rho = sqrt(fmax(0, ms_vec3_dot(d, d) - z * z));
  const double beyond = fmax(0, rho - c->radius);
  least = fmin(hypot(z, beyond), hypot(z - length, beyond));
  if (z >= 0 && z <= length) least = fmin(least, fabs(rho - c->radius));
  return z >= 0 && z <= length && rho <= c->radius ? -least : least;
}

/* The distance from the nearest point of the box, or from the nearest of its six faces */
static double box_formula(const msim_collider *c, const double x[3]) {
  double q[3], d[3], at[3], least = INFINITY;
  for (int i = 0; i < 3; i++) d[i] = x[i] - c->center[i];
  rotate_back(c->rotation, d, q);
  for (int i = 0; i < 3; i++) {
    const double half = c->extent[i] / 2;
    at[i] = fmin(fmax(q[i], -half), half);
    least = fmin(least, fmin(half - q[i], half + q[i]));
  }
  return least >= 0 ? -least : distance_between(q, at);
}

/*------------------------------------- random points --------------------------------------------*/

static msim_collider random_collider(unsigned *seed, int32_t type) {
  msim_collider c = {.size = sizeof c, .type = type, .radius = 0.1 + uniform(seed)};
  random_vector(seed, 1, c.center);
  random_vector(seed, 2, c.from), random_vector(seed, 2, c.to);
  random_vector(seed, 4, c.rotation);
  for (int i = 0; i < 3; i++) c.extent[i] = 0.1 + 2 * uniform(seed);
  return c;
}

/* s agrees, |n| = 1, and x - s n is on the surface, |s| away: it is the nearest point. */
static void check_point(const ms_solid *solid, double expected, const double x[3]) {
  double n[3], unused[3], at[3] = {x[0], x[1], x[2]};
  const double s = ms_signed_distance(solid, x, n);
  assert_close(s, expected, 1e-14 * (1 + solid->reach + ms_vec3_norm(x)));
  assert_close(ms_vec3_norm(n), 1, 8 * DBL_EPSILON);
  ms_vec3_axpy(-s, n, at);
  assert_close(ms_signed_distance(solid, at, unused), 0, ms_signed_distance_tolerance(solid, at));
  assert_close(fabs(s), distance_between(at, x), 1e-14 * (1 + fabs(s)));
}

static void random_points_agree_with_other_formulas(void **state) {
  (void)state;
  double (*const formulas[])(const msim_collider *c, const double x[3]) = {
      [MSIM_COLLIDER_SPHERE] = sphere_formula,
      [MSIM_COLLIDER_CAPSULE] = capsule_formula,
      [MSIM_COLLIDER_CYLINDER] = cylinder_formula,
      [MSIM_COLLIDER_BOX] = box_formula};
  unsigned seed = 1;
  int below = 0;
  for (int i = 0; i < 4 * POINTS; i++) {
    msim_scene *scene = new_scene();
    double x[3];
    msim_collider c = random_collider(&seed, MSIM_COLLIDER_SPHERE + i % 4);
    c.inside = i / 4 % 2;
    const ms_solid *solid = solid_of(scene, &c);
    random_vector(&seed, 2, x);
    const double side = c.inside ? -1 : 1, expected = side * formulas[c.type](&c, x);
    below += expected < 0;
    check_point(solid, expected, x);
    msim_scene_destroy(scene);
  }
  assert_true(below > POINTS && below < 3 * POINTS);
}

/*------------------------------------- points with several nearest ones -------------------------*/

static void centers_and_edges_have_a_normal(void **state) {
  (void)state;
  msim_scene *scene = new_scene();
  const msim_collider base = {.size = sizeof base,
                              .radius = 0.5,
                              .from = {0, 0, -2},
                              .to = {0, 0, 2},
                              .extent = {2, 2, 2},
                              .rotation = {0, 0, 0}};
  const struct {
    int32_t type;
    double x[3], distance;
  } cases[] = {{MSIM_COLLIDER_SPHERE, {0, 0, 0}, -0.5},   {MSIM_COLLIDER_CAPSULE, {0, 0, 1}, -0.5},
               {MSIM_COLLIDER_CYLINDER, {0, 0, 0}, -0.5}, {MSIM_COLLIDER_CYLINDER, {0, 0, 2}, 0},
               {MSIM_COLLIDER_CYLINDER, {0, 0, 3}, 1},    {MSIM_COLLIDER_CYLINDER, {.5, 0, 2}, 0},
               {MSIM_COLLIDER_BOX, {0, 0, 0}, -1},        {MSIM_COLLIDER_BOX, {1, 1, 1}, 0},
               {MSIM_COLLIDER_BOX, {1, 0, -1}, 0},        {MSIM_COLLIDER_BOX, {4, 5, 1}, 5}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
    for (int inside = 0; inside < 2; inside++) {
      msim_collider c = base;
      c.type = cases[i].type, c.inside = inside;
      check_point(solid_of(scene, &c), inside ? -cases[i].distance : cases[i].distance, cases[i].x);
    }
  msim_scene_destroy(scene);
}

/* Axes along each coordinate axis, both ways, and a full turn of a box */
static void axes_may_have_any_direction(void **state) {
  (void)state;
  msim_scene *scene = new_scene();
  const double x[3] = {0.3, -0.7, 1.1};
  for (int k = 0; k < 6; k++) {
    msim_collider c = {.size = sizeof c, .type = MSIM_COLLIDER_CYLINDER, .radius = 0.4};
    c.to[k % 3] = k < 3 ? 1 : -1;
    check_point(solid_of(scene, &c), cylinder_formula(&c, x), x);
    c = (msim_collider){.size = sizeof c, .type = MSIM_COLLIDER_BOX, .extent = {1, 0.5, 0.25}};
    check_point(solid_of(scene, &c), box_formula(&c, x), x);
    c.rotation[k % 3] = 8 * atan(1) * (k < 3 ? 1 : -1);
    check_point(solid_of(scene, &c), box_formula(&c, x), x);
  }
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(random_points_agree_with_other_formulas),
                                     cmocka_unit_test(centers_and_edges_have_a_normal),
                                     cmocka_unit_test(axes_may_have_any_direction)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
