/* Tests of integrator = auto: a reproducible choice with its reason, and a new one for another
 * state or other springs. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "auto_scenes.h"
#include "counting_allocator.h"

static const char *name_of(const msim_sim *sim) {
  msim_plan plan = {.size = sizeof plan};
  msim_sim_plan(sim, &plan);
  return plan.integrator;
}

static void same_choice(const msim_sim *a, const msim_sim *b) {
  assert_string_equal(name_of(a), name_of(b));
  assert_memory_equal(a->config.choice.candidates, b->config.choice.candidates,
                      sizeof a->config.choice.candidates);
  assert_true(a->config.opt.tol == b->config.opt.tol && a->config.opt.h == b->config.opt.h);
}

static void same_state(msim_sim *a, msim_sim *b) {
  const msim_state s = state_of(a), t = state_of(b);
  assert_true(s.t == t.t);
  expect_same_motion(a, b);
}

/* Steps that their half steps confirm are kept, and nothing else is part of the run: it is that of
 * the method by name. Half steps now and then would let errors of symplectic methods grow. */
static void verified_runs_are_those_by_name(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(5, 100, 0);
  for (double tol = 1e-2; tol > 1e-10; tol /= 10) {
    const msim_options opt = options_of("auto", tol, 2);
    msim_sim *sim = make_sim(scene, &opt);
    msim_options by_name = options_of(name_of(sim), 0, -1);
    by_name.h = sim->run.h, by_name.steps = sim->config.plan.steps;
    msim_sim *other = make_sim(scene, &by_name);
    assert_ok(msim_sim_run(sim, NULL, NULL, err));
    assert_ok(msim_sim_run(other, NULL, NULL, err));
    assert_int_equal(stats_of(sim).rejected_steps, 0);
    assert_true(stats_of(sim).force_evaluations > stats_of(other).force_evaluations);
    expect_same_motion(sim, other);
    msim_sim_destroy(sim), msim_sim_destroy(other);
  }
  msim_scene_destroy(scene);
}

/* Step 6 of a run, verified, where the half steps may differ by so many times their difference
 * from the step, ends where the method by name does in so many steps. */
static void expect_parts(const msim_scene *scene, double allowed, int64_t parts) {
  const msim_options opt = options_of("auto", 1e-6, 2);
  msim_sim *sim = make_sim(scene, &opt), *same = make_sim(scene, &opt);
  ms_step_verification *check = &sim->config.choice.verification;
  ms_step_measurement of;
  assert_ok(msim_sim_step(sim, 5, err));
  assert_ok(msim_sim_step(same, 5, err));
  const msim_state start = state_of(same);
  msim_options by_name = options_of(name_of(sim), 0, -1);
  by_name.h = sim->run.h / (double)parts;
  msim_sim *other = make_sim(scene, &by_name);
  assert_ok(msim_sim_set_state(other, &start, err));
  assert_ok(ms_step_verification_measure(same, &check->scales, &of, err));
  check->allowed = allowed * of.error, sim->islands->verification.verify_next = 1;
  assert_ok(msim_sim_step(sim, 1, err));
  assert_ok(msim_sim_step(other, parts, err));
  expect_same_motion(sim, other);
  msim_sim_destroy(sim), msim_sim_destroy(same), msim_sim_destroy(other);
}

static void less_accurate_steps_are_replaced_by_half_steps(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(5, 100, 0);
  expect_parts(scene, 1.1, 1), expect_parts(scene, 0.9, 2);
  msim_scene_destroy(scene);
}

/* A soft chain with strong dampers, and a stiff undamped spring, which hardly oscillates: a few
 * steps of rkc do not show that its motion grows. */
