/* Tests of scenes in which damping takes vibrations within a fraction of a millisecond: rkc with
 * many stages, under error control and with the fixed steps of integrator = auto, which may become
 * unstable. */
#include <math.h>
#include <string.h>

#include "auto_scenes.h"
#include "checkpoints.h"
#include "methods/methods.h"
#include "methods/rkc.h"

enum { MOST_PARTICLES = 160 };

static msim_scene *falling_block(void) {
  const double g[3] = {0, 0, -9.81};
  const msim_lattice block = {.size = sizeof block,
                              .n = {7, 7, 7},
                              .extent = {0.3, 0.3, 0.3},
                              .mass = 0.3,
                              .k = 4600,
                              .damping = 250};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &block, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

/* Nothing but rounding errors limits the steps in free fall; 1000 stages are the most. Steps that
 * would need more amplified them until the run failed. */
static void long_steps_have_enough_stages(void **state) {
  (void)state;
  msim_scene *scene = falling_block();
  const double tol = 0.03, T = 0.56;
  const msim_options opt = options_of("rkc", tol, T);
  ms_bounds b;
  msim_sim *sim = make_sim(scene, &opt);
  const msim_state start = state_of(sim);
  double z[343];
  for (int i = 0; i < 343; i++) z[i] = start.x[3 * i + 2];
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  const msim_state end = state_of(sim);
  for (int i = 0; i < 343; i++) assert_close(end.x[3 * i + 2], z[i] - 9.81 * T * T / 2, tol * 0.3);
  assert_ok(ms_bounds_compute(scene->data, 1, &b, err));
  b.rate *= 10;
  const double h = ms_rkc.limit(&b);
  print_message("  %lld steps, the longest has %d stages\n", (long long)stats_of(sim).steps,
                ms_rkc_count_stages(h, b));
  assert_int_equal(ms_rkc_count_stages(h, b), 1000);
  assert_int_equal(ms_rkc_count_stages(0.998 * h, b), 999);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

typedef struct finished_run {
  msim_status status;
  const ms_integrator *method;
  double choice; /* the cost of integrator = auto, evaluations */
  msim_stats stats;
} finished_run;

/* Run to the end, x. */
static finished_run finish(const msim_scene *scene, const msim_options *opt, double *x) {
  msim_sim *sim = make_sim(scene, opt);
  msim_error why;
  finished_run r = {.choice = sim->config.choice.total_cost};
  r.status = msim_sim_run(sim, NULL, NULL, &why);
  r.method = sim->config.integrator;
  const msim_state end = state_of(sim);
  memcpy(x, end.x, 3 * (size_t)end.n * sizeof *x);
  r.stats = stats_of(sim);
  msim_sim_destroy(sim);
  return r;
}

/* Swinging ropes: across its springs a taut rope is undamped, so that long steps, as good as others
 * while it is slack, become unstable. Without the error estimate as indicator all of these runs
 * fail. */
static void ropes_keep_tol(void **state) {
  (void)state;
  const struct {
    int32_t n;
    double k, damping, t_end, tol;
  } rope[] = {{147, 5600, 22, 0.28, 0.05}, {138, 5000, 90, 0.3, 0.04}, {140, 850, 3, 0.26, 0.01},
              {150, 2900, 32, 0.26, 0.03}, {131, 2000, 9, 0.24, 0.06}, {86, 3200, 75, 0.3, 0.04}};
  for (size_t i = 0; i < sizeof rope / sizeof *rope; i++) {
    const double tol = rope[i].tol, t_end = rope[i].t_end;
    const msim_options accurate = options_of("ssprk104", 1e-4 * tol, t_end);
    const msim_options other = options_of("ssprk104", tol, t_end);
    double exact[3 * MOST_PARTICLES], x[3 * MOST_PARTICLES];
    msim_scene *scene = swinging_rope(rope[i].n, rope[i].k, rope[i].damping);
    const finished_run of_other = finish(scene, &other, x);
    assert_ok(of_other.status);
    assert_ok(finish(scene, &accurate, exact).status);
    for (int single = 0; single < 2; single++) {
      msim_options opt = options_of("auto", tol, t_end);
      opt.precision = single ? MSIM_PRECISION_AUTO : MSIM_PRECISION_DOUBLE;
      const finished_run r = finish(scene, &opt, x);
      assert_ok(r.status);
      assert_ptr_equal(r.method, &ms_rkc);
      const double off = largest_difference(x, exact, 3 * rope[i].n);
      print_message("  %d particles: %lld steps, %lld evaluations, error/tol %.2g\n", rope[i].n,
                    (long long)r.stats.steps, (long long)r.stats.force_evaluations, off / tol);
      assert_true(off < tol);
      assert_true(single || r.stats.force_evaluations < of_other.stats.force_evaluations);
    }
    msim_scene_destroy(scene);
  }
}

/* 62 steps, the last ones in substeps of rkc; or all under error control */
static void resumed_runs_are_the_same(void **state) {
  (void)state;
  const int64_t at[] = {1, 20, 40, 55};
  msim_scene *scene = swinging_rope(147, 5600, 22);
  for (double tol = 0.05; tol < 0.2; tol *= 2) {
    const msim_options opt = options_of("auto", tol, 0.28);
    expect_resumable(scene, &opt, 62, 4, at, "rkc");
  }
  msim_scene_destroy(scene);
}

/* Evaluations of a run and of the choice, and its end */
static double evaluations_of(const msim_scene *scene, const char *method, double tol, double *x) {
  const msim_options opt = options_of(method, tol, 0.5);
  const finished_run r = finish(scene, &opt, x);
  assert_ok(r.status);
  return r.choice + (double)r.stats.force_evaluations;
}

/* With a tol of 0.1 stability decides on steps that damping limits: without trials order 2 under
 * error control keeps tol at fewer evaluations than the choice by trials with slightly less, in
 * steps of many stages if the damping rate is more than three times the largest frequency. */
static void a_large_tol_needs_no_trials(void **state) {
  (void)state;
  enum { N = 3 * 144 };
  static const struct {
    double damping;
    const ms_integrator *chosen;
  } row[] = {{1, &ms_ssprk102}, {8, &ms_rkc}};
  for (size_t i = 0; i < sizeof row / sizeof *row; i++) {
    msim_scene *scene = hanging_cloth(12, 1000, row[i].damping);
    double exact[N], x[N];
    const char *text;
    ms_bounds b;
    assert_ok(ms_bounds_compute(scene->data, 1, &b, err));
    assert_true(b.rate > b.omega);
    assert_int_equal(b.rate > 3 * b.omega, row[i].chosen == &ms_rkc);
    for (double tol = 0.1; tol < 0.5; tol *= 2) {
      const msim_options opt = options_of("auto", tol, 0.5);
      msim_sim *sim = make_sim(scene, &opt);
      assert_ptr_equal(sim->config.integrator, row[i].chosen);
      assert_true(sim->config.opt.tol == tol && sim->config.choice.total_cost == 0);
      assert_ok(msim_sim_explain(sim, &text, err));
      assert_non_null(strstr(text, " without a pilot run or trials\n"));
      assert_non_null(strstr(text, "dop853            rejected: tol is so large that order 2"));
      assert_non_null(strstr(text, "rkn6              rejected: forces depend on velocities"));
      msim_sim_destroy(sim);
    }
    evaluations_of(scene, "ssprk104", 1e-6, exact);
    const double untried = evaluations_of(scene, "auto", 0.1 * (1 - 1e-9), x);
    assert_true(largest_difference(x, exact, N) < 0.1);
    const double by_trials = evaluations_of(scene, "auto", 0.09, x);
    print_message("  %.0f evaluations instead of %.0f\n", untried, by_trials);
    assert_true(untried < 0.9 * by_trials);
    msim_scene_destroy(scene);
  }
}

/* Trials are made where damping is weak, a single event may decide, or planes count. */
static void other_scenes_need_trials(void **state) {
  (void)state;
  msim_scene *scenes[] = {hanging_cloth(12, 1000, 0.1), swinging_rope(8, 1e4, 40),
                          hanging_cloth(12, 1000, 1)};
  plane(scenes[2], 0, 0, 1, -0.05, 0.5, 0);
  for (int i = 0; i < 3; i++) {
    const msim_options opt = options_of("auto", 0.1, 0.5);
    msim_sim *sim = make_sim(scenes[i], &opt);
    assert_true(sim->config.choice.pilot_time > 0 && sim->config.choice.total_cost > 0);
    msim_sim_destroy(sim), msim_scene_destroy(scenes[i]);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(long_steps_have_enough_stages),
      cmocka_unit_test(a_large_tol_needs_no_trials), cmocka_unit_test(other_scenes_need_trials),
      cmocka_unit_test(ropes_keep_tol), cmocka_unit_test(resumed_runs_are_the_same)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
