/* Tests of the broad phase of contact: in random scenes of fast particles and obstacles of all
 * kinds, no particle that an exhaustive check finds is left out. */
#include "base/vec3.h"
#include "contact/bounds_kernels.h"
#include "contact/broad_phase.h"
#include "contact/impact_time.h"
#include "contact/moving_obstacles.h"
#include "sampled_colliders.h"

enum { MANY = 700, SCENES = 20000 };

static void random_vector(unsigned *seed, double size, double x[3]) {
  for (int c = 0; c < 3; c++) x[c] = size * (2 * uniform(seed) - 1);
}

/*------------------------------------- bounds on distances --------------------------------------*/

static double ground[7 * 5], grid[12 * 12 * 12];

/* A collider of random size in a cube of about 1 m, of each type in turn */
static msim_collider random_collider(unsigned *seed, int type) {
  const double size = exp(3 * uniform(seed) - 2.5), spacing[2] = {size / 4, size / 3};
  double at[3], along[3];
  random_vector(seed, 1, at), random_vector(seed, size, along);
  msim_collider c = sphere(at[0], at[1], at[2], size * uniform(seed) + 1e-3, 0.5, 0.2);
  switch (type) {
    case MSIM_COLLIDER_BOX:
      c = box(at[0], at[1], at[2], size, 0.5, 0.2);
      for (int i = 0; i < 3; i++) c.extent[i] *= uniform(seed) + 1e-3, c.rotation[i] = along[i];
      break;
    case MSIM_COLLIDER_CAPSULE:
    case MSIM_COLLIDER_CYLINDER:
      c = round_bar(type, at, along, c.radius, 0.5, 0.2);
      break;
    case MSIM_COLLIDER_HEIGHTFIELD:
      for (int k = 0; k < 7 * 5; k++) ground[k] = size * uniform(seed);
      c = heights(at, spacing, 7, 5, ground, 0.5, 0.2);
      break;
    case MSIM_COLLIDER_SDF:
      sample_sphere(12, grid);
      c = sampled_sphere(12, grid, 0.5, 0.2);
      for (int i = 0; i < 3; i++) c.origin[i] += at[i];
      break;
    default:
      break;
  }
  return c;
}

/* No point of a box is nearer to a solid than the bound says; that of a box without extent is the
 * distance itself, but where samples have none. */
static void no_point_of_a_box_is_nearer_than_the_bound(void **state) {
  (void)state;
  unsigned seed = 5;
  int bounds = 0;
  for (int k = 0; k < 60 * MSIM_COLLIDER_SDF; k++) {
    msim_scene *scene = new_scene();
    add(scene, random_collider(&seed, 1 + k % MSIM_COLLIDER_SDF), k / MSIM_COLLIDER_SDF % 2);
    ms_solid half_space = scene->data->solids[0];
    half_space.type = MS_SOLID_HALF_SPACE, half_space.inside = 0, half_space.samples = NULL;
    const ms_solid *solid = k % 11 ? scene->data->solids : &half_space;
    for (int i = 0; i < 20; i++) {
      double middle[3], half[3], unused[3];
      random_vector(&seed, i % 2 ? 4 : 1, middle);
      for (int c = 0; c < 3; c++) half[c] = i < 2 ? 0 : exp(-4 * uniform(&seed)) * (c != i % 4);
      const double bound = ms_signed_distance_bound(solid, middle, half);
      if (i < 2 && !solid->samples)
        assert_close(bound, ms_signed_distance(solid, middle, unused), 1e-12);
      bounds += bound > 0;
      for (int p = 0; p < 60; p++) {
        double x[3];
        for (int c = 0; c < 3; c++) {
          const double share = p < 8 ? 2 * (p >> c & 1) - 1 : 2 * uniform(&seed) - 1;
          x[c] = middle[c] + share * half[c];
        }
        assert_true(ms_signed_distance(solid, x, unused) >= bound - 1e-12);
      }
    }
    msim_scene_destroy(scene);
  }
  assert_true(bounds > 1000);
}

/*------------------------------------- boxes ----------------------------------------------------*/

MS_TABLES(ms_bounds_kernels);

