/* Tests of integrator = auto: a few steps under error control show what such a run costs. */
#include <math.h>
#include <string.h>

#include "auto_scenes.h"
#include "choose/control_trial.h"

static msim_scene *damped_rope(void) { return swinging_rope(32, 1e4, 4); }
/* Damping removes vibrations in microseconds. */
static msim_scene *stiff_dampers(void) { return swinging_rope(100, 3000, 40); }
static msim_scene *rope(void) { return swinging_rope(32, 1e4, 0); }

static const ms_candidate *find_controlled(const msim_sim *sim, const char *method) {
  for (int i = 0; i < MS_CANDIDATES; i++) {
    const ms_candidate *c = &sim->config.choice.candidates[i];
    if (c->control_tol > 0 && !strcmp(c->method->entry.name, method)) return c;
  }
  return NULL;
}

static double work_of_run(const msim_scene *scene, const char *method, double tol, double t_end) {
  const msim_options opt = options_of(method, tol, t_end);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  const double work = ms_pilot_run_count_work(sim);
  msim_sim_destroy(sim);
  return work;
}

/* The trial of a method under error control, at any cost */
static ms_candidate try_control(msim_sim *sim, const char *method, double tol) {
  const msim_state start = state_of(sim);
  ms_candidate c = *find_controlled(sim, method);
  ms_pilot_run p;
  assert_ok(ms_pilot_run_begin(sim, tol, 0, &start, &p, err));
  assert_ok(ms_pilot_run_make(&p, err));
  const double reach = (p.damped ? MS_LOOSE : 1) * ms_control_trial_stable_step(&p, c.method);
  c.rejection = 0, c.tried = 0;
  c.h = fmin(reach, p.span / 10);
  assert_ok(ms_control_trial_make(&p, INFINITY, &c, err));
  ms_pilot_run_end(&p);
  return c;
}

/* Errors of steps grow after the pilot run, where ropes and cloths start at rest, and steps become
 * shorter; where the limit of stability decides, they do not. Evaluations of dop853 and rk6 count
 * 13/12-fold. The first step of rk6 is cut to a fifth; the trial ends before steps are as long as
 * the others, which is made good in part. Steps of rkc first become up to 200 times as long, which
 * does not count, and then may shorten more than expected. */
static void the_cost_of_error_control_is_foreseen(void **state) {
  (void)state;
  static const struct {
    msim_scene *(*make)(void);
    const char *method;
    double tol;
  } row[] = {{damped_rope, "ssprk104", 1e-2},  {damped_rope, "ssprk104", 1e-4},
             {damped_rope, "rk6", 1e-5},       {damped_rope, "rk6", 1e-7},
             {rope, "dop853", 1e-5},           {rope, "dop853", 1e-7},
             {damped_solid, "ssprk104", 0.02}, {damped_solid, "ssprk102", 0.1},
             {stiff_dampers, "rkc", 0.05},     {stiff_dampers, "rkc", 1e-2},
             {stiff_dampers, "rkc", 1e-3}};
  const double t_end = 0.5;
  for (size_t i = 0; i < sizeof row / sizeof *row; i++) {
    msim_scene *scene = row[i].make();
    msim_options opt = options_of("auto", row[i].tol, t_end);
    opt.precision = MSIM_PRECISION_DOUBLE;
    msim_sim *sim = make_sim(scene, &opt);
    const ms_candidate c = try_control(sim, row[i].method, row[i].tol);
    const double sums = strstr(row[i].method, "rk6") || strstr(row[i].method, "dop") ? 13. / 12 : 1;
    const double work = sums * work_of_run(scene, row[i].method, row[i].tol, t_end);
    const double ratio = c.cost_rate * t_end / work;
    print_message("  %s, tol %.0e: foreseen/spent %.3g\n", row[i].method, row[i].tol, ratio);
    const int is_rkc = strcmp(row[i].method, "rkc") == 0;
    const double most = strcmp(row[i].method, "rk6") == 0 ? 1.5 : 1.25;
    assert_true(c.tried && ratio > (is_rkc ? 0.7 : 0.8) && ratio < most);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* 6 steps of dop853 take 86 evaluations here, 16 would take 206; the pilot run and the trials of
 * fixed steps take the others. */
static void few_steps_are_sufficient(void **state) {
  (void)state;
  msim_scene *scene = rope();
  const msim_options opt = options_of("auto", 1e-5, 0.5);
  msim_sim *sim = make_sim(scene, &opt);
  const double choice = sim->config.choice.total_cost;
  print_message("  the choice: %.0f evaluations\n", choice);
  assert_true(find_controlled(sim, "dop853")->tried);
  assert_true(choice < 450);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(the_cost_of_error_control_is_foreseen),
                                     cmocka_unit_test(few_steps_are_sufficient)};
  return cmocka_run_group_tests_name("control_cost", tests, NULL, NULL);
}
