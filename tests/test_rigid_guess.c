/* Tests of the initial guess of Newton's method: a body that turns and falls as a rigid one is
 * guessed exactly, and what holds or touches it is left alone. */
#include "integrate/rigid_guess.h"
#include "scenes.h"
#include "sim/sim.h"

enum { SIDE = 4, N = SIDE * SIDE * SIDE };
static const double H = 0.01;

/* A box of 4 kg with sides of 1, 2 and 3 m */
static msim_scene *make_box(double drag, int32_t npinned) {
  const double g[3] = {1, 2, -9.81};
  const msim_lattice lattice = {.size = sizeof lattice,
                                .n = {SIDE, SIDE, SIDE},
                                .extent = {1, 2, 3},
                                .mass = 4,
                                .k = 1000,
                                .npinned = npinned,
                                .pinned = (const int32_t[]){0}};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  assert_ok(msim_scene_set_drag(scene, drag, err));
  return scene;
}

/* Rodrigues' formula, by the angle about the unit vector u */
static void turn(const double u[3], double angle, const double x[3], double to[3]) {
  const double c = cos(angle), s = sin(angle), along = u[0] * x[0] + u[1] * x[1] + u[2] * x[2];
  for (int i = 0; i < 3; i++) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    to[i] = c * x[i] + s * (u[j] * x[k] - u[k] * x[j]) + (1 - c) * along * u[i];
  }
}

static const double start_velocity[3] = {3, -1, 2};

/* The angle by which implicit Euler, of steps of length H, continues a rotation by `angle` about a
 * principal axis of a body that also grows across it, by the factors 1/(1 - growth) and 1 + growth:
 * from sum x' x (x' - 2 x + y) = 0 follows 2 sin a' = (1 - growth) sin(a + a'). */
static double find_next_angle(double angle, double growth) {
  double low = 0, high = angle;
  for (int i = 0; i < 60; i++) {
    const double a = (low + high) / 2;
    if (2 * sin(a) < (1 - growth) * sin(angle + a)) low = a;
    else high = a;
  }
  return low;
}

/* The chords of a rotation by `angle` and then by `next_angle`, in steps of length H, about the
 * centre of the box with growth across the axis, and a translation */
static void find_chords(const msim_scene *scene, const double axis[3], double angle, double growth,
                        double next_angle, double *before, double *after) {
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(scene, &view);
  for (int i = 0; i < N; i++) {
    double x[3], smaller[3], larger[3], last[3], next[3], along = 0;
    for (int c = 0; c < 3; c++) x[c] = view.x[3 * i + c] - (c + 1) / 2., along += x[c] * axis[c];
    for (int c = 0; c < 3; c++) {
      smaller[c] = x[c] - growth * (x[c] - along * axis[c]);
      larger[c] = x[c] + growth * (x[c] - along * axis[c]);
    }
    turn(axis, -angle, smaller, last);
    turn(axis, next_angle, larger, next);
    for (int c = 0; c < 3; c++) {
      before[3 * i + c] = start_velocity[c] + (x[c] - last[c]) / H;
      after[3 * i + c] = start_velocity[c] + (next[c] - x[c]) / H;
    }
  }
}

/* The guess from `before` for a stage of coefficient ah, with w = share v */
static void guess(const msim_scene *scene, const double *before, double ah, double share,
                  double *result) {
  msim_scene_view view = {.size = sizeof view};
  msim_options opt;
  msim_sim *sim;
  msim_options_init(&opt, sizeof opt);
  opt.integrator = "implicit-euler", opt.h = H;
  msim_scene_get(scene, &view);
  assert_ok(msim_sim_create(scene, &opt, &sim, err));
  assert_ok(msim_sim_set_state(
      sim, &(msim_state){.size = sizeof(msim_state), .n = N, .x = view.x, .v = before}, err));
  ms_stepper *s = &sim->islands->stepper;
  ms_vector_copy(s->model->shape, s->v, s->v_next);
  ms_vector_copy(s->model->shape, s->v, s->work[0]);
  ms_vector_scale(s->model->shape, share, s->work[0]);
  ms_rigid_guess_advance(s, H,
                         &(ms_newton_stage){.ah = ah, .x0 = s->x, .w = s->work[0], .v = s->v_next});
  memcpy(result, before, 3 * N * sizeof *result);
  ms_unknowns_scatter(&s->model->unknowns, s->v_next, result);
  msim_sim_destroy(sim);
}

/* The largest error of the guess from `before` against `after` plus `change` */
static double find_error(const msim_scene *scene, const double *before, const double *after,
                         const double change[3]) {
  double result[3 * N], error = 0;
  guess(scene, before, H, 1, result);
  for (int i = 0; i < 3 * N; i++) {
    assert_true(isfinite(result[i]));
    error = fmax(error, fabs(result[i] - after[i] - change[i % 3]));
  }
  return error;
}

