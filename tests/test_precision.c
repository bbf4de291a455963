/* Tests of runs with precision = single: their error against runs in double precision, far from the
 * origin, threads, observers and checkpoints, changes of a running sim, and what is refused. */
#include <float.h>
#include <math.h>

#include "checkpoints.h"
#include "failing_sims.h"
#include "scene/scene.h"

#define U (FLT_EPSILON / 2) /* the largest relative error of an operation */

static msim_options single_options(const char *method, double h) {
  msim_options opt = options(method, h);
  opt.precision = MSIM_PRECISION_SINGLE;
  opt.solver = "pcg"; /* whose vectors have floats, too */
  return opt;
}

/* All that single precision supports, but explicit-euler, which is unstable without damping, and
 * ssprk104, which combines stages twice and so rounds half as much again */
#define IMPLICIT "linearly-implicit-euler"
static const char *const methods[] = {
    "heun", "verlet",   "symplectic-euler", "velocity-verlet", "rk4",
    "rkc",  "ssprk102", "takahashi-imada",  "force-gradient",  IMPLICIT};
enum { METHODS = sizeof methods / sizeof *methods };

/* An explicit method and the implicit one */
static const char *const both[] = {"velocity-verlet", IMPLICIT};

static double distance(int32_t n, const double *a, const double *b) {
  double most = 0;
  for (int32_t i = 0; i < n; i++) most = fmax(most, fabs(a[i] - b[i]));
  return most;
}

/*------------------------------------- errors ---------------------------------------------------*/

/* A chain of springs of rest length 0, whose motion is linear: floats of positions are off by U,
 * and forces by as much as if springs were attached there, while sums lose nothing: an error of
 * some U of the extent of 1 m at rest, and in a period of a vibration as much again by resonance.
 * 10 s are at most 32 periods. */
static void errors_do_not_add_up(void **state) {
  (void)state;
  enum { N = 30, STEPS = 1000 };
  double x[3 * N], v[3 * N], mass[N], k[N];
  int32_t ij[2 * N];
  const int32_t pin = 0;
  unsigned seed = 11;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int i = 0; i < 3 * N; i++) x[i] = uniform(&seed), v[i] = i < 3 ? 0 : uniform(&seed) - 0.5;
  for (int i = 0; i < N; i++) mass[i] = 1, k[i] = 100, ij[2 * i] = i, ij[2 * i + 1] = i + 1;
  static const double rest[N];
  assert_ok(msim_scene_add_particles(scene, N, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, N - 1, ij, k, rest, NULL, err));
  assert_ok(msim_scene_pin(scene, 1, &pin, err));
  for (int m = 0; m < METHODS; m++) {
    msim_options opt = single_options(methods[m], 0.01);
    msim_sim *single = make_sim(scene, &opt);
    opt.precision = MSIM_PRECISION_DOUBLE;
    msim_sim *exact = make_sim(scene, &opt);
    assert_ok(msim_sim_step(single, STEPS, err));
    assert_ok(msim_sim_step(exact, STEPS, err));
    const double off = distance(3 * N, state_of(single).x, state_of(exact).x);
    if (!(off > 0 && off <= 32 * 2 * U)) fail_msg("%s: off by %g", methods[m], off);
    msim_sim_destroy(single), msim_sim_destroy(exact);
  }
  msim_scene_destroy(scene);
}

/* The origin of positions moves with the scene: velocities have the same bits, and positions those
 * that a double has so far away. */
static void distance_from_the_origin_costs_nothing(void **state) {
  (void)state;
  enum { N = 12 };
  const double shift[3] = {1048576, -524288, 262144}, mass[2] = {1, 2}, k = 1000, rest = 0.25;
  msim_sim *sims[2];
  msim_scene *scenes[2];
  for (int far = 0; far < 2; far++) {
    unsigned seed = 4;
    assert_ok(msim_scene_create(NULL, &scenes[far], err));
    for (int32_t i = 0; i < N; i++) {
      double x[3];
      const int32_t ij[2] = {i - 1, i};
      for (int c = 0; c < 3; c++) x[c] = floor(1024 * uniform(&seed)) / 1024 + (far ? shift[c] : 0);
      assert_ok(msim_scene_add_particles(scenes[far], 1, x, NULL, &mass[i % 2], err));
      if (i) assert_ok(msim_scene_add_springs(scenes[far], 1, ij, &k, &rest, NULL, err));
    }
    const msim_options opt = single_options("velocity-verlet", 1e-3);
    sims[far] = make_sim(scenes[far], &opt);
    assert_ok(msim_sim_step(sims[far], 500, err));
  }
  const msim_state near = state_of(sims[0]), far = state_of(sims[1]);
  assert_memory_equal(near.v, far.v, 3 * N * sizeof *near.v);
  for (int i = 0; i < 3 * N; i++)
    assert_close(far.x[i], near.x[i] + shift[i % 3], 0x1p-52 * fabs(shift[i % 3]));
  for (int i = 0; i < 2; i++) msim_sim_destroy(sims[i]), msim_scene_destroy(scenes[i]);
}