static void rkc_is_left_out_where_a_spring_is_undamped(void **state) {
  (void)state;
  enum { LINKS = 20, ALL = LINKS + 2 };
  double x[3 * ALL] = {0}, v[3 * ALL] = {0}, mass[ALL], k[LINKS], rest[LINKS], c[LINKS];
  int32_t ij[2 * LINKS];
  const int32_t pinned[] = {0, LINKS};
  for (int i = 0; i < ALL; i++) x[3 * i] = 0.1 * i, mass[i] = 0.05;
  for (int i = 1; i < LINKS; i++) v[3 * i + 2] = sin(3. * i / LINKS);
  x[3 * LINKS + 3] = 0.1 * LINKS, x[3 * LINKS + 5] = 0.1, v[3 * LINKS + 5] = 1e-9;
  for (int e = 0; e < LINKS; e++) {
    const int i = e < LINKS - 1 ? e : LINKS;
    ij[2 * e] = i, ij[2 * e + 1] = i + 1, rest[e] = 0.1;
    k[e] = e < LINKS - 1 ? 50 : 1e4, c[e] = e < LINKS - 1 ? 200 : 0;
  }
  msim_scene *scene;
  const char *text;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, ALL, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, LINKS, ij, k, rest, c, err));
  assert_ok(msim_scene_pin(scene, 2, pinned, err));
  const msim_options opt = options_of("auto", 1e-2, 2);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_explain(sim, &text, err));
  assert_non_null(strstr(text, "some spring is undamped, so that no step is stable"));
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A second sim makes the same choice, with any number of threads, and explains it. */
static void it_is_always_the_same(void **state) {
  (void)state;
  for (int i = 0; i < NEXAMPLES; i++) {
    msim_scene *scene = examples[i].make();
    msim_options opt = options_of("auto", 1e-4, examples[i].t_end);
    msim_sim *sim = make_sim(scene, &opt);
    opt.threads = 2;
    msim_sim *other = make_sim(scene, &opt);
    const char *text, *line;
    same_choice(sim, other);
    assert_ok(msim_sim_run(sim, NULL, NULL, err));
    assert_ok(msim_sim_run(other, NULL, NULL, err));
    same_state(sim, other);
    assert_ok(msim_sim_explain(sim, &text, err));
    for (int k = 0; k < MS_CANDIDATES; k++)
      assert_non_null(strstr(text, sim->config.choice.candidates[k].method->entry.name));
    line = strstr(text, ": chosen, ");
    assert_non_null(line);
    assert_null(strstr(line + 1, ": chosen, "));
    msim_sim_destroy(sim), msim_sim_destroy(other);
    msim_scene_destroy(scene);
  }
}

/* The default tol, and a run without an end */
static void it_needs_no_options(void **state) {
  (void)state;
  msim_scene *scene = soft_cloth();
  const msim_options bare = options_of("auto", 0, -1), full = options_of("auto", 1e-6, 1);
  msim_sim *sim = make_sim(scene, &bare), *other = make_sim(scene, &full);
  same_choice(sim, other);
  assert_ok(msim_sim_step(sim, 3, err));
  msim_sim_destroy(sim), msim_sim_destroy(other);
  msim_scene_destroy(scene);
}

/* A scene created in a state makes the same choice as a sim that was set to it, and the same
 * steps. */
static void a_set_state_makes_a_new_choice(void **state) {
  (void)state;
  msim_scene *scene = soft_cloth(), *later;
  const msim_options opt = options_of("auto", 1e-5, 0.8);
  msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 30, err));
  double x[MOST], v[MOST];
  msim_state now = state_of(sim);
  const size_t bytes = 3 * (size_t)now.n * sizeof *x;
  memcpy(x, now.x, bytes), memcpy(v, now.v, bytes);
  now.x = x, now.v = v, now.t = 0;
  assert_ok(msim_sim_set_state(sim, &now, err));
  assert_ok(msim_sim_set_state(other, &now, err));
  same_choice(sim, other);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_ok(msim_sim_run(other, NULL, NULL, err));
  same_state(sim, other);
  msim_scene_view view = {.size = sizeof view};
  const int32_t corners[2] = {0, 4};
  msim_scene_get(scene, &view);
  assert_ok(msim_scene_create(NULL, &later, err));
  assert_ok(msim_scene_add_particles(later, view.nparticles, x, v, view.mass, err));
  assert_ok(msim_scene_add_springs(later, view.nsprings, view.ij, view.k, view.rest, NULL, err));
  assert_ok(msim_scene_pin(later, 2, corners, err));
  assert_ok(msim_scene_set_gravity(later, view.gravity, err));
  msim_sim_destroy(other);
  other = make_sim(later, &opt);
  same_choice(sim, other);
  assert_ok(msim_sim_run(other, NULL, NULL, err));
  same_state(sim, other);
  msim_sim_destroy(sim), msim_sim_destroy(other);
  msim_scene_destroy(scene), msim_scene_destroy(later);
}

