/* Truncated conjugate gradients: as far as the radius, or as a valley reaches, and always down. */
#include "two_level.h"

enum { SIDE = 14, N = SIDE * SIDE };

/* A cloth thrown about at random: most of its springs are compressed or stretched. */
static msim_sim *crumpled(const msim_scene *scene, int32_t aggregate) {
  const msim_options opt = frames();
  msim_sim *sim = make_two_level(scene, &opt, aggregate);
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(scene, &view);
  double x[3 * N], v[3 * N] = {0};
  unsigned seed = 3;
  for (int i = 0; i < 3 * N; i++)
    x[i] = view.x[i] + (view.pinned[i / 3] ? 0 : 0.3 * (uniform(&seed) - 0.5));
  assert_ok(msim_sim_set_state(
      sim, &(msim_state){.size = sizeof(msim_state), .n = N, .x = x, .v = v}, err));
  return sim;
}

/* A right side, and where the answer goes. */
typedef struct problem {
  msim_sim *sim;
  ms_solver *solver;
  ms_shape shape;
  double *b, *y, *Ay;
} problem;

static problem pose(const msim_scene *scene, int32_t aggregate) {
  problem p = {.sim = crumpled(scene, aggregate)};
  const ms_stepper *s = &p.sim->motion->stepper;
  p.solver = s->solver, p.shape = s->model->shape;
  p.b = s->work[0], p.y = s->v_next, p.Ay = s->work[1];
  unsigned seed = 8;
  for (int32_t c = 0; c < p.shape.dims; c++)
    for (int32_t r = 0; r < p.shape.n; r++) p.b[c * p.shape.stride + r] = uniform(&seed) - 0.5;
  return p;
}

static ms_descent descend(const problem *p, int clamp, double rtol, double radius) {
  const ms_request request = {
      .x = p->sim->motion->stepper.x, .h = 1. / 60, .clamp = clamp, .indefinite = -1, .rtol = rtol};
  ms_descent d = {.rtol = rtol, .radius = radius};
  assert_ok(ms_solver_descend(p->solver, &request, p->b, &d, p->y, err));
  return d;
}

/* What y takes off y.A y/2 - b.y: the recurrence has promised it. */
static void assert_promise(const problem *p, const ms_descent *d) {
  ms_coefficients_apply(p->sim->motion->stepper.model, &p->solver->system.a, p->y, p->Ay);
  const double drop = ms_dot(p->shape, p->b, p->y) - ms_dot(p->shape, p->y, p->Ay) / 2;
  assert_true(drop > 0);
  assert_close(d->promise / drop, 1, 1e-5);
}

static void a_free_descent_is_a_solve(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 1000, 0);
  for (int32_t aggregate = 0; aggregate <= 16; aggregate += 16) {
    const problem p = pose(scene, aggregate);
    const ms_descent d = descend(&p, 1, 1e-7, INFINITY);
    assert_int_equal(d.is_cut, 0);
    assert_promise(&p, &d);
    ms_axpy(p.shape, -1, p.b, p.Ay);
    assert_true(ms_dot(p.shape, p.Ay, p.Ay) < 1e-10 * ms_dot(p.shape, p.b, p.b));
    msim_sim_destroy(p.sim);
  }
  msim_scene_destroy(scene);
}

static void a_descent_ends_at_the_radius(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 1000, 0);
  for (int32_t aggregate = 0; aggregate <= 16; aggregate += 16) {
    const problem p = pose(scene, aggregate);
    const ms_descent whole = descend(&p, 1, 1e-7, INFINITY);
    double promise = whole.promise;
    for (double radius = 0.9 * whole.length; radius > 1e-3 * whole.length; radius /= 3) {
      const ms_descent d = descend(&p, 1, 1e-7, radius);
      assert_int_equal(d.is_cut, 1);
      assert_int_equal(d.is_curved, 0);
      assert_close(d.length / radius, 1, 1e-12);
      assert_promise(&p, &d);
      assert_true(d.promise < promise);
      promise = d.promise;
    }
    msim_sim_destroy(p.sim);
  }
  msim_scene_destroy(scene);
}

/* With or without a radius it leads down, where the exact matrix is far from positive definite. */
static void negative_curvature_is_followed_downhill(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 1e5, 0);
  const problem p = pose(scene, 16);
  const ms_descent free = descend(&p, 0, 1e-7, INFINITY);
  assert_int_equal(free.is_curved, 1);
  assert_true(ms_dot(p.shape, p.b, p.y) > 0);
  const ms_descent bounded = descend(&p, 0, 1e-7, 100 * free.length);
  assert_int_equal(bounded.is_curved, 1);
  assert_close(bounded.length / free.length, 100, 1e-10);
  assert_promise(&p, &bounded);
  msim_sim_destroy(p.sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_free_descent_is_a_solve),
                                     cmocka_unit_test(a_descent_ends_at_the_radius),
                                     cmocka_unit_test(negative_curvature_is_followed_downhill)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