/*------------------------------------- the same bits --------------------------------------------*/

/* A cloth; damped, with drag, falling on a plane and a sphere; planar; two parts that no spring
 * connects; damped, with drag, falling on a plane */
static msim_scene *scene_of(int i) {
  const double g[3] = {0, -9.81, 0}, x[6] = {3, 0, 0, 3.5, 0, 0}, mass[2] = {1, 1}, k = 100;
  const int32_t ij[2] = {81, 82};
  msim_scene *scene = hanging_cloth(9, i == 2 ? 50 : 200, i == 1 || i == 4 ? 0.02 : 0);
  if (i == 1) {
    const msim_collider ball = {.size = sizeof ball,
                                .type = MSIM_COLLIDER_SPHERE,
                                .center = {0.5, 0.5, -0.3},
                                .radius = 0.25,
                                .restitution = 0.4};
    assert_ok(msim_scene_add_collider(scene, &ball, err));
  }
  if (i == 1 || i == 4) {
    assert_ok(msim_scene_set_drag(scene, 0.02, err));
    plane(scene, 0.1, 0.2, 1, -0.06, 0.5, 0.3);
  }
  if (i == 2) assert_ok(msim_scene_set_gravity(scene, g, err));
  if (i == 3) assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
  if (i == 3) assert_ok(msim_scene_add_springs(scene, 1, ij, &k, NULL, NULL, err));
  return scene;
}
enum { SCENES = 5 };

static int takes(const char *method, int scene) {
  if (scene == 1 && strcmp(method, IMPLICIT) == 0) return 0;
  const int falls = scene == 1 || scene == 4; /* damped, on a plane */
  return !falls || !(takes_positions_only(method) || refuses_planes(method));
}

static void runs_resume_to_the_bit(void **state) {
  (void)state;
  static const int64_t at[] = {1, 90, 170};
  for (int s = 0; s < SCENES; s++) {
    msim_scene *scene = scene_of(s);
    for (int m = 0; m < METHODS; m++) {
      if (!takes(methods[m], s)) continue;
      const msim_options opt = single_options(methods[m], 1e-3);
      expect_resumable(scene, &opt, 200, 3, at, methods[m]);
    }
    msim_scene_destroy(scene);
  }
}

static void observers_and_threads_change_no_bit(void **state) {
  (void)state;
  for (int s = 0; s < SCENES; s++) {
    msim_scene *scene = scene_of(s);
    for (int m = 0; m < METHODS; m++) {
      if (!takes(methods[m], s)) continue;
      msim_options opt = single_options(methods[m], 1e-3);
      opt.threads = 1;
      msim_sim *alone = make_sim(scene, &opt);
      opt.threads = 2, opt.watch = MSIM_WATCH_OFF;
      msim_sim *other = make_sim(scene, &opt);
      msim_energy energy = {.size = sizeof energy};
      double force[300];
      assert_ok(msim_sim_step(alone, 170, err));
      for (int i = 0; i < 170; i++) {
        assert_ok(msim_sim_step(other, 1, err));
        const msim_state now = state_of(other);
        msim_sim_force(other, now.x, now.v, force);
        msim_sim_energy(other, &energy);
      }
      expect_same(alone, other, methods[m]);
      msim_sim_destroy(alone), msim_sim_destroy(other);
    }
    msim_scene_destroy(scene);
  }
}

/* Particles bounce as in double precision, at most a rounded position behind a plane; those that
 * touch nothing have the same bits as without it, also where doubles are coarser than floats. */