/* Any rows of a vector with the kernels of this CPU: the same numbers as by a loop over them */
static void boxes_are_those_of_a_loop(void **state) {
  (void)state;
  enum { ROWS = 150, DIMS = 3 };
  const int isa = ms_isa_choose();
  const ms_shape shape = {.n = ROWS, .stride = ROWS + 2, .dims = DIMS, .isa = isa};
  double x[DIMS * (ROWS + 2)];
  unsigned seed = 2;
  for (int k = 0; k < 2000; k++) {
    double low[DIMS], high[DIMS];
    const int32_t begin = (int32_t)(ROWS * uniform(&seed)),
                  end = begin + 1 + (int32_t)((ROWS - begin) * uniform(&seed));
    for (int i = 0; i < DIMS * (ROWS + 2); i++)
      x[i] = uniform(&seed) < 0.01 ? NAN : 2 * uniform(&seed) - 1;
    ms_bounds_kernels_of[isa]->bound(shape, x, begin, end, low, high);
    for (int c = 0; c < DIMS; c++) {
      double least = INFINITY, most = -INFINITY;
      for (int32_t r = begin; r < end; r++)
        least = fmin(least, x[c * shape.stride + r]), most = fmax(most, x[c * shape.stride + r]);
      assert_true(low[c] == least && high[c] == most);
    }
  }
}

/*------------------------------------- random scenes --------------------------------------------*/

/* In order, so that rows near each other in memory are near in space, as in a body */
static void add_walk(unsigned *seed, int n, msim_scene *scene) {
  const double mass = 1, step = exp(-2 - 5 * uniform(seed));
  double x[3], d[3];
  random_vector(seed, 2, x);
  for (int i = 0; i < n; i++) {
    random_vector(seed, step, d);
    ms_vec3_axpy(1, d, x);
    assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
  }
}

static void add_random_plane(unsigned *seed, msim_scene *scene) {
  double n[3];
  random_vector(seed, 1, n);
  plane(scene, n[0], n[1], n[2], 2 - 4 * uniform(seed), 0.5, 0.2);
}

/* It may be inside out, move and rotate. */
static void add_random_collider(unsigned *seed, int type, msim_scene *scene) {
  double at[3], u[3], w[3];
  add(scene, random_collider(seed, type), uniform(seed) < 0.3);
  random_vector(seed, 1.5, at), random_vector(seed, 30, u), random_vector(seed, 20, w);
  if (uniform(seed) < 0.4) set_uniform(scene, at, u, uniform(seed) < 0.5 ? w : NULL);
}

/* A few particles and one obstacle, or many of both, or many particles and planes alone */
static msim_scene *random_scene(unsigned *seed, int number) {
  const int many = number % 32 == 0, alone = number % 64 == 0,
            first = number % (MSIM_COLLIDER_SDF + 1);
  msim_scene *scene = new_scene();
  add_walk(seed, many ? MANY : 1 + number % 19, scene);
  for (int k = 0; k < (alone ? 3 : many || first == 0); k++) add_random_plane(seed, scene);
  for (int k = 0; k < (alone ? 0 : many ? 3 : first > 0); k++)
    add_random_collider(seed, 1 + (first + 5 + k) % MSIM_COLLIDER_SDF, scene);
  return scene;
}

/* All particles are fast, or a few of them */
static void set_speeds(unsigned *seed, const ms_model *model, double *v, double *a) {
  const double speed = exp(8 * uniform(seed) - 4), force = exp(12 * uniform(seed) - 2);
  const int few = uniform(seed) < 0.5;
  for (int32_t r = 0; r < model->unknowns.nfree; r++) {
    double u[3], g[3];
    const double share = few && uniform(seed) > 0.01 ? 1e-3 : 1;
    random_vector(seed, share * speed, u), random_vector(seed, share * force, g);
    ms_unknowns_set(&model->unknowns, u, r, v);
    ms_unknowns_set(&model->unknowns, g, r, a);
  }
}

static int is_obstructed(const ms_collision_planes *planes, const double x[3]) {
  double unused[3];
  for (int32_t i = 0; i < planes->n - planes->nsolids; i++)
    if (ms_impacts_distance(&planes->plane[i], x) < 0) return 1;
  for (int32_t i = 0; i < planes->nsolids; i++)
    if (ms_signed_distance(&planes->solid[i], x, unused) < 0) return 1;
  return 0;
}

/* The same for a point of the path from x to y */
static int is_way_obstructed(const ms_collision_planes *planes, const double x[3],
                             const double y[3]) {
  enum { PARTS = 16 };
  for (int k = 0; k <= PARTS; k++) {
    double at[3];
    for (int c = 0; c < 3; c++) at[c] = x[c] + (y[c] - x[c]) * k / PARTS;
    if (is_obstructed(planes, at)) return 1;
  }
  return 0;
}

/* Counts of particles: all, those that the exhaustive check finds, and those left out */
typedef struct counts {
  int all, found, left_out;
} counts;

