/* Tests of height fields and grids of signed distances: distances against other formulas, planes
 * and spheres in this form, bodies that stay outside, scene files and refusals. */
#include <stdio.h>

#include "base/vec3.h"
#include "checkpoints.h"
#include "sampled_colliders.h"
#include "state_hash.h"

enum { NX = 7, NY = 5 };

/*------------------------------------- distances ------------------------------------------------*/

static double segment_distance(const double a[3], const double b[3], const double q[3]) {
  double ab[3], d[3];
  for (int c = 0; c < 3; c++) ab[c] = b[c] - a[c], d[c] = q[c] - a[c];
  const double t = fmax(0, fmin(1, ms_vec3_dot(d, ab) / ms_vec3_dot(ab, ab)));
  ms_vec3_axpy(-t, ab, d);
  return ms_vec3_norm(d);
}

/* The distance to the plane, if the foot is inside by the signs of three volumes; else to the edges
 */
static double triangle_distance(double t[3][3], const double q[3]) {
  double a[3], b[3], n[3], least = INFINITY;
  for (int c = 0; c < 3; c++) a[c] = t[1][c] - t[0][c], b[c] = t[2][c] - t[0][c];
  for (int c = 0; c < 3; c++)
    n[c] = a[(c + 1) % 3] * b[(c + 2) % 3] - a[(c + 2) % 3] * b[(c + 1) % 3];
  int inside = 1;
  for (int i = 0; i < 3; i++) {
    const double *p = t[i], *r = t[(i + 1) % 3];
    double e[3], d[3], side[3];
    for (int c = 0; c < 3; c++) e[c] = r[c] - p[c], d[c] = q[c] - p[c];
    for (int c = 0; c < 3; c++)
      side[c] = e[(c + 1) % 3] * d[(c + 2) % 3] - e[(c + 2) % 3] * d[(c + 1) % 3];
    inside &= ms_vec3_dot(side, n) >= 0;
    least = fmin(least, segment_distance(p, r, q));
  }
  double d[3];
  for (int c = 0; c < 3; c++) d[c] = q[c] - t[0][c];
  return inside ? fabs(ms_vec3_dot(d, n)) / ms_vec3_norm(n) : least;
}

/* The distance of q from all triangles, with cells of 99 m beyond the border, and whether q is
 * below the surface */
static double reference_distance(const msim_collider *c, const double q[3]) {
  double least = INFINITY, above = 0;
  for (int i = -1; i < c->n[0]; i++)
    for (int j = -1; j < c->n[1]; j++)
      for (int k = 0; k < 2; k++) {
        double t[3][3];
        const int corner[3][2] = {
            {i, j}, {k ? i + 1 : i + 1, k ? j + 1 : j}, {k ? i : i + 1, j + 1}};
        for (int m = 0; m < 3; m++) {
          const int at[2] = {corner[m][0], corner[m][1]};
          int in[2];
          for (int x = 0; x < 2; x++) {
            in[x] = at[x] < 0 ? 0 : at[x] > c->n[x] - 1 ? c->n[x] - 1 : at[x];
            t[m][x] = in[x] * c->spacing[x] + 99 * (at[x] - in[x]);
          }
          t[m][2] = c->values[in[0] * c->n[1] + in[1]];
        }
        least = fmin(least, triangle_distance(t, q));
        /* below or above, by barycentric coordinates in the plane */
        const double det =
            (t[1][0] - t[0][0]) * (t[2][1] - t[0][1]) - (t[2][0] - t[0][0]) * (t[1][1] - t[0][1]);
        const double v = ((q[0] - t[0][0]) * (t[2][1] - t[0][1]) -
                          (t[2][0] - t[0][0]) * (q[1] - t[0][1])) /
                         det,
                     w = ((t[1][0] - t[0][0]) * (q[1] - t[0][1]) -
                          (q[0] - t[0][0]) * (t[1][1] - t[0][1])) /
                         det;
        if (v >= -1e-12 && w >= -1e-12 && v + w <= 1 + 1e-12)
          above = q[2] - (t[0][2] + v * (t[1][2] - t[0][2]) + w * (t[2][2] - t[0][2]));
      }
  return above < 0 ? -least : least;
}