static void expect_bounces(const char *method) {
  enum { N = 20, STEPS = 1500 };
  double x[3 * N], v[3 * N], mass[N];
  unsigned seed = 21;
  msim_scene *scenes[2];
  msim_sim *sims[3];
  for (int i = 0; i < N; i++) {
    for (int c = 0; c < 3; c++) x[3 * i + c] = uniform(&seed), v[3 * i + c] = uniform(&seed);
    x[3 * i] += 0x1p30, mass[i] = 1;
    if (i % 2) v[3 * i + 2] = 20;
  }
  for (int k = 0; k < 2; k++) {
    const double g[3] = {0, 0, -9.81};
    assert_ok(msim_scene_create(NULL, &scenes[k], err));
    assert_ok(msim_scene_add_particles(scenes[k], N, x, v, mass, err));
    assert_ok(msim_scene_set_gravity(scenes[k], g, err));
    if (k == 0) plane(scenes[k], 0, 0, 1, 0, 0.7, 0.2);
  }
  for (int k = 0; k < 3; k++) {
    msim_options opt = single_options(method, 1e-3);
    opt.skip_off = MSIM_SKIP_ISLANDS;
    if (k == 2) opt.precision = MSIM_PRECISION_DOUBLE;
    sims[k] = make_sim(scenes[k % 2], &opt);
    assert_ok(msim_sim_step(sims[k], STEPS, err));
  }
  const msim_state with = state_of(sims[0]), without = state_of(sims[1]), exact = state_of(sims[2]);
  assert_true(stats_of(sims[0]).contacts > N / 2);
  assert_int_equal(stats_of(sims[0]).contacts, stats_of(sims[2]).contacts);
  for (int i = 0; i < N; i++) {
    assert_true(with.x[3 * i + 2] >= -U * 16);
    if (i % 2) assert_memory_equal(with.x + 3 * i, without.x + 3 * i, 3 * sizeof *x);
    for (int c = 1; c < 3; c++) assert_close(with.x[3 * i + c], exact.x[3 * i + c], 1e-5);
  }
  for (int k = 0; k < 3; k++) msim_sim_destroy(sims[k]);
  for (int k = 0; k < 2; k++) msim_scene_destroy(scenes[k]);
}

static void particles_bounce(void **state) {
  (void)state;
  for (int m = 0; m < 2; m++) expect_bounces(both[m]);
}