/* Each particle that may touch an obstacle is one of those that `b` finds. */
static void compare(ms_broad_phase b, double t, counts *n) {
  const ms_unknowns *rows = &b.model->unknowns;
  int32_t next = ms_broad_phase_next(&b, 0);
  for (int32_t r = 0; r < rows->nfree; r++) {
    double x[3], v[3], a[3];
    const ms_parabola parabola = {.planes = b.planes, .t = t, .x = x, .v = v, .a = a};
    ms_unknowns_get(rows, b.x, r, x);
    if (b.v) ms_unknowns_get(rows, b.v, r, v), ms_unknowns_get(rows, b.a, r, a);
    double y[3] = {x[0], x[1], x[2]};
    if (b.x_end) ms_unknowns_get(rows, b.x_end, r, y);
    const int found =
        b.v ? ms_impact_time_may_touch(&parabola, b.h) : is_way_obstructed(b.planes, x, y);
    const int is_next = next == r;
    if (found && !is_next) fail_msg("particle %d at %g %g %g is left out", r, x[0], x[1], x[2]);
    if (is_next) next = ms_broad_phase_next(&b, r + 1);
    n->all++, n->found += found, n->left_out += !is_next;
  }
  assert_int_equal(next, rows->nfree);
}

static ms_collision_planes all_planes(const ms_scene *scene, ms_obstacles *o, double merge) {
  return (ms_collision_planes){.n = o->nplanes + o->nsolids,
                               .plane = o->plane,
                               .scene_size = 3,
                               .contact_distance = merge,
                               .nsolids = o->nsolids,
                               .solid = o->solid,
                               .tangent = o->plane + o->nplanes,
                               .moving = o->moves ? o : NULL,
                               .scene = scene};
}

static void no_particle_is_left_out(void **state) {
  (void)state;
  unsigned seed = 11;
  counts on_paths = {0}, at_points = {0}, on_ways = {0};
  for (int k = 0; k < SCENES; k++) {
    msim_scene *scene = random_scene(&seed, k);
    ms_model model;
    ms_obstacles o;
    double *x, *v, *a;
    assert_ok(ms_model_create(scene->data, 0, &model, err));
    assert_true(ms_obstacles_create(scene->data, &o));
    assert_true(MS_NEW_VECTORS(scene->data, &model.unknowns, &x, &v, &a));
    ms_unknowns_gather(&model.unknowns, scene->data->x, x);
    set_speeds(&seed, &model, v, a);
    const double t = 0.1 * uniform(&seed), h = exp(-3 - 5 * uniform(&seed));
    const ms_collision_planes planes = all_planes(scene->data, &o, k % 2 ? 0.01 : 0);
    ms_moving_obstacles_place(&planes, (ms_instant){.t = t});
    ms_broad_phase b = {.model = &model, .planes = &planes, .x = x, .v = v, .a = a, .h = h};
    compare(b, t, &on_paths);
    const ms_collision_planes whole = {.n = scene->data->nplanes + scene->data->ncolliders,
                                       .plane = scene->data->planes,
                                       .nsolids = scene->data->ncolliders,
                                       .solid = scene->data->solids};
    compare((ms_broad_phase){.model = &model, .planes = &whole, .x = x}, t, &at_points);
    ms_vector_add_scaled(model.shape, x, h, v, a); /* a: where straight paths end */
    compare((ms_broad_phase){.model = &model, .planes = &whole, .x = x, .x_end = a}, t, &on_ways);
    MS_FREE(&scene->data->alloc, x, v, a);
    ms_obstacles_destroy(scene->data, &o);
    ms_model_destroy(&model);
    msim_scene_destroy(scene);
  }
  print_message("on paths %d of %d, %d left out; at points %d, %d left out\n", on_paths.found,
                on_paths.all, on_paths.left_out, at_points.found, at_points.left_out);
  assert_true(on_paths.found > on_paths.all / 20 && on_paths.left_out > on_paths.all / 20);
  assert_true(on_ways.found > at_points.found && on_ways.left_out > on_ways.all / 20);
  assert_true(at_points.found > at_points.all / 20 && at_points.left_out > at_points.all / 20);
}

/* 1: x, or y unless it is NULL, is as close to one of the planes as touches it. */
static int is_near_plane(const ms_collision_planes *planes, const double x[3], const double *y) {
  for (const msim_plane *p = planes->plane; p < planes->plane + planes->n; p++)
    if (ms_impacts_distance(p, x) <= planes->contact_distance ||
        (y && ms_impacts_distance(p, y) <= planes->contact_distance))
      return 1;
  return 0;
}

/* `b` finds exactly the particles that meet a plane; *n counts all particles and those. */
static void compare_with_planes(ms_broad_phase b, counts *n) {
  const ms_unknowns *rows = &b.model->unknowns;
  int32_t next = ms_broad_phase_next(&b, 0);
  for (int32_t r = 0; r < rows->nfree; r++) {
    double x[3], y[3], v[3], a[3];
    const ms_parabola path = {.planes = b.planes, .x = x, .v = v, .a = a};
    ms_unknowns_get(rows, b.x, r, x);
    if (b.x_end) ms_unknowns_get(rows, b.x_end, r, y);
    if (b.v) ms_unknowns_get(rows, b.v, r, v), ms_unknowns_get(rows, b.a, r, a);
    const int meets =
        b.v ? ms_impact_time_may_touch(&path, b.h) : is_near_plane(b.planes, x, b.x_end ? y : NULL);
    assert_int_equal(next == r, meets);
    if (meets) next = ms_broad_phase_next(&b, r + 1);
    n->all++, n->found += meets;
  }
  assert_int_equal(next, rows->nfree);
}

