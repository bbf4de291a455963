/* Tests of lagged factorizations with solver = auto, by its internal state: when they are used and
 * renewed, and that solutions with them are checked. */
#include <math.h>
#include <string.h>

#include "linear/solver.h"
#include "scenes.h"
#include "sim/sim.h"

/* A cube that hardly deforms: a stiff one is factored by cholmod, a soft one solved by pcg until
 * the iterations have cost as much as a factorization. */
static msim_sim *block(double k, ms_solver **solver) {
  msim_scene *scene = pinned_block(5, 1, k, 0);
  msim_options opt = options("linearly-implicit-euler", 1e-2);
  opt.solver_rtol = 1e-10;
  msim_sim *sim = make_sim(scene, &opt);
  *solver = sim->islands->stepper.solver;
  msim_scene_destroy(scene);
  return sim;
}

static msim_sim *factored(ms_solver **solver) {
  msim_sim *sim = block(1e8, solver);
  assert_ptr_equal((*solver)->lagged_factor.factorizer,
                   (*solver)->linear); /* otherwise these tests are void */
  return sim;
}

/* Iterations of the next step */
static int64_t step(msim_sim *sim) {
  const int64_t before = stats_of(sim).iterations;
  assert_ok(msim_sim_step(sim, 1, err));
  return stats_of(sim).iterations - before;
}

/* The backend of the solver with other operations, to replace the lagged factorization */
static ms_linear replaced(ms_solver *solver, const ms_linear_ops *ops) {
  ms_linear by = *solver->linear;
  by.ops = ops;
  return by;
}

static msim_status copy(ms_linear *self, const ms_linear_target *target, const double *b, double *y,
                        int64_t *iterations, msim_error *err) {
  (void)target, (void)iterations, (void)err;
  ms_vector_copy(self->system->model->shape, b, y);
  return MSIM_OK;
}

/* A backend that also overwrites the residual with 0, which the recurrence would then accept. */
static msim_status spoil(ms_linear *self, const ms_linear_target *target, const double *b,
                         double *y, int64_t *iterations, msim_error *err) {
  const ms_shape shape = self->system->model->shape;
  copy(self, target, b, y, iterations, err);
  memset((double *)(uintptr_t)b, 0, (size_t)shape.dims * (size_t)shape.stride * sizeof *b);
  return MSIM_OK;
}

/* The factorization counts as 30 iterations. After n steps with it, of `sum` iterations in all, the
 * next one may take (30 + sum)/(n + 1), the mean if it took none; then the factorization is
 * renewed. */
static void a_factor_is_renewed_where_it_costs_more_than_the_mean(void **state) {
  (void)state;
  static const ms_linear_ops ops = {.solve = copy};
  static const int lasts[] = {1, 2, 5, 10};
  require(is_solver_available("cholmod"), "the solver cholmod");
  for (int i = 0; i < 4; i++) {
    ms_solver *solver;
    int64_t sum = 0;
    msim_sim *sim = factored(&solver);
    solver->lagged_factor.factorizer->flops =
        30 * MS_SOLVE_FLOPS_PER_NONZERO * solver->lagged_factor.factorizer->fill;
    for (int n = 0; n < lasts[i]; n++) sum += step(sim);
    assert_int_equal(stats_of(sim).factorizations, 1);
    ms_linear useless = replaced(solver, &ops);
    solver->lagged_factor.factorizer = &useless;
    assert_int_equal(step(sim), (30 + sum) / (lasts[i] + 1));
    assert_int_equal(stats_of(sim).factorizations, 2);
    msim_sim_destroy(sim);
  }
}

/* A factorization that does not help in the very next step is tried again after 1, 3, 7, ... 63
 * more. */
static void a_useless_factorization_is_tried_rarely(void **state) {
  (void)state;
  require(is_solver_available("cholmod"), "the solver cholmod");
  ms_solver *solver;
  msim_sim *sim = factored(&solver);
  sim->config.opt.solver_rtol = 1e-300; /* out of reach: the maximum of iterations is made */
  for (int n = 1, next = 2, wait = 1; n <= 200; n++) {
    const int64_t iterations = step(sim);
    assert_true((iterations > 0) == (n == next));
    if (n == next) next += wait + 1, wait = wait < 63 ? 2 * wait + 1 : 63;
  }
  assert_int_equal(stats_of(sim).factorizations, 200);
  msim_sim_destroy(sim);
}

static void solutions_by_lagged_factors_are_checked(void **state) {
  (void)state;
  static const ms_linear_ops ops = {.solve = spoil};
  require(is_solver_available("cholmod"), "the solver cholmod");
  ms_solver *solver, *other;
  msim_sim *sim = factored(&solver), *fresh = factored(&other);
  assert_ok(msim_sim_step(sim, 3, err));
  assert_ok(msim_sim_step(fresh, 3, err));
  ms_linear faulty = replaced(solver, &ops);
  solver->lagged_factor.factorizer = &faulty;
  ms_lagged_factor_discard(&other->lagged_factor);
  assert_ok(msim_sim_step(sim, 1, err));
  assert_ok(msim_sim_step(fresh, 1, err));
  const msim_state a = state_of(sim), b = state_of(fresh);
  assert_memory_equal(a.v, b.v, 3 * (size_t)a.n * sizeof *a.v);
  assert_int_equal(stats_of(sim).factorizations, 2);
  msim_sim_destroy(sim), msim_sim_destroy(fresh);
}

/* A factorization computed to replace pcg is given up once it does not help: pcg makes eight steps
 * before the next. */
static void a_useless_factorization_is_given_up(void **state) {
  (void)state;
  enum { ENOUGH = 8, EXPENSIVE = 30 };
  require(is_solver_available("cholmod"), "the solver cholmod");
  ms_solver *solver;
  msim_sim *sim = block(1e5, &solver);
  for (int n = 0; n < ENOUGH; n++) assert_true(step(sim) > EXPENSIVE);
  assert_int_equal(stats_of(sim).factorizations, 1);
  assert_true(step(sim) < EXPENSIVE);
  const double limit = solver->lagged_factor.limit;
  solver->lagged_factor.limit = 1;
  for (int n = 0; n < ENOUGH; n++) {
    assert_true(step(sim) > EXPENSIVE);
    if (n == 0) solver->lagged_factor.limit = limit;
    assert_int_equal(stats_of(sim).factorizations, n == ENOUGH - 1 ? 2 : 1);
  }
  assert_true(step(sim) < EXPENSIVE);
  msim_sim_destroy(sim);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_factor_is_renewed_where_it_costs_more_than_the_mean),
      cmocka_unit_test(a_useless_factorization_is_tried_rarely),
      cmocka_unit_test(solutions_by_lagged_factors_are_checked),
      cmocka_unit_test(a_useless_factorization_is_given_up)};
  return cmocka_run_group_tests_name("lagged_factor", tests, NULL, NULL);
}