/* The state that a run starts from is the caller's, without rounding. */
static void start_is_not_rounded(void **state) {
  (void)state;
  const double x[] = {1 / 3., 0.1, 1e-9}, v[] = {0.1, 0.7, 1 / 7.};
  msim_scene *scene = make_single_particle(x, v, 9.81);
  const msim_options opt = single_options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_memory_equal(state_of(sim).x, x, sizeof x);
  assert_memory_equal(state_of(sim).v, v, sizeof v);
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

/* A run that starts elsewhere than the scene has another origin, which its checkpoint has. */
static void checkpoints_have_the_origin(void **state) {
  (void)state;
  const double at[3] = {0.1, 0.2, 0.3}, v[3] = {1, 0, 0}, there[3] = {1000 / 3., 0.4, -0.7};
  msim_scene *scene = make_single_particle(at, v, 9.81);
  const msim_options opt = single_options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  msim_state now = state_of(sim);
  now.x = there;
  assert_ok(msim_sim_set_state(sim, &now, err));
  assert_ok(msim_sim_step(sim, 10, err));
  const checkpoint c = save(sim);
  msim_sim *other = resume(scene, &opt, &c);
  expect_same(sim, other, "elsewhere");
  assert_ok(msim_sim_step(sim, 10, err));
  expect_same_end(sim, other, 10, "elsewhere");
  free(c.bytes);
  msim_sim_destroy(sim), msim_sim_destroy(other), msim_scene_destroy(scene);
}

/* Pinned particles are where the scene has them, whatever the origin: a state may be set again. */
static void pinned_particles_stay_exactly(void **state) {
  (void)state;
  msim_scene *scene = scene_of(0);
  const msim_options opt = single_options("velocity-verlet", 1e-3);
  const ms_scene *s = scene->data;
  double x[300];
  unsigned seed = 3;
  msim_sim *sim = make_sim(scene, &opt);
  msim_state now = state_of(sim);
  for (int i = 0; i < 3 * now.n; i++) x[i] = now.x[i] + (s->pinned[i / 3] ? 0 : uniform(&seed) / 7);
  now.x = x;
  assert_ok(msim_sim_set_state(sim, &now, err));
  assert_ok(msim_sim_step(sim, 37, err));
  now = state_of(sim);
  for (int p = 0; p < now.n; p++)
    if (s->pinned[p]) assert_memory_equal(now.x + 3 * p, s->x + 3 * p, 3 * sizeof *s->x);
  assert_ok(msim_sim_set_state(sim, &now, err));
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

/* A checkpoint continues with the same precision only. */
static void checkpoints_of_another_precision_are_refused(void **state) {
  (void)state;
  msim_scene *scene = scene_of(0);
  msim_options opt = single_options("velocity-verlet", 1e-3);
  msim_sim *single = make_sim(scene, &opt);
  opt.precision = MSIM_PRECISION_DOUBLE;
  msim_sim *sim = make_sim(scene, &opt);
  const checkpoint c = save(single);
  msim_error why;
  assert_true(msim_sim_load(sim, c.bytes, c.length, &why) != MSIM_OK);
  assert_non_null(strstr(why.text, "precision"));
  free(c.bytes);
  msim_sim_destroy(single), msim_sim_destroy(sim), msim_scene_destroy(scene);
}

/*------------------------------------- memory ---------------------------------------------------*/

/* Each allocation of a new sim fails in turn, and no step allocates. */
static void expect_failures(const char *method) {
  const double x[9] = {0, 0, 0, 1, 0, 0, 1, 1, 0}, mass[3] = {1, 1, 1}, k[2] = {100, 100},
               rest[2] = {0.5, 0.5};
  const int32_t ij[4] = {0, 1, 1, 2};
  msim_scene *scene;
  assert_ok(msim_scene_create(failing_allocator_get(), &scene, err));
  assert_ok(msim_scene_add_particles(scene, 3, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 2, ij, k, rest, NULL, err));
  msim_options opt = single_options(method, 1e-3);
  opt.threads = 1;
  expect_creation_survives_failures(scene, &opt, 200);
  msim_scene_destroy(scene);
}

static void memory_may_run_out(void **state) {
  (void)state;
  for (int m = 0; m < 2; m++) expect_failures(both[m]);
}

/*------------------------------------- changes --------------------------------------------------*/

/* Springs, forces, pins, steps and particles of a running sim change in both precisions alike. */
static void change(msim_sim *sim, int which) {
  const msim_state now = state_of(sim);
  double k[1000], force[300] = {0}, wind[3] = {1, 2, 3};
  const int32_t some[] = {40, 41};
  const msim_edit edit = {.size = sizeof edit, .nremoved_particles = 2, .removed_particles = some};
  assert_true(now.nsprings <= 1000);
  for (int32_t e = 0; e < now.nsprings; e++) k[e] = 400;
  for (int i = 0; i < 3 * now.n; i++) force[i] = 0.01 * (i % 5);
  if (which == 0) assert_ok(msim_sim_set_springs(sim, k, NULL, NULL, err));
  if (which == 1) assert_ok(msim_sim_set_springs(sim, NULL, NULL, memset(k, 0, sizeof k), err));
  if (which == 2) assert_ok(msim_sim_set_forces(sim, force, err));
  if (which == 3) assert_ok(msim_sim_set_gravity(sim, wind, err));
  if (which == 4) assert_ok(msim_sim_set_pinned(sim, 2, some, 1, err));
  if (which == 5) assert_ok(msim_sim_set_step(sim, 5e-4, err));
  if (which == 6) assert_ok(msim_sim_edit(sim, &edit, err));
  if (which == 7) assert_ok(msim_sim_set_drag(sim, 0.3, err));
}

static void expect_changes(const char *method) {
  enum { CHANGES = 8 };
  for (int which = 0; which < CHANGES; which++) {
    msim_scene *scene = scene_of(which == 1 ? 4 : 3);
    msim_options opt = single_options(method, 1e-3);
    msim_sim *single = make_sim(scene, &opt);
    opt.precision = MSIM_PRECISION_DOUBLE;
    msim_sim *exact = make_sim(scene, &opt), *same = make_sim(scene, &opt);
    msim_sim *sims[] = {single, exact};
    for (int i = 0; i < 2; i++) {
      assert_ok(msim_sim_step(sims[i], 50, err));
      change(sims[i], which);
      assert_ok(msim_sim_step(sims[i], 100, err));
    }
    assert_ok(msim_sim_step(same, 150, err));
    const msim_state a = state_of(single), b = state_of(exact), c = state_of(same);
    assert_int_equal(a.n, b.n);
    const double off = distance(3 * a.n, a.x, b.x);
    assert_true(off > 0 && off < 1e-5);
    if (a.n == c.n) assert_true(distance(3 * a.n, c.x, b.x) > 10 * off); /* it matters */
    msim_sim_destroy(single), msim_sim_destroy(exact), msim_sim_destroy(same);
    msim_scene_destroy(scene);
  }
}

static void changes_are_followed(void **state) {
  (void)state;
  for (int m = 0; m < 2; m++) expect_changes(both[m]);
}

/*------------------------------------- refusals -------------------------------------------------*/

static void expect_refused(const msim_scene *scene, const msim_options *opt, const char *word) {
  msim_sim *sim = NULL;
  msim_error why;
  const msim_status status = msim_sim_create(scene, opt, &sim, &why);
  if (!status || sim || !strstr(why.text, word) || !strstr(why.text, "precision = double"))
    fail_msg("%s: status %d, '%s'", word, (int)status, status ? why.text : "");
}

static void unsupported_options_are_refused(void **state) {
  (void)state;
  static const char *const others[] = {"implicit-euler", "respa", "rkn6", "bdf2"};
  msim_scene *scene = scene_of(0);
  msim_options opt;
  for (int i = 0; i < 4; i++) {
    opt = single_options(others[i], 1e-3);
    expect_refused(scene, &opt, others[i]);
  }
  opt = single_options("dop853", 1e-3);
  expect_refused(scene, &opt, "dop853");
  opt = single_options("velocity-verlet", 1e-3), opt.tol = 1e-3;
  expect_refused(scene, &opt, "error control");
  opt = single_options("auto", MSIM_H_AUTO), opt.t_end = 1;
  expect_refused(scene, &opt, "'auto'");
  msim_scene_destroy(scene);
  scene = scene_of(1);
  opt = single_options(IMPLICIT, 1e-3);
  expect_refused(scene, &opt, "colliders");
  msim_scene_destroy(scene);
  scene = scene_of(0);
  plane(scene, 0, 0, 1, -9, 0, 0);
  assert_ok(msim_scene_set_planes_constrain(scene, 1, err));
  expect_refused(scene, &opt, "planes_constrain");
  msim_scene_destroy(scene);
}

static void unsupported_scenes_are_refused(void **state) {
  (void)state;
  msim_options opt = single_options("velocity-verlet", 1e-3);
  const double k = 1, heavy = 1e30, stiff = 1e20, x[3] = {9, 9, 9}, zero = 0;
  const int32_t ijk[3] = {0, 1, 2}, ij[2] = {3, 40};
  for (int i = 0; i < 4; i++) {
    static const char *const words[] = {"event", "angular", "k[", "mass["};
    msim_scene *scene = scene_of(0);
    opt.collision = i == 0 ? MSIM_COLLISION_EVENT : MSIM_COLLISION_REFLECT;
    if (i == 0) plane(scene, 0, 0, 1, -1, 0.5, 0);
    if (i == 1) assert_ok(msim_scene_add_angles(scene, 1, ijk, &k, NULL, &zero, err));
    if (i == 2) assert_ok(msim_scene_add_springs(scene, 1, ij, &stiff, NULL, NULL, err));
    if (i == 3) assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &heavy, err));
    expect_refused(scene, &opt, words[i]);
    msim_scene_destroy(scene);
  }
}