/* Particles anywhere, in a plane if `flat`, that in 1 s move by more than their distances */
static void add_fast_particles(unsigned *seed, int n, int flat, msim_scene *scene) {
  const double mass = 1;
  for (int i = 0; i < n; i++) {
    double x[3], v[3];
    random_vector(seed, 1, x), random_vector(seed, 2, v);
    if (flat) x[1] = v[1] = 0;
    assert_ok(msim_scene_add_particles(scene, 1, x, v, &mass, err));
  }
}

static void particles_that_meet_planes_are_found_exactly(void **state) {
  (void)state;
  unsigned seed = 3;
  counts on_paths = {0}, at_points = {0}, on_ways = {0};
  for (int k = 0; k < 300; k++) {
    msim_scene *scene = new_scene();
    ms_model model;
    double *x, *v, *a;
    add_fast_particles(&seed, 1 + k, k % 3 == 0, scene);
    for (int i = 0; i < 1 + k % 2; i++) add_random_plane(&seed, scene);
    assert_ok(ms_model_create(scene->data, 0, &model, err));
    assert_true(MS_NEW_VECTORS(scene->data, &model.unknowns, &x, &v, &a));
    ms_unknowns_gather(&model.unknowns, scene->data->x, x);
    ms_unknowns_gather(&model.unknowns, scene->data->v, v);
    for (int32_t i = 0; i < model.shape.dims * model.shape.stride; i++)
      a[i] = v[i] != 0 ? 8 * uniform(&seed) - 4 : 0;
    const ms_collision_planes planes = {.n = scene->data->nplanes,
                                        .plane = scene->data->planes,
                                        .scene_size = 3,
                                        .contact_distance = k % 4 < 2 ? 0 : 0.02};
    ms_broad_phase b = {.model = &model, .planes = &planes, .x = x, .h = 0.2 + uniform(&seed)};
    compare_with_planes(b, &at_points);
    b.v = v, b.a = a;
    compare_with_planes(b, &on_paths);
    ms_vector_add_scaled(model.shape, x, b.h, v, a); /* a: where straight paths end */
    b.v = b.a = NULL, b.x_end = a;
    compare_with_planes(b, &on_ways);
    MS_FREE(&scene->data->alloc, x, v, a);
    ms_model_destroy(&model);
    msim_scene_destroy(scene);
  }
  assert_in_range(at_points.found, at_points.all / 5, on_ways.found);
  assert_in_range(on_ways.found, at_points.found + at_points.all / 20, 9 * on_ways.all / 10);
  assert_in_range(on_paths.found, at_points.found + at_points.all / 20, 9 * on_paths.all / 10);
}

/* Far from all obstacles no particle, and near to a few of them no more than slices, are tested. */
static void far_obstacles_cost_no_exact_test(void **state) {
  (void)state;
  enum { SIDE = 40 };
  for (int near = 0; near < 2; near++) {
    msim_scene *scene = hanging_cloth(SIDE, 100, 0);
    ms_model model;
    double *x;
    int32_t found = 0;
    add(scene, sphere(0.5, 0.5, near ? 0.2 : 0.201, 0.2, 0, 0), 0);
    assert_ok(ms_model_create(scene->data, 0, &model, err));
    assert_true(MS_NEW_VECTORS(scene->data, &model.unknowns, &x));
    ms_unknowns_gather(&model.unknowns, scene->data->x, x);
    const ms_collision_planes planes = {.n = 1, .nsolids = 1, .solid = scene->data->solids};
    ms_broad_phase b = {.model = &model, .planes = &planes, .x = x};
    for (int32_t r = ms_broad_phase_next(&b, 0); r < model.unknowns.nfree;
         r = ms_broad_phase_next(&b, r + 1))
      found++;
    assert_in_range(found, near ? 1 : 0, near ? 4 * MS_SLICE : 0);
    MS_FREE(&scene->data->alloc, x);
    ms_model_destroy(&model);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(no_point_of_a_box_is_nearer_than_the_bound),
                                     cmocka_unit_test(boxes_are_those_of_a_loop),
                                     cmocka_unit_test(particles_that_meet_planes_are_found_exactly),
                                     cmocka_unit_test(far_obstacles_cost_no_exact_test),
                                     cmocka_unit_test(no_particle_is_left_out)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
