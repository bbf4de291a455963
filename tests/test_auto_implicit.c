/* Tests that integrator = auto chooses tr-bdf2 if and only if the whole run costs at most a fifth
 * of the best explicit method. */
#include <math.h>

#include "auto_scenes.h"
#include "msim/backend.h"
#include "choose/pilot_run.h"
#include "choose/rejection_reasons.h"

enum { IMPLICIT = MS_CANDIDATES - 1 };

/* Two stiff springs with strong dampers */
static msim_scene *wire(double k) { return swinging_rope(3, k, 1e4); }

static msim_sim *planned(const msim_scene *scene, const char *method, double tol) {
  msim_options opt;
  msim_options_init(&opt, sizeof opt);
  opt.integrator = method, opt.tol = tol, opt.t_end = 0.4, opt.solver = "pcg";
  return make_sim(scene, &opt);
}

/* The cost of the run by tr-bdf2 */
static double implicit_cost(const msim_scene *scene, double tol) {
  msim_sim *sim = planned(scene, "tr-bdf2", tol);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  const double cost = ms_pilot_run_count_work(sim);
  msim_sim_destroy(sim);
  return cost;
}

/* The least cost of the explicit methods for the same run */
static double explicit_cost(const msim_sim *sim) {
  double least = INFINITY;
  for (int i = 0; i < IMPLICIT; i++)
    least = fmin(least, sim->config.choice.candidates[i].cost_rate);
  return least * sim->config.plan.t_end;
}

static void a_fifth_of_the_cost_decides(void **state) {
  (void)state;
  static const struct {
    double k, tol;
    int is_chosen;
  } row[] = {{1e9, 4e-4, 1}, {5e9, 1e-4, 1}, {1e9, 7e-5, 0}, {1e9, 5e-5, 0}};
  for (size_t i = 0; i < sizeof row / sizeof *row; i++) {
    msim_scene *scene = wire(row[i].k);
    msim_sim *sim = planned(scene, "auto", row[i].tol);
    const ms_candidate *implicit = &sim->config.choice.candidates[IMPLICIT];
    const double share = implicit_cost(scene, row[i].tol) / explicit_cost(sim);
    print_message("  k = %g, tol = %g: %.3f of the cost\n", row[i].k, row[i].tol, share);
    assert_true(row[i].is_chosen ? share < 0.19 : share > 0.21 && share < 0.5);
    assert_int_equal(sim->config.choice.best == IMPLICIT, row[i].is_chosen);
    assert_int_equal(implicit->rejection,
                     row[i].is_chosen ? MS_REASON_NONE : MS_REASON_RUN_NOT_FINISHED);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* cholmod, until the number of factorizations is used up */
static const msim_backend *cholmod;
static int factors_left;

static msim_status failing_factor(void *self, const msim_system *A, int32_t kind,
                                  msim_solve_info *info) {
  return factors_left-- > 0 ? cholmod->factor(self, A, kind, info) : MSIM_ERR_BACKEND;
}

/* A failure of the solver in the pilot run of tr-bdf2, in its first step or later, is reported to
 * the user. */
static void a_failure_of_the_solver_is_reported(void **state) {
  (void)state;
  require(is_solver_available("cholmod"), "the solver cholmod");
  assert_ok(msim_solver_backend("cholmod", NULL, &cholmod, err));
  msim_backend table = *cholmod;
  table.name = "failing", table.factor = failing_factor;
  const msim_backend *const backends[] = {&table, NULL};
  msim_scene *scene = wire(1e9);
  msim_options opt;
  msim_options_init(&opt, sizeof opt);
  opt.integrator = "auto", opt.tol = 3e-4, opt.t_end = 0.4;
  opt.solver = "failing", opt.backends = backends;
  for (int factors = 0; factors <= 100; factors += 50) {
    msim_sim *sim = NULL;
    factors_left = factors;
    const msim_status status = msim_sim_create(scene, &opt, &sim, NULL);
    msim_sim_destroy(sim);
    assert_int_equal(status, MSIM_ERR_BACKEND);
  }
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_fifth_of_the_cost_decides),
                                     cmocka_unit_test(a_failure_of_the_solver_is_reported)};
  return cmocka_run_group_tests_name("auto_implicit", tests, NULL, NULL);
}
