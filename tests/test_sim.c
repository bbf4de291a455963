/* Tests of sims from creation to destruction: the same bits in however many calls, no allocation
 * in a step, unchanged after lack of memory, exact ends, events reported with step, time and
 * particle. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "counting_allocator.h"
#include "limited_allocator.h"
#include "scenes.h"

enum { SIDE = 6, N = SIDE * SIDE };

/* The next step depends on more than x and v. */
static int has_memory(const char *method) {
  return strcmp(method, "newmark") == 0 || strcmp(method, "bdf2") == 0 ||
         strcmp(method, "takahashi-imada") == 0;
}

/* A damped or undamped cloth that falls on a plane: all features. */
static msim_scene *everything(double damping) {
  msim_scene *scene = hanging_cloth(SIDE, 100, damping);
  plane(scene, 0, 0, 1, -0.05, 0.5, 0.3);
  return scene;
}

static msim_options pcg(const char *method, double h) {
  msim_options opt = options(method, h);
  opt.solver = "pcg";
  return opt;
}

static void same_bits(msim_sim *a, msim_sim *b) {
  msim_state sa = state_of(a), sb = state_of(b);
  assert_int_equal(sa.step, sb.step);
  assert_true(sa.t == sb.t);
  assert_memory_equal(sa.x, sb.x, 3 * N * sizeof *sa.x);
  assert_memory_equal(sa.v, sb.v, 3 * N * sizeof *sa.v);
}

static void pieces_and_watching_change_no_bit(void **state) {
  (void)state;
  for (int32_t m = 0; method_at(m); m++)
    for (int damped = 0; damped < 2; damped++) {
      if (damped && takes_positions_only(method_at(m))) continue;
      if (refuses_planes(method_at(m))) continue;
      msim_scene *scene = everything(damped * 0.05);
      msim_options opt = pcg(method_at(m), 1e-3);
      msim_sim *whole = make_sim(scene, &opt), *pieces = make_sim(scene, &opt);
      assert_ok(msim_sim_step(whole, 300, err));
      for (int i = 0; i < 300; i += 4) {
        msim_energy e = {.size = sizeof e};
        double x[3 * N], f[3 * N];
        assert_ok(msim_sim_step(pieces, 4, err));
        msim_state s = state_of(pieces);
        msim_sim_energy(pieces, &e);
        for (int q = 0; q < 3 * N; q++) x[q] = 2 * s.x[q] + 1; /* also of the pinned ones */
        msim_sim_force(pieces, x, s.v, f);
      }
      same_bits(whole, pieces);
      assert_true(stats_of(whole).contacts > 0);
      msim_sim_destroy(whole), msim_sim_destroy(pieces);
      msim_scene_destroy(scene);
    }
}

/* A new sim set to a state that was read continues with the same bits. verlet needs its half-step
 * velocity for that, which is part of the state. */
static void set_state_goes_on_bit_for_bit(void **state) {
  (void)state;
  for (int32_t m = 0; method_at(m); m++) {
    if (has_memory(method_at(m))) continue;
    msim_scene *scene = everything(0);
    msim_options opt = pcg(method_at(m), 1e-3);
    msim_sim *whole = make_sim(scene, &opt), *first = make_sim(scene, &opt);
    msim_sim *second = make_sim(scene, &opt);
    assert_ok(msim_sim_step(whole, 300, err));
    assert_ok(msim_sim_step(first, 100, err));
    msim_state s = state_of(first);
    assert_int_equal(s.v_half != NULL, strcmp(method_at(m), "verlet") == 0);
    assert_ok(msim_sim_set_state(second, &s, err));
    assert_ok(msim_sim_step(second, 200, err));
    msim_state a = state_of(whole), b = state_of(second);
    assert_int_equal(b.step, 300);
    assert_close(a.t, b.t, 1e-15);
    assert_memory_equal(a.x, b.x, 3 * N * sizeof *a.x);
    msim_sim_destroy(whole), msim_sim_destroy(first), msim_sim_destroy(second);
    msim_scene_destroy(scene);
  }
}

/* v_half belongs to its h: with another one verlet starts from v(t) again. */
static void v_half_of_another_h_is_not_taken(void **state) {
  (void)state;
  msim_scene *scene = everything(0);
  msim_options opt = pcg("verlet", 1e-3);
  msim_sim *first = make_sim(scene, &opt);
  opt.h = 2e-3;
  msim_sim *with = make_sim(scene, &opt), *without = make_sim(scene, &opt);
  assert_ok(msim_sim_step(first, 50, err));
  msim_state s = state_of(first);
  assert_true(s.h == 1e-3);
  assert_ok(msim_sim_set_state(with, &s, err));
  s.v_half = NULL;
  assert_ok(msim_sim_set_state(without, &s, err));
  assert_ok(msim_sim_step(with, 10, err));
  assert_ok(msim_sim_step(without, 10, err));
  same_bits(with, without);
  msim_sim_destroy(first), msim_sim_destroy(with), msim_sim_destroy(without);
  msim_scene_destroy(scene);
}

