/* Tests of conjugate gradients on matrices that may be indefinite: the result is always a descent
 * direction. */
#include <stdlib.h>

#include "two_level.h"

enum { SIDE = 14, N = SIDE * SIDE };

/* A randomly displaced cloth: most of its springs are compressed or stretched. */
static msim_sim *crumpled(const msim_scene *scene, int32_t aggregate) {
  const msim_options opt = two_level_options();
  msim_sim *sim = make_two_level_sim(scene, &opt, aggregate);
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

/* A right-hand side b and its solution y. */
typedef struct problem {
  msim_sim *sim;
  ms_solver *solver;
  ms_shape shape;
  double *b, *y, *Ay;
} problem;

static problem pose(const msim_scene *scene, int32_t aggregate) {
  problem p = {.sim = crumpled(scene, aggregate)};
  const ms_stepper *s = &p.sim->islands->stepper;
  p.solver = s->solver, p.shape = s->model->shape;
  p.b = s->v, p.y = s->v_next, p.Ay = s->scratch; /* no step follows */
  assert_ok(ms_solver_prepare_descent(p.solver, err));
  unsigned seed = 8;
  for (int32_t c = 0; c < p.shape.dims; c++)
    for (int32_t r = 0; r < p.shape.n; r++) p.b[c * p.shape.stride + r] = uniform(&seed) - 0.5;
  return p;
}

static void descend(const problem *p, int clamp, double rtol) {
  const ms_linear_system_spec request = {.x = p->sim->islands->stepper.x,
                                         .h = 1. / 60,
                                         .clamp = clamp,
                                         .indefinite = -1,
                                         .rtol = rtol};
  assert_ok(ms_solver_descend(p->solver, &request, p->b, p->y, err));
  assert_true(ms_vector_dot(p->shape, p->b, p->y) > 0);
}

/* y.A y with A exact, or clamped */
static double curvature(const problem *p) {
  ms_coefficients_apply(p->sim->islands->stepper.model, &p->solver->system.a, p->y, p->Ay);
  return ms_vector_dot(p->shape, p->y, p->Ay);
}

static double left_of(const problem *p) {
  ms_coefficients_apply(p->sim->islands->stepper.model, &p->solver->system.a, p->y, p->Ay);
  ms_vector_axpy(p->shape, -1, p->b, p->Ay);
  return sqrt(ms_vector_dot(p->shape, p->Ay, p->Ay) / ms_vector_dot(p->shape, p->b, p->b));
}

static void a_clamped_descent_is_a_solve(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 1000, 0);
  for (int32_t aggregate = 0; aggregate <= 16; aggregate += 16) {
    const problem p = pose(scene, aggregate);
    descend(&p, 1, 1e-7);
    assert_true(left_of(&p) < 1e-5);
    msim_sim_destroy(p.sim);
  }
  msim_scene_destroy(scene);
}

/* With a coarse space and a rough tolerance r, p and q are floats, whatever the size of b: y is
 * scaled exactly by powers of 2. */
static void floats_serve_where_little_is_required(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 1000, 0);
  const problem p = pose(scene, 16);
  const ms_pcg *pcg = pcg_of(p.sim);
  descend(&p, 1, 0.99e-5);
  assert_int_equal(pcg->single, 0);
  descend(&p, 1, 1e-5);
  assert_int_equal(pcg->single, 1);
  assert_true(left_of(&p) < 1e-3);
  const double y = ms_vector_dot(p.shape, p.y, p.y);
  assert_true(y > 0);
  for (int exponent = -400; exponent <= 400; exponent += 800) {
    ms_vector_scale(p.shape, ldexp(1, exponent), p.b);
    descend(&p, 1, 1e-5);
    assert_true(ms_vector_dot(p.shape, p.y, p.y) == ldexp(y, 2 * exponent));
    ms_vector_scale(p.shape, ldexp(1, -exponent), p.b);
  }
  msim_sim_destroy(p.sim);
  msim_scene_destroy(scene);
}

static void floats_do_not_serve_beside_little_inertia(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 1e9, 0);
  const problem p = pose(scene, 16);
  descend(&p, 1, 0.1);
  assert_int_equal(pcg_of(p.sim)->single, 0);
  msim_sim_destroy(p.sim);
  msim_scene_destroy(scene);
}

/* Nothing is removed from a positive definite matrix, even if springs are compressed. */
static void a_definite_matrix_stays_whole(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 0.3, 0);
  for (int32_t aggregate = 0; aggregate <= 16; aggregate += 16) {
    const problem p = pose(scene, aggregate);
    descend(&p, 1, 1e-7);
    descend(&p, 0, 1e-7);
    assert_true(left_of(&p) < 1e-5);
    msim_sim_destroy(p.sim);
  }
  msim_scene_destroy(scene);
}

/* From an exact matrix far from positive definite only the indefinite part is removed: the result
 * is a descent direction, and not that of the clamped matrix. Nearly the same is found with
 * floats. */
static void an_indefinite_matrix_leads_downhill(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 1e5, 0);
  for (int32_t aggregate = 0; aggregate <= 16; aggregate += 16) {
    const problem p = pose(scene, aggregate);
    descend(&p, 1, 1e-7);
    const double clamped = ms_vector_dot(p.shape, p.b, p.y);
    assert_true(curvature(&p) > 0);
    for (int i = 0; i < 4; i++) descend(&p, 0, 1e-7);
    assert_true(ms_vector_dot(p.shape, p.b, p.y) > clamped);
    assert_true(curvature(&p) < ms_vector_dot(p.shape, p.b, p.y));
    const double fine = ms_vector_dot(p.shape, p.b, p.y);
    descend(&p, 0, 1e-5);
    assert_int_equal(pcg_of(p.sim)->single, aggregate > 0);
    assert_true(fabs(ms_vector_dot(p.shape, p.b, p.y) - fine) < 0.01 * fine);
    msim_sim_destroy(p.sim);
  }
  msim_scene_destroy(scene);
}

/* The bits do not depend on threads, and both half-edges of a spring have the same part removed. */
static void half_edges_agree(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 1e5, 0);
  const problem p = pose(scene, 16);
  const ms_half_edges *half_edges = &p.sim->islands->stepper.model->half_edges;
  const ms_pcg *pcg = pcg_of(p.sim);
  float *first = calloc((size_t)p.sim->islands->stepper.model->springs.n, sizeof *first);
  int64_t differ = 0, partial = 0;
  descend(&p, 1, 1e-7);
  descend(&p, 0, 1e-7);
  for (int twin = 0; twin < 2; twin++)
    for (int32_t at = 0; at < MS_SLICE * half_edges->nentries; at++) {
      const int32_t spring = half_edges->spring[at];
      if (spring < 0) continue;
      const float left_out = pcg->compression.reduction[at];
      if (!twin) first[spring] = left_out;
      else differ += first[spring] != left_out;
      partial += left_out > 0.2f;
    }
  assert_int_equal(differ, 0);
  assert_true(partial > 0 && partial < MS_SLICE * half_edges->nentries);
  free(first);
  msim_sim_destroy(p.sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_clamped_descent_is_a_solve),
                                     cmocka_unit_test(floats_serve_where_little_is_required),
                                     cmocka_unit_test(floats_do_not_serve_beside_little_inertia),
                                     cmocka_unit_test(a_definite_matrix_stays_whole),
                                     cmocka_unit_test(an_indefinite_matrix_leads_downhill),
                                     cmocka_unit_test(half_edges_agree)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