static void distances_from_heights(void **state) {
  (void)state;
  unsigned seed = 4;
  int exact = 0;
  for (int i = 0; i < 3000; i++) {
    const double origin[3] = {0}, spacing[2] = {0.1 + 0.2 * uniform(&seed), 0.2};
    double values[NX * NY], normal[3], back[3], x[3];
    for (int k = 0; k < NX * NY; k++) values[k] = (i % 3) * 0.3 * uniform(&seed);
    msim_scene *scene = new_scene();
    const msim_collider c = heights(origin, spacing, NX, NY, values, 1, 0);
    add(scene, c, i % 2);
    const double reach = i % 5 ? 0.4 : 3;
    for (int k = 0; k < 3; k++) x[k] = reach * (4 * uniform(&seed) - 1.5);
    x[2] -= reach / 2;
    const double side = i % 2 ? -1 : 1, right = side * reference_distance(&c, x);
    const double s = ms_signed_distance(&scene->data->solids[0], x, normal);
    assert_close(ms_vec3_norm(normal), 1, 1e-14);
    if (right > 0 && s < right - 1e-12) { /* far away: a lower bound */
      assert_true(s > 0.1);
      msim_scene_destroy(scene);
      continue;
    }
    exact++;
    assert_close(s, right, 1e-12);
    for (int k = 0; k < 3; k++) back[k] = x[k] - s * normal[k];
    assert_close(reference_distance(&c, back), 0, 1e-12);
    msim_scene_destroy(scene);
  }
  assert_true(exact > 2000);
}

/* Samples of the distance from a sphere of radius 1: near it, of second order in the spacing */

static void distances_from_grids(void **state) {
  (void)state;
  static double values[MOST];
  double worst[2] = {0};
  for (int fine = 0; fine < 2; fine++) {
    const int32_t n = fine ? 23 : 12;
    unsigned seed = 9;
    msim_scene *scene = new_scene();
    sample_sphere(n, values);
    add(scene, sampled_sphere(n, values, 1, 0), 0);
    for (int i = 0; i < 2000; i++) {
      double x[3], normal[3];
      for (int k = 0; k < 3; k++) x[k] = 2 * uniform(&seed) - 1;
      const double r = ms_vec3_norm(x), size = 0.98 + 0.04 * uniform(&seed);
      for (int k = 0; k < 3; k++) x[k] *= size / r;
      const double s = ms_signed_distance(&scene->data->solids[0], x, normal);
      worst[fine] = fmax(worst[fine], fabs(s - (size - 1)));
      assert_close(ms_vec3_norm(normal), 1, 1e-14);
      assert_true(ms_vec3_dot(normal, x) > 0.9 * size);
      /* outside the grid: a lower bound, continuous at its border */
      for (int k = 0; k < 3; k++) x[k] *= 8 / size;
      const double far = ms_signed_distance(&scene->data->solids[0], x, normal);
      assert_true(far > 3 && far <= 7 + 1e-12);
    }
    msim_scene_destroy(scene);
  }
  print_message("  errors %.3g m, %.3g m\n", worst[0], worst[1]);
  assert_true(worst[0] < 0.05 && worst[1] < worst[0] / 3);
}

/*------------------------------------- runs -----------------------------------------------------*/