static void the_start_is_the_scene_itself(void **state) {
  (void)state;
  const double x[3] = {0.1, 0.2, 0.3}, v[3] = {0.4, 0.5, 0.6};
  msim_scene *scene = make_single_particle(x, v, 9.81);
  for (int32_t m = 0; method_at(m); m++) {
    msim_options opt = pcg(method_at(m), 1e-3);
    msim_sim *sim = make_sim(scene, &opt);
    msim_state s = state_of(sim);
    assert_memory_equal(s.x, x, sizeof x);
    assert_memory_equal(s.v, v, sizeof v);
    assert_true(s.t == 0 && s.step == 0 && s.n == 1);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

/*------------------------------------- ends -----------------------------------------------------*/

static char warning[256];
static void keep_warning(const char *text, void *user) {
  (void)user;
  strncpy(warning, text, sizeof warning - 1);
}

static void plan(double h, int64_t steps, double t_end, double want_h, int64_t want_steps) {
  const double x[3] = {0}, v[3] = {1, 0, 0};
  msim_scene *scene = make_single_particle(x, v, 0);
  msim_options opt = pcg("verlet", h);
  opt.steps = steps, opt.t_end = t_end, opt.warn = keep_warning;
  warning[0] = 0;
  msim_sim *sim = make_sim(scene, &opt);
  msim_plan p = {.size = sizeof p};
  msim_sim_plan(sim, &p);
  assert_true(p.h == want_h);
  assert_int_equal(p.steps, want_steps);
  assert_int_equal(strstr(warning, "lowered") != NULL, want_h != h);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_int_equal(state_of(sim).step, want_steps);
  if (steps < 0) assert_close(state_of(sim).t, t_end, 1e-9 * t_end);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void ends_are_hit(void **state) {
  (void)state;
  plan(0.1, 7, 99, 0.1, 7);          /* steps have precedence over t_end */
  plan(0.1, -1, 1, 0.1, 10);         /* 1/0.1 is a whole number up to rounding */
  plan(0.3, -1, 1, 0.25, 4);         /* lowered, with a warning */
  plan(0.1, -1, 1 + 1e-11, 0.1, 10); /* still whole to 1e-9 */
  plan(0.1, -1, 1 + 1e-6, (1 + 1e-6) / 11, 11);
  plan(0.1, 0, -1, 0.1, 0); /* no steps: the start */
  plan(5, -1, 0.5, 0.5, 1); /* h longer than the run */
}

static int64_t seen[64];
static int nseen;
static int note_step(msim_sim *sim, void *user) {
  seen[nseen++] = state_of(sim).step;
  return user && nseen == *(int *)user;
}

static void frames(int64_t every, double fps, int64_t steps, int n, const int64_t *want) {
  const double x[3] = {0}, v[3] = {1, 0, 0};
  msim_scene *scene = make_single_particle(x, v, 0);
  msim_options opt = pcg("verlet", 0.1);
  opt.steps = steps, opt.every = every, opt.fps = fps;
  msim_sim *sim = make_sim(scene, &opt);
  nseen = 0;
  assert_ok(msim_sim_run(sim, note_step, NULL, err));
  assert_int_equal(nseen, n);
  assert_memory_equal(seen, want, (size_t)n * sizeof *want);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A frame is the first step at or after its time, without interpolation; start and end are frames
 * too. */
static void frames_fall_on_steps(void **state) {
  (void)state;
  frames(3, 0, 10, 5, (const int64_t[]){0, 3, 6, 9, 10});
  frames(5, 0, 10, 3, (const int64_t[]){0, 5, 10});
  frames(0, 2, 12, 4, (const int64_t[]){0, 5, 10, 12});
  frames(0, 4, 10, 5, (const int64_t[]){0, 3, 5, 8, 10}); /* 0.25, 0.5, 0.75, 1.0 s */
  frames(0, 1000, 3, 4, (const int64_t[]){0, 1, 2, 3});   /* at most one per step */
  frames(0, 0, 4, 5, (const int64_t[]){0, 1, 2, 3, 4});
}

static void stop_ends_after_the_step(void **state) {
  (void)state;
  int calls = 3;
  const double x[3] = {0}, v[3] = {1, 0, 0};
  msim_scene *scene = make_single_particle(x, v, 0);
  msim_options opt = pcg("verlet", 0.1);
  opt.steps = 20, opt.every = 1;
  msim_sim *sim = make_sim(scene, &opt);
  msim_error why;
  nseen = 0;
  assert_int_equal(msim_sim_run(sim, note_step, &calls, &why), MSIM_STOPPED);
  assert_int_equal(state_of(sim).step, 2);
  msim_sim_stop(sim);
  assert_int_equal(msim_sim_step(sim, 5, &why), MSIM_STOPPED);
  assert_int_equal(state_of(sim).step, 3);
  assert_non_null(strstr(why.text, "step 3"));
  assert_ok(msim_sim_run(sim, NULL, NULL, err)); /* the run continues when it is called again */
  assert_int_equal(state_of(sim).step, 20);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- events and refusals --------------------------------------*/

static void blow_up_is_reported_and_refused(void **state) {
  (void)state;
  for (int32_t m = 0; method_at(m); m++) {
    if (is_implicit(method_at(m))) continue;    /* implicit methods do not blow up */
    if (refuses_planes(method_at(m))) continue; /* its x, v exceed its own variables */
    msim_scene *scene = hanging_cloth(SIDE, 1e6, 0);
    msim_options opt = pcg(method_at(m), 0.1);
    opt.watch = MSIM_WATCH_OFF;
    msim_sim *sim = make_sim(scene, &opt);
    msim_error why;
    assert_int_equal(msim_sim_step(sim, 10000, &why), MSIM_NOT_FINITE);
    msim_state s = state_of(sim);
    char where[64];
    snprintf(where, sizeof where, "step %lld, t = ", (long long)s.step + 1);
    assert_non_null(strstr(why.text, where));
    assert_non_null(strstr(why.text, "particle "));
    msim_energy e = {.size = sizeof e};
    msim_sim_energy(sim, &e);
    assert_true(isfinite(e.total));
    for (int i = 0; i < 3 * N; i++) assert_true(isfinite(s.x[i]) && isfinite(s.v[i]));
    int64_t before = s.step;
    assert_int_equal(msim_sim_step(sim, 1, &why), MSIM_NOT_FINITE); /* again, from the same state */
    assert_int_equal(state_of(sim).step, before);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

static void refused(const char *integrator, const char *option, const char *value,
                    const char *sentence) {
  const double x[3] = {0}, v[3] = {0};
  msim_scene *scene = make_single_particle(x, v, 0);
  msim_options opt = pcg(integrator, 0.1);
  msim_sim *sim;
  msim_error why;
  msim_status status = option ? msim_options_set(&opt, option, value, &why) : MSIM_OK;
  if (!status) status = msim_sim_create(scene, &opt, &sim, &why);
  assert_true(status < 0);
  if (!strstr(why.text, sentence)) fail_msg("\"%s\" lacks \"%s\"", why.text, sentence);
  msim_scene_destroy(scene);
}

static void bad_options_are_refused(void **state) {
  (void)state;
  refused(NULL, NULL, NULL, "no integrator is given");
  refused("verlett", NULL, NULL, "'verlett' (did you mean 'verlet'?)");
  refused("auto", "steps", "10", "integrator 'auto' and steps exclude each other");
  refused("verlet", "collision", "event", "use velocity-verlet");
  refused("verlet", "h", "0", "h is '0'; it must be a number > 0 or auto");
  refused("verlet", "h", "nan", "h is 'nan'");
  refused("verlet", "h", "1e999", "h is '1e999'");
  refused("verlet", "steps", "-3", "steps is '-3'");
  refused("verlet", "steps", "1.5", "steps is '1.5'");
  refused("verlet", "jacobian", "clamped", "it must be exact or clamp");
  refused("heun", "heun.collision", "never", "it must be final, standard or literal");
  refused("verlet", "plugin_path", "", "plugin_path is ''; it must be a list of folders");
  refused("verlet", "solver.rtoll", "1", "did you mean 'solver.rtol'");
  refused("verlet", "skip.planes", "maybe", "it must be on or off");
  msim_scene *scene;
  msim_sim *sim;
  msim_error why;
  msim_options opt = pcg("verlet", -1);
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_int_equal(msim_sim_create(scene, &opt, &sim, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text, "the scene has no particles");
  msim_scene_destroy(scene);
}

static void unknown_solvers_say_where_they_looked(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(3, 100, 0);
  const struct {
    const char *solver, *sentence;
  } cases[] = {{"cholmood",
                "'cholmood' (did you mean 'cholmod'?): msim_backend_cholmood.so was not found in "
                "/nowhere, "},
               {"../evil", "'../evil' is not a valid name of a backend"},
               {"", "'' is not a valid name of a backend"}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    msim_options opt = options("linearly-implicit-euler", 0.1);
    msim_sim *sim;
    msim_error why;
    opt.solver = cases[i].solver, opt.plugin_path = "/nowhere";
    assert_int_equal(msim_sim_create(scene, &opt, &sim, &why), MSIM_ERR_NAME);
    if (!strstr(why.text, cases[i].sentence))
      fail_msg("\"%s\" lacks \"%s\"", why.text, cases[i].sentence);
  }
  msim_scene_destroy(scene);
}

/*------------------------------------- memory ---------------------------------------------------*/

typedef struct method_and_solver {
  const char *method, *solver;
} method_and_solver;

static msim_status build_and_step(const msim_allocator *alloc, void *data) {
  const method_and_solver *by = data;
  const double x[9] = {0, 0, 0, 1, 0, 0, 2, 0.1, 0}, mass[3] = {1, 1, 1}, k[2] = {10, 10};
  const int32_t ij[4] = {0, 1, 1, 2}, pin = 0;
  msim_scene *scene = NULL;
  msim_sim *sim = NULL;
  const char *text;
  msim_csr A = {.size = sizeof A};
  msim_options opt = options(by->method, 0.01);
  opt.solver = by->solver;
  msim_status status = msim_scene_create(alloc, &scene, NULL);
  if (!status) status = msim_scene_add_particles(scene, 3, x, NULL, mass, NULL);
  if (!status) status = msim_scene_add_springs(scene, 2, ij, k, NULL, NULL, NULL);
  if (!status) status = msim_scene_pin(scene, 1, &pin, NULL);
  if (!status) status = msim_sim_create(scene, &opt, &sim, NULL);
  if (!status) status = msim_sim_step(sim, 2, NULL);
  if (!status) status = msim_sim_explain(sim, &text, NULL);
  if (!status && strcmp(by->method, "verlet") != 0) status = msim_sim_matrix(sim, &A, NULL);
  const double out[9] = {0, 0, 0, 1, 0, 0.1, 2, 0.1, 0}, rest[9] = {0};
  const msim_state risen = {.size = sizeof risen, .n = 3, .x = out, .v = rest};
  if (!status) status = msim_sim_set_state(sim, &risen, NULL); /* no longer planar */
  if (!status) status = msim_sim_step(sim, 2, NULL);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return status;
}

/* Each allocation fails in turn: a status, no crash, no leak. */
static void every_allocation_may_fail(void **state) {
  (void)state;
  method_and_solver pairs[] = {{"verlet", "pcg"},
                               {"linearly-implicit-euler", "pcg"},
                               {"linearly-implicit-euler", "cholmod"},
                               {"linearly-implicit-euler", "klu"},
                               {"linearly-implicit-euler", "sundials-pcg"},
                               {"linearly-implicit-euler", "sundials-spfgmr"}};
  for (size_t m = 0; m < sizeof pairs / sizeof *pairs; m++)
    if (is_solver_available(pairs[m].solver))
      assert_true(expect_memory_errors(build_and_step, &pairs[m]) > 20);
}

static void a_step_allocates_nothing(void **state) {
  (void)state;
  for (int32_t m = 0; method_at(m); m++) {
    counting_allocator b = {.fail_at = -1};
    const msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free,
                                  &b};
    const double x[9] = {0, 0, 0, 1, 0, 0, 2, 0.1, 0}, mass[3] = {1, 1, 1}, k[2] = {10, 10};
    const int32_t ij[4] = {0, 1, 1, 2};
    msim_scene *scene;
    assert_ok(msim_scene_create(&alloc, &scene, err));
    assert_ok(msim_scene_add_particles(scene, 3, x, NULL, mass, err));
    assert_ok(msim_scene_add_springs(scene, 2, ij, k, NULL, NULL, err));
    if (!refuses_planes(method_at(m))) plane(scene, 0, 1, 0, 0.05, 0.5, 0.1);
    msim_options opt = pcg(method_at(m), 0.01);
    msim_sim *sim = make_sim(scene, &opt);
    int64_t calls = b.calls;
    assert_ok(msim_sim_step(sim, 50, err));
    state_of(sim);
    assert_int_equal(b.calls, calls);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
    assert_int_equal(b.live, 0);
  }
}

/* The sim shares the scene: destroying or changing the scene does not affect the sim. */
static void the_scene_is_shared_and_safe(void **state) {
  (void)state;
  const double x[3] = {0, 0, 1}, v[3] = {0}, up[3] = {0, 0, 100};
  msim_scene *scene = make_single_particle(x, v, 10);
  msim_options opt = pcg("symplectic-euler", 0.1);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_scene_set_gravity(scene, up, err));
  msim_scene_destroy(scene);
  assert_ok(msim_sim_step(sim, 1, err));
  assert_close(state_of(sim).v[2], -1, 1e-15);
  msim_sim_destroy(sim);
}

/*------------------------------------- features -------------------------------------------------*/

static void what_is_not_needed_does_not_run(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 100, 0);
  for (int32_t m = 0; method_at(m); m++) {
    if (is_implicit(method_at(m))) continue;
    msim_options opt = options(method_at(m), 1e-3);
    opt.solver = "klu"; /* explicit methods need no solver */
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 10, err));
    msim_stats s = stats_of(sim);
    assert_int_equal(s.assemblies + s.analyses + s.factorizations + s.solves + s.iterations, 0);
    assert_true(s.assemble_s == 0 && s.factor_s == 0 && s.solve_s == 0 && s.collide_s == 0);
    msim_sim_destroy(sim);
  }
  msim_options opt = pcg("velocity-verlet", 1e-3);
  msim_sim *sim = NULL;
  msim_error why;
  opt.solver = "no-such-solver";
  assert_int_equal(msim_sim_create(scene, &opt, &sim, &why), MSIM_ERR_NAME);
  assert_non_null(strstr(why.text, "unknown solver 'no-such-solver'"));
  opt.solver = "pcg";
  sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 10, err));
  assert_int_equal(stats_of(sim).force_evaluations, 11); /* the last a of a step is reused */
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A feature that is kept although it is not needed changes no bit. */
static void skips_change_no_bit(void **state) {
  (void)state;
  for (int32_t m = 0; method_at(m); m++)
    for (int free = refuses_planes(method_at(m)); free < 2; free++) {
      msim_scene *scene = free ? hanging_cloth(SIDE, 100, 0) : everything(0);
      msim_options opt = pcg(method_at(m), 1e-3);
      msim_sim *lean = make_sim(scene, &opt);
      assert_ok(msim_options_set(&opt, "skip.damping", "off", err));
      assert_ok(msim_options_set(&opt, "skip.drag", "off", err));
      assert_ok(msim_options_set(&opt, "skip.planes", "off", err));
      msim_sim *full = make_sim(scene, &opt);
      assert_ok(msim_sim_step(lean, 200, err));
      assert_ok(msim_sim_step(full, 200, err));
      assert_int_equal(stats_of(full).contacts > 0, !free);
      assert_memory_equal(state_of(lean).x, state_of(full).x, 3 * N * sizeof(double));
      msim_sim_destroy(lean), msim_sim_destroy(full);
      msim_scene_destroy(scene);
    }
}

static void explain_says_what_is_skipped(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 100, 0);
  msim_options opt = pcg("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  const char *text;
  assert_ok(msim_sim_explain(sim, &text, err));
  assert_non_null(strstr(text, "no spring is damped"));
  assert_non_null(strstr(text, "there are no planes or colliders"));
  assert_non_null(strstr(text, "the method needs no solver"));
  assert_non_null(strstr(text, "is stable for h < "));
  assert_null(strstr(text, "no spring acts on"));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(pieces_and_watching_change_no_bit),
                                     cmocka_unit_test(set_state_goes_on_bit_for_bit),
                                     cmocka_unit_test(v_half_of_another_h_is_not_taken),
                                     cmocka_unit_test(the_start_is_the_scene_itself),
                                     cmocka_unit_test(ends_are_hit),
                                     cmocka_unit_test(frames_fall_on_steps),
                                     cmocka_unit_test(stop_ends_after_the_step),
                                     cmocka_unit_test(blow_up_is_reported_and_refused),
                                     cmocka_unit_test(bad_options_are_refused),
                                     cmocka_unit_test(unknown_solvers_say_where_they_looked),
                                     cmocka_unit_test(every_allocation_may_fail),
                                     cmocka_unit_test(a_step_allocates_nothing),
                                     cmocka_unit_test(the_scene_is_shared_and_safe),
                                     cmocka_unit_test(what_is_not_needed_does_not_run),
                                     cmocka_unit_test(skips_change_no_bit),
                                     cmocka_unit_test(explain_says_what_is_skipped)};
  return cmocka_run_group_tests_name("sim", tests, NULL, NULL);
}
