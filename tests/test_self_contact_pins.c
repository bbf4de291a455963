/* Tests of self-contact with pinned particles that move: they give their velocity to what they
 * push, with the work of the momentum, and leave alone what cannot be pushed. */
#include "surfaces.h"

static const char *const methods[] = {"velocity-verlet", "linearly-implicit-euler",
                                      "implicit-euler", "trapezoidal"};
enum { METHODS = sizeof methods / sizeof *methods };

static msim_scene_view view_of(const msim_scene *scene) {
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(scene, &view);
  return view;
}

/* Let the first n particles, pinned, move by `displacement` in 1 s. */
static void move(msim_scene *scene, int32_t n, const double displacement[3]) {
  const msim_scene_view view = view_of(scene);
  int32_t *pinned = malloc(sizeof *pinned * (size_t)n);
  double *x = malloc(2 * sizeof *x * 3 * (size_t)n), t[2] = {0, 1};
  for (int32_t i = 0; i < n; i++) pinned[i] = i;
  for (int32_t i = 0; i < 3 * n; i++)
    x[i] = view.x[i], x[3 * n + i] = view.x[i] + displacement[i % 3];
  const msim_motion motion = {
      .size = sizeof motion, .n = n, .particles = pinned, .nt = 2, .t = t, .x = x};
  assert_ok(msim_scene_pin(scene, n, pinned, err));
  assert_ok(msim_scene_add_motion(scene, &motion, err));
  free(pinned), free(x);
}

/* A pinned sheet moves with V towards a free one at rest, and takes it with it by pressure and
 * friction. Each force acts where the pins move, so that their work is V . p, p the momentum of the
 * free sheet. rtol: of that; forces of implicit methods are solutions of iterations */
static void expect_push(const char *method, double friction, double rtol) {
  enum { SIDE = 5, N = SIDE * SIDE };
  const double V[3] = {0.2, 0, 0.5};
  msim_scene *scene = surfaces(0, friction);
  add_sheet(scene, SIDE, 100, 1, 0, 0, 0, NULL);
  add_sheet(scene, 4, 100, 0.5, 0.02, 0.01, 0.025, NULL);
  move(scene, N, V);
  const msim_options opt = options(method, 2e-3);
  msim_sim *sim = make_sim(scene, &opt);
  run_without_intersections(sim, scene, 60, 0, NULL);
  const msim_state s = state_of(sim);
  double p[3] = {0};
  for (int32_t i = 3 * N; i < 3 * s.n; i++) p[i % 3] += 0.3 / (s.n - N) * s.v[i];
  assert_true(p[2] >= 0.3 * V[2] * (1 - 1e-3));
  if (friction > 0) assert_true(p[0] > 0.5 * 0.3 * V[0]);
  assert_close(s.work / (V[0] * p[0] + V[2] * p[2]), 1, rtol);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void pins_push_with_their_work(void **state) {
  (void)state;
  for (int m = 0; m < METHODS; m++)
    for (int i = 0; i < 2; i++) expect_push(methods[m], 0.3 * i, m == 0 ? 1e-12 : 0.02);
}

/* The power of particle 0 that moves with `speed` along z, on the springs from number `first` on */
static double find_power(const msim_scene_view *view, int32_t first, const msim_state *s,
                         double speed) {
  double power = 0;
  for (int32_t e = first; e < view->nsprings; e++) {
    const double *a = s->x, *b = s->x + 3 * view->ij[2 * e + 1];
    const double length = sqrt(pow(b[0] - a[0], 2) + pow(b[1] - a[1], 2) + pow(b[2] - a[2], 2));
    power -= speed * view->k[e] * (1 - view->rest[e] / length) * (b[2] - a[2]);
  }
  return power;
}

/* A pin pushes a triangle by springs, and that another one by contact: the work of the pin is that
 * on the springs where steps end, after contact, by the trapezoidal rule of velocity Verlet. */
static void pins_work_on_springs_where_steps_end(void **state) {
  (void)state;
  const double x[3] = {0, 0, -1}, mass = 1, k[3] = {400, 400, 400}, V = 0.5, h = 1e-3;
  const double lower[9] = {1, 0, 0, 0, 1, 0, -1, -1, 0},
               upper[9] = {0.5, 0.1, 0.025, 0, 0.5, 0.025, -0.5, -0.4, 0.025};
  const double rest[3] = {0};
  const int32_t ij[6] = {0, 1, 0, 2, 0, 3};
  msim_scene *scene = surfaces(0, 0);
  assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
  add_triangle(scene, 400, lower, rest);
  add_triangle(scene, 400, upper, rest);
  const int32_t first = view_of(scene).nsprings;
  assert_ok(msim_scene_add_springs(scene, 3, ij, k, NULL, NULL, err));
  move(scene, 1, (const double[3]){0, 0, V});
  const msim_scene_view view = view_of(scene);
  const msim_options opt = options("velocity-verlet", h);
  msim_sim *sim = make_sim(scene, &opt);
  double work = 0;
  for (int i = 0; i < 200; i++) {
    msim_state s = state_of(sim);
    work += h / 2 * find_power(&view, first, &s, V);
    assert_ok(msim_sim_step(sim, 1, err));
    s = state_of(sim);
    work += h / 2 * find_power(&view, first, &s, V);
  }
  assert_true(stats_of(sim).contacts > 5 && work > 0.1);
  assert_close(state_of(sim).work, work, 1e-12);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* The lower end of a pinned rope comes near a pinned corner of a triangle, whose free corners have
 * the weight 5e-4 at the nearest point: these stay where they are. */
static void what_cannot_be_pushed_apart_stays(void **state) {
  (void)state;
  for (int m = 0; m < METHODS; m++) {
    msim_scene *scene = surfaces(0, 0);
    const double x[6] = {5e-4, 5e-4, 0.025, 5e-4, 5e-4, 1}, mass[2] = {1, 1}, k = 100;
    const double triangle[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0}, rest[3] = {0};
    const int32_t ij[2] = {0, 1}, corner = 2;
    assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, NULL, NULL, err));
    add_triangle(scene, 100, triangle, rest);
    assert_ok(msim_scene_pin(scene, 1, &corner, err));
    move(scene, 2, (const double[3]){0, 0, -0.5});
    const msim_options opt = options(methods[m], 1e-3);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 40, err));
    const msim_state s = state_of(sim);
    for (int i = 0; i < 9; i++) assert_true(s.x[6 + i] == triangle[i]);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(pins_push_with_their_work),
                                     cmocka_unit_test(pins_work_on_springs_where_steps_end),
                                     cmocka_unit_test(what_cannot_be_pushed_apart_stays)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
