/* Tests of self-contact under strong forces with implicit methods: cloths under a weight, a solid
 * between two that move towards each other, a cloth pulled tight around another one go on moving as
 * with short steps, without intersections and without new energy; a pile slides down a plane;
 * momentum of bodies that collide, and the motion of those that do not. */
#include "meshes.h"
#include "surfaces.h"

static const char *const methods[] = {"linearly-implicit-euler", "implicit-euler", "bdf2",
                                      "trapezoidal"};
enum { METHODS = sizeof methods / sizeof *methods };

/* A filled cube of edge 0.2 around (0, 0, z), turned by `angle` about the vertical */
static void add_cube(msim_scene *scene, double z, double angle, double k, double mass) {
  double x[24], turned[24];
  place_cube(-0.1, 0.2, x);
  for (int i = 0; i < 8; i++) {
    turned[3 * i] = cos(angle) * x[3 * i] - sin(angle) * x[3 * i + 1];
    turned[3 * i + 1] = sin(angle) * x[3 * i] + cos(angle) * x[3 * i + 1];
    turned[3 * i + 2] = x[3 * i + 2] + z;
  }
  msim_mesh mesh = make_mesh(8, turned, 12, cube_faces);
  mesh.mass = mass, mesh.k = k, mesh.damping = 0.05, mesh.fill = MSIM_FILL_AUTO;
  assert_ok(msim_scene_add_mesh(scene, &mesh, err));
}

static msim_scene_view view_of(const msim_scene *scene) {
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(scene, &view);
  return view;
}

/* The mean of a component of particles [begin, end) */
static double mean_of(const double *x, int32_t begin, int32_t end, int c) {
  double sum = 0;
  for (int32_t i = begin; i < end; i++) sum += x[3 * i + c];
  return sum / (end - begin);
}

/*------------------------------------- three cloths under a weight ------------------------------*/

enum { LOWEST = 10 * 10, CLOTHS = LOWEST + 9 * 9 + 8 * 8 };

static msim_scene *cloths_under_weight(void) {
  const int32_t corners[4] = {0, 9, 90, 99};
  msim_scene *scene = surfaces(9.81, 0.3);
  add_sheet(scene, 10, 1000, 1, 0, 0, 0, NULL);
  assert_ok(msim_scene_pin(scene, 4, corners, err));
  add_sheet(scene, 9, 1000, 0.8, 0.02, 0.01, 0.02, NULL);
  add_sheet(scene, 8, 1000, 0.6, -0.01, 0.02, 0.04, NULL);
  add_cube(scene, 0.17, 0.3, 1e4, 5);
  return scene;
}

/* The height of the weight after t seconds, without intersections or new energy on the way */
static double press(const char *method, double h, double t) {
  msim_scene *scene = cloths_under_weight();
  const msim_options opt = options(method, h);
  msim_sim *sim = make_sim(scene, &opt);
  const double before = total_energy(sim);
  const double most = run_without_intersections(sim, scene, (int64_t)(t / h + 0.5), 0, NULL);
  assert_true(most <= before * (1 + 1e-6));
  const msim_state s = state_of(sim);
  const double z = mean_of(s.x, CLOTHS, s.n, 2);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return z;
}

/* Cloths of 1000 N/m hold the weight of 50 N where they have sagged by some 0.2 m, which takes half
 * a second: a frozen step would hold it anywhere above. */
static void cloths_give_way_to_a_weight(void **state) {
  (void)state;
  for (int m = 0; m < METHODS; m++) {
    const double z = press(methods[m], 1 / 60., 0.5);
    assert_true(z < -0.05 && z > -0.3);
  }
}

/*------------------------------------- a solid between two others -------------------------------*/

/* Two cubes, all of whose particles are pinned, move towards a third one from both sides, 30 mm
 * beyond its faces, and with it 20 mm apart: it is shorter by more than 20 mm, in the middle. */