/* A change that single precision does not support is refused, and the sim continues as it was. */
static void unsupported_changes_are_refused(void **state) {
  (void)state;
  msim_scene *scene = scene_of(0);
  const msim_options opt = single_options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt), *same = make_sim(scene, &opt);
  const int32_t ijk[3] = {0, 1, 2};
  const double angle_k = 1, stiffness = 1e20;
  double k[1000];
  msim_error why;
  const msim_edit edit = {.size = sizeof edit, .nangles = 1, .ijk = ijk, .angle_k = &angle_k};
  assert_int_equal(msim_sim_edit(sim, &edit, &why), MSIM_ERR_UNSUPPORTED);
  assert_non_null(strstr(why.text, "angular"));
  for (int e = 0; e < 1000; e++) k[e] = e == 5 ? stiffness : 100;
  assert_int_equal(msim_sim_set_springs(sim, k, NULL, NULL, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "k[5]"));
  assert_ok(msim_sim_step(sim, 20, err));
  assert_ok(msim_sim_step(same, 20, err));
  expect_same(sim, same, "after refusals");
  msim_sim_destroy(sim), msim_sim_destroy(same), msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(errors_do_not_add_up),
                                     cmocka_unit_test(distance_from_the_origin_costs_nothing),
                                     cmocka_unit_test(runs_resume_to_the_bit),
                                     cmocka_unit_test(observers_and_threads_change_no_bit),
                                     cmocka_unit_test(particles_bounce),
                                     cmocka_unit_test(start_is_not_rounded),
                                     cmocka_unit_test(checkpoints_have_the_origin),
                                     cmocka_unit_test(pinned_particles_stay_exactly),
                                     cmocka_unit_test(checkpoints_of_another_precision_are_refused),
                                     cmocka_unit_test(memory_may_run_out),
                                     cmocka_unit_test(changes_are_followed),
                                     cmocka_unit_test(unsupported_options_are_refused),
                                     cmocka_unit_test(unsupported_scenes_are_refused),
                                     cmocka_unit_test(unsupported_changes_are_refused)};
  return cmocka_run_group_tests_name("precision", tests, NULL, NULL);
}