/* A block that lands on a slope: on a plane, on a height field, and with both turned by a motion */
static double end_on_slope(int kind, double x[3]) {
  const double origin[3] = {-5, -5, -0.5}, spacing[2] = {2.5, 5}, flat[2] = {10, 10};
  double values[5 * 3], level[4] = {0};
  for (int i = 0; i < 5; i++)
    for (int j = 0; j < 3; j++)
      values[3 * i + j] = 0.2 * i * spacing[0] / 2 + 0.1 * j * spacing[1] / 5;
  msim_scene *scene = new_scene();
  const msim_lattice block = {.size = sizeof block,
                              .n = {3, 3, 3},
                              .origin = {0.1, -0.1, 0.3},
                              .extent = {0.2, 0.2, 0.2},
                              .mass = 2,
                              .k = 200,
                              .damping = 0.2};
  assert_ok(msim_scene_add_lattice(scene, &block, err));
  if (kind == 0) plane(scene, -0.1, -0.02, 1, -0.5 + 0.5 + 0.1, 0.3, 0.2);
  if (kind == 1) add(scene, heights(origin, spacing, 5, 3, values, 0.3, 0.2), 0);
  if (kind == 2) { /* a level field, turned about (0, 0, 0.1), where the plane is */
    const double t = 0, middle[3] = {0, 0, 0.1}, tilt = atan(hypot(0.1, 0.02));
    const double w[3] = {0.02 / hypot(0.1, 0.02) * tilt, -0.1 / hypot(0.1, 0.02) * tilt, 0};
    add(scene, heights(origin, flat, 2, 2, level, 0.3, 0.2), 0);
    set_motion(scene, 0, 1, &t, middle, w, 0);
  }
  const msim_options opt = options("symplectic-euler", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 800, err));
  for (int c = 0; c < 3; c++) x[c] = state_of(sim).x[c];
  const double contacts = (double)stats_of(sim).contacts;
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return contacts;
}

static void slopes_are_planes(void **state) {
  (void)state;
  double x[3][3];
  for (int kind = 0; kind < 3; kind++) assert_true(end_on_slope(kind, x[kind]) > 100);
  for (int kind = 1; kind < 3; kind++)
    for (int c = 0; c < 3; c++) assert_close(x[kind][c], x[0][c], 1e-7);
}

/* With sharp ridges and valleys and a coarse grid, by all methods: no particle is inside by more
 * than 1e-9 of the size; runs resume, with 1 and 2 threads */
static void bodies_stay_outside(void **state) {
  (void)state;
  const int64_t at[1] = {250};
  unsigned seed = 12;
  for (int32_t m = 0; method_at(m); m++) {
    const char *method = method_at(m);
    if (refuses_planes(method) || takes_positions_only(method) || !strcmp(method, "explicit-euler"))
      continue;
    msim_scene *scene = rough_scene(&seed, 0.3 * (m % 3));
    msim_options opt = options(method, 1e-3);
    uint64_t hash[2];
    for (opt.threads = 1; opt.threads <= 2; opt.threads++) {
      msim_sim *sim = make_sim(scene, &opt);
      for (int step = 0; step < 300; step++) {
        assert_ok(msim_sim_step(sim, 1, err));
        const double least = least_distance(sim);
        if (!(least >= -1e-9)) fail_msg("%s, step %d: %g m inside", method, step, -least);
      }
      assert_true(stats_of(sim).contacts > 100);
      hash[opt.threads - 1] = hash_sim(sim);
      msim_sim_destroy(sim);
    }
    assert_true(hash[0] == hash[1]);
    opt.threads = 1;
    expect_resumable(scene, &opt, 300, 1, at, method);
    msim_scene_destroy(scene);
  }
}