static void rotation_about_a_principal_axis_is_exact(void **state) {
  (void)state;
  const double axes[2][3] = {{1, 0, 0}, {0, 0, -1}}, growth[] = {0, 0.3}; /* of the angle */
  const double change[3] = {H * 1, H * 2, H * -9.81};
  double before[3 * N], after[3 * N];
  msim_scene *scene = make_box(0, 0);
  for (int k = 0; k < 4; k++)
    for (double angle = 0.0017; angle < 1.5; angle *= 3) {
      const double grows = fmin(angle * growth[k % 2], 0.05), next = find_next_angle(angle, grows);
      find_chords(scene, axes[k / 2], angle, grows, next, before, after);
      assert_true(find_error(scene, before, after, change) * H < 1e-13);
    }
  msim_scene_destroy(scene);
}

/* The momentum and its moment about the centre of mass that the stage x' = x + ah v', w = share v
 * leaves over beside springs, with drag b, relative to the sum of their parts */
static double find_imbalance(const msim_scene *scene, double b, const double *before, double ah,
                             double share, const double *after) {
  const double g[3] = {1, 2, -9.81};
  msim_scene_view view = {.size = sizeof view};
  double centre[3] = {0}, momentum[3] = {0}, moment[3] = {0}, parts[2] = {0}, error = 0;
  msim_scene_get(scene, &view);
  for (int i = 0; i < 3 * N; i++) centre[i % 3] += (view.x[i] + ah * after[i]) / N;
  for (int i = 0; i < N; i++) {
    const double m = view.mass[i];
    double r[3], f[3];
    for (int c = 0; c < 3; c++) {
      const int at = 3 * i + c;
      r[c] = view.x[at] + ah * after[at] - centre[c];
      f[c] =
          m * (after[at] - share * before[at] - ah * g[c]) + ah * (b * after[at] - view.force[at]);
      momentum[c] += f[c], parts[0] += fabs(f[c]);
    }
    for (int c = 0; c < 3; c++) {
      const int j = (c + 1) % 3, k = (c + 2) % 3;
      moment[c] += r[j] * f[k] - r[k] * f[j];
      parts[1] += fabs(r[j] * f[k]) + fabs(r[k] * f[j]);
    }
  }
  for (int c = 0; c < 3; c++)
    error = fmax(error, fmax(fabs(momentum[c]) / parts[0], fabs(moment[c]) / parts[1]));
  return error;
}

/* The largest relative change of the distance from particle 0 in the time ah */
static double find_strain(const msim_scene *scene, double ah, const double *v) {
  msim_scene_view view = {.size = sizeof view};
  double strain = 0;
  msim_scene_get(scene, &view);
  for (int i = 1; i < N; i++) {
    double now = 0, then = 0;
    for (int c = 0; c < 3; c++) {
      const double apart = view.x[3 * i + c] - view.x[c], change = ah * (v[3 * i + c] - v[c]);
      now += (apart + change) * (apart + change), then += apart * apart;
    }
    strain = fmax(strain, fabs(sqrt(now / then) - 1));
  }
  return strain;
}

/* About any axis, with drag and constant forces, momenta are balanced; implicit Euler keeps
 * distances. */
static void momenta_are_balanced(void **state) {
  (void)state;
  const double axis[3] = {0.48, 0.6, 0.64}, b = 0.7;
  double before[3 * N], after[3 * N], force[3 * N] = {[3] = 6, [70] = -3};
  msim_scene *scene = make_box(b, 0);
  assert_ok(msim_scene_set_forces(scene, force, err));
  for (double angle = 0.001; angle < 1; angle *= 3) {
    find_chords(scene, axis, angle, 0, angle, before, after);
    guess(scene, before, H, 1, after);
    assert_true(find_imbalance(scene, b, before, H, 1, after) < 1e-12);
    assert_true(find_strain(scene, H, after) < 1e-12);
    guess(scene, before, H / 2, 0.9, after);
    assert_true(find_imbalance(scene, b, before, H / 2, 0.9, after) < 1e-12);
  }
  msim_scene_destroy(scene);
}

/* Past a quarter of a turn, and for velocities that are no rotation, only gravity changes them. */
static void other_motions_only_fall(void **state) {
  (void)state;
  const double change[3] = {H * 1, H * 2, H * -9.81};
  double before[3 * N], after[3 * N];
  msim_scene *scene = make_box(0, 0);
  for (int kind = 0; kind < 2; kind++) {
    unsigned seed = 5;
    for (int i = 0; i < 3 * N; i++) before[i] = uniform(&seed) - 0.5;
    if (kind) find_chords(scene, (double[]){0, 0, 1}, 1.7, 0, 0, before, after);
    assert_true(find_error(scene, before, before, change) < 1e-11);
  }
  msim_scene_destroy(scene);
}