/* A soft net with a stiff cord along its middle row */
static msim_scene *net_with_cord(void) {
  enum { SIDE = 16, SPRINGS = 6 * SIDE * SIDE };
  const int32_t corners[4] = {0, SIDE - 1, SIDE * (SIDE - 1), SIDE * SIDE - 1};
  const double g[3] = {0, 0, -9.81};
  msim_scene *net = hanging_cloth(SIDE, 100, 0), *scene;
  msim_scene_view view = {.size = sizeof view};
  double k[SPRINGS];
  msim_scene_get(net, &view);
  assert_true(view.nsprings <= SPRINGS);
  for (int32_t e = 0; e < view.nsprings; e++) {
    const int32_t i = view.ij[2 * e], j = view.ij[2 * e + 1];
    k[e] = i / SIDE == SIDE / 2 && j / SIDE == SIDE / 2 ? 1e6 : view.k[e];
  }
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, view.nparticles, view.x, view.v, view.mass, err));
  assert_ok(msim_scene_add_springs(scene, view.nsprings, view.ij, k, view.rest, NULL, err));
  assert_ok(msim_scene_pin(scene, 4, corners, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  msim_scene_destroy(net);
  return scene;
}

/* The few steps of a trial have rounding errors that, over the run, are above such a tol: steps
 * follow from the error of longer ones. With 1/(omega h) a few, order 2 would cost some 1e4 times
 * as many steps. */
static void a_tol_near_rounding_is_extrapolated(void **state) {
  (void)state;
  msim_scene *scene = net_with_cord();
  for (double tol = 1e-9; tol > 1e-13; tol /= 10) {
    const msim_options opt = options_of("auto", tol, 0.2);
    msim_sim *sim = make_sim(scene, &opt);
    print_message("  tol %.0e: %s, error foreseen %.1e\n", tol, name_of(sim),
                  sim->config.choice.candidates[sim->config.choice.best].error);
    assert_true(sim->config.integrator->entry.order >= 4);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

/* If forces begin to depend on velocities, another method is chosen. */
static void set_springs_make_a_new_choice(void **state) {
  (void)state;
  msim_scene *scene = soft_cloth(), *damped = hanging_cloth(5, 30, 0.01);
  const msim_options opt = options_of("auto", 1e-7, 0.6);
  msim_sim *sim = make_sim(scene, &opt), *other = make_sim(damped, &opt);
  msim_scene_view view = {.size = sizeof view};
  assert_string_equal(name_of(sim), "rkn6");
  assert_ok(msim_sim_step(sim, 5, err));
  msim_scene_get(damped, &view);
  assert_ok(msim_sim_set_springs(sim, NULL, NULL, view.damping, err));
  assert_string_equal(name_of(sim), "dop853");
  const msim_state now = state_of(sim);
  assert_ok(msim_sim_set_state(other, &now, err));
  same_choice(sim, other);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_ok(msim_sim_run(other, NULL, NULL, err));
  same_state(sim, other);
  msim_sim_destroy(sim), msim_sim_destroy(other);
  msim_scene_destroy(scene), msim_scene_destroy(damped);
}

static void note(const char *text, void *user) { snprintf(user, 256, "%s", text); }

/* A step given by the user is not used, and a warning says so; without one there is no warning. */
static void it_chooses_the_steps(void **state) {
  (void)state;
  msim_scene *scene = stiff_cloth();
  msim_options opt = options_of("auto", 1e-2, 0.2);
  msim_error why;
  char said[256] = "";
  opt.warn = note, opt.warn_user = said;
  msim_sim *sim = make_sim(scene, &opt);
  assert_string_equal(said, "");
  msim_sim_destroy(sim);
  opt.h = 0.1;
  sim = make_sim(scene, &opt);
  assert_non_null(strstr(said, "h is ignored"));
  assert_true(sim->run.h < 1e-3);
  assert_int_equal(msim_sim_set_step(sim, 1e-5, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "integrator 'auto' chooses h itself"));
  assert_ok(msim_sim_set_step(sim, MSIM_H_AUTO, err));
  msim_sim_destroy(sim);
  opt.steps = 10;
  assert_int_equal(msim_sim_create(scene, &opt, &sim, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "use t_end"));
  msim_scene_destroy(scene);
}

/* If the user asks for located impacts, none is reflected at the end of a step. */
static void impacts_are_located_where_asked(void **state) {
  (void)state;
  msim_scene *scene = soft_cloth();
  plane(scene, 0, 0, 1, -0.01, 0.5, 0);
  msim_options opt = options_of("auto", 1e-2, 0.5);
  const char *text;
  for (int located = 0; located < 2; located++) {
    if (located) opt.collision = MSIM_COLLISION_EVENT;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_explain(sim, &text, err));
    assert_true(!strstr(text, "impacts are to be located") == !located);
    assert_true(!located || sim->config.opt.collision == MSIM_COLLISION_EVENT);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

/* A choice for which memory runs out changes nothing, and leaks nothing. */
static void lack_of_memory_changes_nothing(void **state) {
  (void)state;
  counting_allocator b = {.fail_at = -1};
  const msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free,
                                &b};
  const double x[6] = {0, 0, 0, 1, 0.2, 0}, far[6] = {0, 0, 0, 3, 0, 0.5}, v[6] = {0},
               mass[2] = {1, 1}, k = 100, rest = 1;
  const int32_t ij[2] = {0, 1};
  msim_scene *scene;
  assert_ok(msim_scene_create(&alloc, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  const msim_options opt = options_of("auto", 1e-4, 1);
  msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &opt);
  const msim_state there = {.size = sizeof there, .n = 2, .x = far, .v = v};
  const int64_t live = b.live;
  msim_status status = MSIM_ERR_MEMORY;
  for (int64_t at = 0; status; at++) {
    b.calls = 0, b.fail_at = at;
    status = msim_sim_set_state(sim, &there, NULL);
    b.fail_at = -1;
    if (!status) break;
    assert_int_equal(status, MSIM_ERR_MEMORY);
    assert_int_equal(b.live, live);
    same_choice(sim, other);
    assert_ok(msim_sim_step(sim, 1, err));
    assert_ok(msim_sim_step(other, 1, err));
    same_state(sim, other);
  }
  msim_sim_destroy(sim), msim_sim_destroy(other);
  msim_scene_destroy(scene);
  assert_int_equal(b.live, 0);
}

static void count_warning(const char *text, void *user) {
  int *count = user;
  *count += strstr(text, "none of the methods tried keeps tol") != NULL;
}

/* A soft net with a stiff cord along its middle row, where stability makes steps so short that
 * leapfrog is accurate to 1e-8. For less another method is taken, and where rounding may be more
 * than 10 tol the run says so. */
static void tight_tolerances_are_kept_or_reported(void **state) {
  enum { SIDE = 16 };
  const int32_t corners[4] = {0, SIDE - 1, SIDE * (SIDE - 1), SIDE * SIDE - 1};
  const double g[3] = {0, 0, -9.81}, k = 1e6, rest = 1. / (SIDE - 1), t_end = 0.2;
  const msim_cloth net = {.size = sizeof net,
                          .rows = SIDE,
                          .columns = SIDE,
                          .row = {0, 1, 0},
                          .column = {1, 0, 0},
                          .mass = 1,
                          .k_structural = 100,
                          .k_shear = 100,
                          .k_bend = 100,
                          .npinned = 4,
                          .pinned = corners};
  msim_scene *scene;
  (void)state;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_cloth(scene, &net, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  for (int32_t i = 0; i + 1 < SIDE; i++) {
    const int32_t ij[2] = {SIDE * SIDE / 2 + i, SIDE * SIDE / 2 + i + 1};
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  }
  const msim_options exact = options_of("dop853", 1e-13, t_end);
  msim_sim *reference = make_sim(scene, &exact);
  assert_ok(msim_sim_run(reference, NULL, NULL, err));
  const msim_state at = state_of(reference);
  for (double tol = 1e-7; tol > 1e-12; tol /= 10) {
    int warnings = 0;
    double most = 0, sum = 0;
    msim_options opt = options_of("auto", tol, t_end);
    opt.warn = count_warning, opt.warn_user = &warnings;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_run(sim, NULL, NULL, err));
    const msim_state s = state_of(sim);
    for (int32_t i = 0; i < 3 * s.n; i++) {
      const double error = fabs(s.x[i] - at.x[i]);
      most = fmax(most, error), sum += error * error;
    }
    if (tol > 5e-10) assert_int_equal(warnings, 0);
    assert_true(warnings || sqrt(sum / s.n) <= 2 * tol);
    assert_true(most < 2e-9 || tol > 5e-8);
    msim_sim_destroy(sim);
  }
  msim_sim_destroy(reference);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(tight_tolerances_are_kept_or_reported),
      cmocka_unit_test(rkc_is_left_out_where_a_spring_is_undamped),
      cmocka_unit_test(verified_runs_are_those_by_name),
      cmocka_unit_test(less_accurate_steps_are_replaced_by_half_steps),
      cmocka_unit_test(it_is_always_the_same),
      cmocka_unit_test(it_needs_no_options),
      cmocka_unit_test(a_set_state_makes_a_new_choice),
      cmocka_unit_test(a_tol_near_rounding_is_extrapolated),
      cmocka_unit_test(set_springs_make_a_new_choice),
      cmocka_unit_test(it_chooses_the_steps),
      cmocka_unit_test(impacts_are_located_where_asked),
      cmocka_unit_test(lack_of_memory_changes_nothing)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