/* Fast particles that end steps deep below rough ground leave it upwards. */
static void deep_particles_leave(void **state) {
  (void)state;
  unsigned seed = 2;
  for (int i = 0; i < 200; i++) {
    const double origin[3] = {-1.5, -1.5, -1}, spacing[2] = {0.25, 0.3};
    const double x[3] = {uniform(&seed), uniform(&seed), 0.1},
                 v[3] = {10 * uniform(&seed), 0, -100 * uniform(&seed)};
    double ground[13 * 11];
    for (int k = 0; k < 13 * 11; k++) ground[k] = 0.5 * uniform(&seed);
    msim_scene *scene = make_single_particle(x, v, 9.81);
    add(scene, heights(origin, spacing, 13, 11, ground, 0.5 * (i % 3), 0.3), 0);
    const msim_options opt = options("velocity-verlet", 0.01);
    msim_sim *sim = make_sim(scene, &opt);
    for (int step = 0; step < 100; step++) {
      assert_ok(msim_sim_step(sim, 1, err));
      if (!(least_distance(sim) >= -1e-9)) fail_msg("%d: %g m inside", i, -least_distance(sim));
    }
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- scenes ---------------------------------------------------*/

static void expect_samples(const msim_scene *scene) {
  const msim_collider *c = scene->data->colliders;
  assert_int_equal(c[0].type, MSIM_COLLIDER_HEIGHTFIELD);
  assert_true(c[0].n[0] == 2 && c[0].n[1] == 3 && c[0].values[5] == 0.5);
  assert_true(c[0].spacing[1] == 0.25 && c[0].origin[2] == 3 && c[0].friction == 0.5);
  assert_int_equal(c[1].type, MSIM_COLLIDER_SDF);
  assert_true(c[1].n[2] == 3 && c[1].values[11] == 0.1 && c[1].inside == 1);
}

static void scene_files_keep_samples(void **state) {
  (void)state;
  static const char text[] =
      "{\"msim\": 1, \"particles\": {\"x\": [[0, 0, 9]], \"mass\": 1}, \"colliders\": [\n"
      "{\"type\": \"heightfield\", \"origin\": [1, 2, 3], \"spacing\": [0.5, 0.25], \"n\": [2, "
      "3],\n"
      " \"heights\": [0, 0.1, 0.2, 0.3, 0.4, 0.5], \"friction\": 0.5},\n"
      "{\"type\": \"sdf\", \"origin\": [0, 0, 0], \"spacing\": [1, 1, 2], \"n\": [2, 2, 3],\n"
      " \"values\": [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 0.1], \"inside\": true}]}";
  msim_scene *scene, *again;
  const msim_allocator alloc = ms_memory_allocator(NULL);
  ms_text written = {.alloc = &alloc};
  assert_ok(msim_scene_parse(NULL, "text", text, strlen(text), &scene, err));
  assert_ok(msim_scene_set_name(scene, "changed", err));
  assert_ok(ms_scene_write_json(scene->data, &written, err));
  assert_ok(msim_scene_parse(NULL, "again", written.data, written.length, &again, err));
  expect_samples(scene), expect_samples(again);
  msim_scene_destroy(again);
  const msim_status status = msim_scene_save(scene, "test_sampled_colliders.h5", NULL);
  require(status != MSIM_ERR_NAME, "the importer hdf5");
  assert_int_equal(status, MSIM_OK);
  assert_ok(msim_scene_load(NULL, "test_sampled_colliders.h5", &again, err));
  remove("test_sampled_colliders.h5");
  expect_samples(again);
  ms_text_free(&written);
  msim_scene_destroy(scene), msim_scene_destroy(again);
}

static void wrong_samples_are_refused(void **state) {
  (void)state;
  const double origin[3] = {0}, spacing[2] = {1, 1}, v[27] = {1, NAN};
  double grid[27];
  for (int i = 0; i < 27; i++) grid[i] = i == 13 ? -1 : 1;
  msim_collider c[7];
  const char *const says[] = {"n[0] is 1",
                              "n[1] is 0",
                              "heights[1] is",
                              "spacing[1] is",
                              "values is NULL",
                              "n is too large",
                              "values[12] is 0 at the border"};
  for (int i = 0; i < 7; i++) c[i] = heights(origin, spacing, 3, 3, grid, 1, 0);
  c[0].n[0] = 1, c[1].n[1] = 0, c[2].values = v, c[3].spacing[1] = 0, c[4].values = NULL;
  c[5].n[0] = c[5].n[1] = 1 << 20;
  c[6].type = MSIM_COLLIDER_SDF, c[6].spacing[2] = 1, c[6].n[2] = 3, grid[12] = 0;
  msim_scene *scene = new_scene();
  for (int i = 0; i < 7; i++) {
    msim_error err;
    assert_int_equal(msim_scene_add_collider(scene, &c[i], &err), MSIM_ERR_ARG);
    if (!strstr(err.text, says[i])) fail_msg("%d: %s", i, err.text);
  }
  assert_int_equal(scene->data->ncolliders, 0);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(distances_from_heights),   cmocka_unit_test(distances_from_grids),
      cmocka_unit_test(slopes_are_planes),        cmocka_unit_test(bodies_stay_outside),
      cmocka_unit_test(deep_particles_leave),     cmocka_unit_test(scene_files_keep_samples),
      cmocka_unit_test(wrong_samples_are_refused)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