/* (M + h n b) V' = M V + h M g */
static void drag_slows_the_fall(void **state) {
  (void)state;
  const double b = 0.7, g[3] = {1, 2, -9.81};
  double before[3 * N], change[3];
  msim_scene *scene = make_box(b, 0);
  for (int i = 0; i < 3 * N; i++) before[i] = start_velocity[i % 3];
  for (int c = 0; c < 3; c++)
    change[c] = (4 * start_velocity[c] + H * 4 * g[c]) / (4 + H * N * b) - start_velocity[c];
  assert_true(find_error(scene, before, before, change) < 1e-13);
  msim_scene_destroy(scene);
}

/* N particles on an oblique line, with springs between neighbours or without, that turn about the
 * middle: the moments of inertia are singular. */
static msim_scene *make_line(int springs, double v[3 * N]) {
  double x[3 * N], mass[N], k[N];
  int32_t ij[2 * N];
  msim_scene *scene;
  for (int i = 0; i < N; i++) {
    const double at = (i - (N - 1) / 2.) / N;
    memcpy(x + 3 * i, (const double[]){0.1 * at, 0.7 * at, 1.3 * at}, 3 * sizeof *x);
    memcpy(v + 3 * i, (const double[]){1.4 * at, -0.2 * at, 0}, 3 * sizeof *v);
    mass[i] = 0.1, k[i] = 10, ij[2 * i] = i, ij[2 * i + 1] = i + 1;
  }
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, N, x, v, mass, err));
  if (springs) assert_ok(msim_scene_add_springs(scene, N - 1, ij, k, NULL, NULL, err));
  return scene;
}

static void lines_and_loose_particles_keep_their_velocities(void **state) {
  (void)state;
  const double none[3] = {0};
  double v[3 * N];
  for (int springs = 0; springs < 2; springs++) {
    msim_scene *scene = make_line(springs, v);
    assert_true(find_error(scene, v, v, none) < 1e-15);
    msim_scene_destroy(scene);
  }
}

static void constant_forces_count(void **state) {
  (void)state;
  const double change[3] = {H * (1 + 6. / 4), H * 2, H * -9.81};
  double before[3 * N], force[3 * N] = {[3] = 6};
  msim_scene *scene = make_box(0, 0);
  for (int i = 0; i < 3 * N; i++) before[i] = start_velocity[i % 3];
  assert_ok(msim_scene_set_forces(scene, force, err));
  assert_true(find_error(scene, before, before, change) < 1e-13);
  msim_scene_destroy(scene);
}

static void pinned_bodies_are_left_alone(void **state) {
  (void)state;
  const double axis[3] = {0, 0, 1}, none[3] = {0};
  double before[3 * N], after[3 * N];
  msim_scene *scene = make_box(0, 1);
  find_chords(scene, axis, 0.1, 0, 0.1, before, after);
  before[0] = before[1] = before[2] = 0;
  assert_true(find_error(scene, before, before, none) == 0);
  msim_scene_destroy(scene);
}

/* Iterations of conjugate gradients in 20 steps of a free box: 840 and 868 from v itself */
static int64_t count_iterations(const double axis[3], double angle) {
  double before[3 * N], after[3 * N];
  msim_scene_view view = {.size = sizeof view};
  msim_stats stats = {.size = sizeof stats};
  msim_options opt;
  msim_sim *sim;
  msim_scene *scene = make_box(0, 0);
  msim_options_init(&opt, sizeof opt);
  opt.integrator = "implicit-euler", opt.h = H, opt.solver = "pcg";
  find_chords(scene, axis, angle, 0, angle, before, after);
  msim_scene_get(scene, &view);
  assert_ok(msim_sim_create(scene, &opt, &sim, err));
  assert_ok(msim_sim_set_state(
      sim, &(msim_state){.size = sizeof(msim_state), .n = N, .x = view.x, .v = before}, err));
  assert_ok(msim_sim_step(sim, 20, err));
  assert_ok(msim_sim_stats(sim, &stats));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return stats.iterations;
}

static void free_motion_takes_few_iterations(void **state) {
  (void)state;
  const int64_t falls = count_iterations((double[3]){0, 0, 1}, 0);
  const int64_t turns = count_iterations((double[3]){0, 0, 1}, 0.02);
  assert_true(falls <= 60);
  assert_true(turns <= 480);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(rotation_about_a_principal_axis_is_exact),
      cmocka_unit_test(momenta_are_balanced),
      cmocka_unit_test(other_motions_only_fall),
      cmocka_unit_test(drag_slows_the_fall),
      cmocka_unit_test(lines_and_loose_particles_keep_their_velocities),
      cmocka_unit_test(constant_forces_count),
      cmocka_unit_test(pinned_bodies_are_left_alone),
      cmocka_unit_test(free_motion_takes_few_iterations)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