static void solid_is_squeezed(void **state) {
  (void)state;
  for (int m = 0; m < METHODS; m++) {
    msim_scene *scene = surfaces(0, 0.3);
    add_cube(scene, 0.23, 0.3, 1000, 1);
    const int32_t upper = view_of(scene).nparticles;
    add_cube(scene, -0.23, 0.3, 1000, 1);
    const int32_t lower = view_of(scene).nparticles;
    add_cube(scene, 0, 0, 1000, 1);
    const msim_scene_view view = view_of(scene);
    int32_t *pinned = malloc(sizeof *pinned * (size_t)lower);
    double *x = malloc(2 * sizeof *x * 3 * (size_t)lower), t[2] = {0, 0.5};
    for (int32_t i = 0; i < lower; i++) pinned[i] = i;
    for (int32_t i = 0; i < 3 * lower; i++) {
      const double displacement = i % 3 != 2 ? 0 : i < 3 * upper ? -0.06 : 0.06;
      x[i] = view.x[i], x[3 * lower + i] = view.x[i] + displacement;
    }
    const msim_motion motion = {
        .size = sizeof motion, .n = lower, .particles = pinned, .nt = 2, .t = t, .x = x};
    assert_ok(msim_scene_pin(scene, lower, pinned, err));
    assert_ok(msim_scene_add_motion(scene, &motion, err));
    const msim_options opt = options(methods[m], 1 / 60.);
    msim_sim *sim = make_sim(scene, &opt);
    const double most = run_without_intersections(sim, scene, 30, 0, NULL);
    const msim_state s = state_of(sim);
    double low = INFINITY, high = -INFINITY;
    for (int32_t i = lower; i < s.n; i++)
      low = fmin(low, s.x[3 * i + 2]), high = fmax(high, s.x[3 * i + 2]);
    msim_energy e = {.size = sizeof e};
    msim_sim_energy(sim, &e);
    assert_true(e.elastic > 0.1 && most <= 2 * e.work); /* work of damping on the way */
    assert_true(high - low < 0.2 - 0.02);
    assert_close(mean_of(s.x, lower, s.n, 2), 0, 5e-3);
    free(pinned), free(x);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- a cloth pulled tight -------------------------------------*/

/* A strip that lies across a sheet, held all around, is pulled down at both ends, around the edges
 * of the sheet, and then tight. */
static void cloth_is_pulled_tight(void **state) {
  (void)state;
  enum { SIDE = 7, N = SIDE * SIDE, STRIP = 12 };
  for (int m = 0; m < METHODS; m++) {
    msim_scene *scene = surfaces(9.81, 0.3);
    int32_t held[N], ends[2 * STRIP];
    double x[2 * 3 * 2 * STRIP], t[2] = {0, 0.5};
    add_sheet(scene, SIDE, 2000, 0.4, 0, 0, 0, NULL);
    for (int32_t i = 0; i < N; i++) held[i] = i;
    assert_ok(msim_scene_pin(scene, N, held, err));
    add_cloth(scene, STRIP, 1000, (const double[3]){-0.5, -0.15, 0.02},
              (const double[3]){0, 0.3, 0}, (const double[3]){1, 0, 0}, NULL);
    const msim_scene_view view = view_of(scene);
    for (int32_t i = N, n = 0; i < view.nparticles; i++)
      if (fabs(view.x[3 * i]) > 0.499) ends[n++] = i;
    for (int32_t i = 0; i < 2 * STRIP; i++) {
      const double side = view.x[3 * ends[i]] < 0 ? -1 : 1;
      for (int c = 0; c < 3; c++) x[3 * i + c] = x[6 * STRIP + 3 * i + c] = view.x[3 * ends[i] + c];
      x[6 * STRIP + 3 * i] = 0.25 * side, x[6 * STRIP + 3 * i + 2] = -0.42;
    }
    const msim_motion motion = {
        .size = sizeof motion, .n = 2 * STRIP, .particles = ends, .nt = 2, .t = t, .x = x};
    assert_ok(msim_scene_pin(scene, 2 * STRIP, ends, err));
    assert_ok(msim_scene_add_motion(scene, &motion, err));
    const msim_options opt = options(methods[m], 1 / 60.);
    msim_sim *sim = make_sim(scene, &opt);
    const double most = run_without_intersections(sim, scene, 45, 0, NULL);
    const msim_state s = state_of(sim);
    msim_energy e = {.size = sizeof e};
    msim_sim_energy(sim, &e);
    assert_true(e.elastic > 50); /* it is tight */
    assert_true(m == 0 || m == 3 || most <= e.work);
    assert_true(most < 500 && mean_of(s.x, N, s.n, 2) < -0.1);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- sheets on a slope ----------------------------------------*/

/* Without friction three sheets that lie on each other on a plane of slope 3/4 slide down together,
 * by g sin of its angle, and press on it and on each other all the way: the plane holds those that
 * others press on it, across the slope only, also where steps are shortened. These gain no energy
 * beyond the bound that docs/contact.md states. */
static void sheets_slide_down_a_plane(void **state) {
  (void)state;
  const double c = 0.8, s = 0.6, t = 0.4;
  for (int run = 0; run < 2 * METHODS; run++) {
    const double h = run % 2 ? 1 / 240. : 1 / 60.;
    msim_scene *scene = surfaces(9.81, 0);
    for (int i = 0; i < 3; i++) {
      const double above = 0.012 + 0.022 * i, half = 0.2 - 0.02 * i;
      add_cloth(scene, 6 - i, 500,
                (const double[3]){-half * c - above * s, -half, -half * s + above * c},
                (const double[3]){0, 2 * half, 0}, (const double[3]){2 * half * c, 0, 2 * half * s},
                NULL);
    }
    plane(scene, -s, 0, c, 0, 0, 0);
    const msim_options opt = options(methods[run / 2], h);
    msim_sim *sim = make_sim(scene, &opt);
    msim_energy e = {.size = sizeof e};
    double energy = total_energy(sim);
    for (int64_t i = 0; i < (int64_t)(t / h + 0.5); i++) {
      const double next = run_without_intersections(sim, scene, 1, 0, NULL);
      msim_sim_energy(sim, &e);
      assert_true(next <= energy + 1e-5 * (e.kinetic + e.elastic));
      energy = next;
    }
    const msim_state now = state_of(sim);
    double speed = 0; /* the mean of the sheets, whose masses are equal */
    for (int32_t sheet = 0, first = 0; sheet < 3; sheet++) {
      const int32_t end = first + (6 - sheet) * (6 - sheet);
      speed -= (mean_of(now.v, first, end, 0) * c + mean_of(now.v, first, end, 2) * s) / 3;
      first = end;
    }
    assert_close(speed / (9.81 * s * t), 1, 1e-3);
    for (int32_t i = 0; i < now.n; i++)
      assert_true(now.x[3 * i + 2] * c - now.x[3 * i] * s > -1e-12);
    assert_true(stats_of(sim).contacts > 1000);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- momentum -------------------------------------------------*/

/* Let the particles from `first` on, a sheet in the plane z = 0, swell: it vibrates. */
static void swell(msim_sim *sim, int32_t first) {
  const msim_state s = state_of(sim);
  const size_t bytes = 3 * (size_t)s.n * sizeof *s.v;
  double *v = memcpy(malloc(bytes), s.v, bytes);
  for (int32_t i = 3 * first; i < 3 * s.n; i++) v[i] = s.x[i] - (i % 3 == 0 ? 5 : 0);
  const msim_state start = {.size = sizeof start, .n = s.n, .x = s.x, .v = v};
  assert_ok(msim_sim_set_state(sim, &start, err));
  free(v);
}

/* Two sheets collide in free fall, far from a third one that vibrates: the momentum of both changes
 * by their weight, and the third one moves as alone, up to the tolerance of linear solutions, also
 * where the steps of the others are shortened. */
static void momentum_is_that_of_gravity(void **state) {
  (void)state;
  for (int m = 0; m < METHODS; m++) {
    msim_scene *scene = surfaces(9.81, 0.2), *third = surfaces(9.81, 0.2);
    const double down[3] = {0.1, 0, -3}, h = 1 / 60.;
    add_sheet(scene, 10, 1000, 1, 0, 0, 0, NULL);
    add_sheet(scene, 9, 1000, 0.8, 0.02, 0.01, 0.05, down);
    const int32_t n = view_of(scene).nparticles;
    add_sheet(scene, 6, 300, 0.8, 5, 0, 0, NULL);
    add_sheet(third, 6, 300, 0.8, 5, 0, 0, NULL);
    const msim_options opt = options(methods[m], h);
    msim_sim *sim = make_sim(scene, &opt), *alone = make_sim(third, &opt);
    swell(sim, n), swell(alone, 0);
    run_without_intersections(sim, scene, 30, 0, NULL);
    assert_ok(msim_sim_step(alone, 30, err));
    assert_true(stats_of(sim).contacts > 100);
    const msim_state s = state_of(sim), t = state_of(alone);
    const msim_scene_view view = view_of(scene);
    double p[3] = {0}, largest = 0, size = 0;
    for (int32_t i = 0; i < 3 * n; i++) p[i % 3] += view.mass[i / 3] * s.v[i];
    assert_close(p[0], 0.3 * 0.1, 1e-6);
    assert_close(p[1], 0, 1e-6);
    assert_close(p[2], -0.3 * 3 - 0.6 * 9.81 * 30 * h, 1e-6);
    for (int32_t i = 0; i < 3 * t.n; i++) {
      largest = fmax(largest, fabs(s.v[3 * n + i] - t.v[i]));
      size = fmax(size, i % 3 < 2 ? fabs(t.v[i]) : 0);
    }
    assert_true(largest <= 1e-6);
    assert_true(m < 3 || size > 0.1); /* the others damp vibrations */
    msim_sim_destroy(sim), msim_sim_destroy(alone);
    msim_scene_destroy(scene), msim_scene_destroy(third);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(cloths_give_way_to_a_weight), cmocka_unit_test(solid_is_squeezed),
      cmocka_unit_test(cloth_is_pulled_tight), cmocka_unit_test(sheets_slide_down_a_plane),
      cmocka_unit_test(momentum_is_that_of_gravity)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
