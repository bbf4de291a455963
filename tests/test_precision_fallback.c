/* Tests of verified runs of integrator = auto with floats: they continue with doubles once steps
 * become too inaccurate, to the bit, also where memory runs out. */
#include <math.h>

#include "auto_scenes.h"
#include "checkpoints.h"
#include "choose/precision_choice.h"
#include "failing_allocator.h"

static msim_scene *falling_block(const msim_allocator *alloc) {
  const double g[3] = {0, 0, -9.81};
  const msim_lattice lattice = {.size = sizeof lattice,
                                .n = {3, 4, 5},
                                .extent = {1, 1, 1},
                                .mass = 2,
                                .k = 500,
                                .damping = 0.02};
  msim_scene *scene;
  assert_ok(msim_scene_create(alloc, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

static int is_single(const msim_sim *sim) { return sim->islands->model.single != NULL; }

static int needs_doubles(const msim_sim *sim) { return ms_step_verification_needs_doubles(sim); }

static msim_options options_with(int32_t threads) {
  msim_options opt = options_of("auto", 1e-2, 1);
  opt.threads = threads;
  return opt;
}

/* A run of which a verified step has just been too inaccurate, as almost no difference from its
 * half steps is allowed. These replace it. */
static msim_sim *imprecise_sim(const msim_scene *scene) {
  const msim_options opt = options_with(1);
  msim_sim *sim = make_sim(scene, &opt);
  assert_true(is_single(sim) && sim->config.choice.verification.allowed > 0);
  sim->config.choice.verification.allowed = 1e-14;
  assert_ok(msim_sim_step(sim, MS_VERIFICATION_INTERVAL - 1, err));
  const int64_t evaluations = stats_of(sim).force_evaluations / state_of(sim).step;
  assert_true(is_single(sim) && !needs_doubles(sim));
  assert_ok(msim_sim_step(sim, 1, err));
  assert_true(is_single(sim) && needs_doubles(sim));
  assert_true(stats_of(sim).force_evaluations / (MS_VERIFICATION_INTERVAL + 1) >= evaluations);
  return sim;
}

/* Also from a checkpoint, in a clone, with another number of threads, and after a return. */
static void imprecise_steps_lead_to_doubles(void **state) {
  (void)state;
  msim_scene *scene = falling_block(NULL);
  const msim_options opt = options_with(2);
  msim_sim *sim = imprecise_sim(scene), *other, *copy;
  const checkpoint c = save(sim);
  other = resume(scene, &opt, &c);
  assert_ok(msim_sim_clone(sim, &copy, err));
  assert_ok(msim_sim_step(sim, 1, err));
  assert_false(is_single(sim) || needs_doubles(sim));
  assert_int_equal(sim->monitor.good.step, MS_VERIFICATION_INTERVAL);
  assert_true(sim->islands->verification.indicator[0] >=
                  sim->config.choice.verification.indicator[0] &&
              sim->config.choice.verification.indicator[0] > 0);
  const char *text;
  assert_ok(msim_sim_explain(sim, &text, err));
  assert_non_null(strstr(text, "precision     double"));
  const int64_t left = sim->config.plan.steps - state_of(sim).step;
  assert_true(left > 0);
  const checkpoint later = save(sim);
  assert_ok(msim_sim_step(sim, left, err));
  expect_same_end(sim, other, left + 1, "resumed");
  expect_same_end(sim, copy, left + 1, "cloned");
  assert_ok(msim_sim_load(other, later.bytes, later.length, err));
  assert_false(is_single(other));
  expect_same_end(sim, other, left, "resumed with doubles");
  assert_ok(msim_sim_load(other, c.bytes, c.length, err));
  assert_true(is_single(other));
  expect_same_end(sim, other, left + 1, "returned");
  free(c.bytes), free(later.bytes);
  msim_sim_destroy(sim), msim_sim_destroy(other), msim_sim_destroy(copy);
  msim_scene_destroy(scene);
}

/* Doubles begin in the state in which floats end. */
static void the_state_stays(void **state) {
  (void)state;
  enum { N = 3 * 60 };
  msim_scene *scene = falling_block(NULL);
  msim_sim *sim = imprecise_sim(scene);
  const msim_state now = state_of(sim);
  double x[N], v[N];
  assert_int_equal(3 * now.n, N);
  memcpy(x, now.x, sizeof x), memcpy(v, now.v, sizeof v);
  assert_ok(msim_sim_step(sim, 1, err));
  const msim_state next = state_of(sim);
  for (int i = 0; i < N; i++) {
    assert_close(next.x[i], x[i] + now.h * v[i], 50 * now.h * now.h);
    assert_close(next.v[i], v[i], 50 * now.h);
  }
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

/* Without memory for doubles the sim stays as it was, and may go on later. */
static void doubles_may_lack_memory(void **state) {
  (void)state;
  msim_scene *scene = falling_block(failing_allocator_get());
  msim_sim *whole = imprecise_sim(scene), *sim = imprecise_sim(scene);
  assert_ok(msim_sim_step(whole, 1, err));
  for (int64_t which = 0;; which++) {
    failing_allocator_count(FAILING_BY_ALLOCATOR);
    failing_allocator_arm(which, 0);
    const msim_status status = msim_sim_step(sim, 1, NULL);
    const int failed = failing_allocator_has_failed();
    failing_allocator_arm(-1, 0);
    failing_allocator_count(FAILING_NONE);
    if (!failed) break;
    assert_int_equal(status, MSIM_ERR_MEMORY);
    assert_true(is_single(sim) && which < 1000);
    assert_int_equal(sim->config.opt.precision, MSIM_PRECISION_SINGLE);
  }
  assert_false(is_single(sim));
  expect_same(whole, sim, "after failures");
  msim_sim_destroy(whole), msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* The error of a step by rounding is E h sqrt(2 w/T), and may be a quarter of what is allowed. */
static void steps_must_be_verifiable(void **state) {
  (void)state;
  const ms_pilot_run p = {.single_error = 1e-4, .span = 2, .bounds = {.omega = 100}};
  const ms_candidate c = {.h = 1e-3};
  ms_step_verification v = {.allowed = 3.9e-6};
  assert_false(ms_precision_choice_is_verifiable(&p, &c, &v));
  v.allowed = 4.1e-6;
  assert_true(ms_precision_choice_is_verifiable(&p, &c, &v));
  v.allowed = 0; /* steps are not verified */
  assert_true(ms_precision_choice_is_verifiable(&p, &c, &v));
}

/* A heavy particle presses a cloth by a stiff spring: the allowed differences are small. */
static void doubles_verify_what_floats_cannot(void **state) {
  (void)state;
  const double x[3] = {0.45, 0.45, -1e-3}, v[3] = {0, 0, -3}, mass = 3, k = 3e3, rest = 1.201;
  const int32_t ij[2] = {65, 144};
  const char *text;
  msim_scene *scene = hanging_cloth(12, 300, 0);
  assert_ok(msim_scene_add_particles(scene, 1, x, v, &mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  const msim_options opt = options_of("auto", 1e-3, 0.7);
  msim_sim *sim = make_sim(scene, &opt);
  assert_true(sim->config.choice.single_error < 1e-3 / 4 && !is_single(sim));
  assert_ok(msim_sim_explain(sim, &text, err));
  assert_non_null(strstr(text, "double: steps of this method need them"));
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

/* The difference of a step from half steps, and the angles, are those of doubles, but for rounding
 * of forces: u w h w R in the velocity, u (w h)^2 R in the position. */
static void differences_are_those_of_doubles(void **state) {
  (void)state;
  const double steps[] = {1e-3, 1e-6}, u = 0x1p-24;
  msim_scene *scene = falling_block(NULL);
  ms_scales scales;
  ms_bounds bounds;
  unsigned seed = 8;
  ms_scene *s = scene->data;
  for (int i = 0; i < 3 * s->nparticles; i++) s->v[i] = 30 * (uniform(&seed) - 0.5);
  assert_ok(ms_scales_compute(s, s->x, s->v, 1, &scales, err));
  assert_ok(ms_bounds_compute(s, 1, &bounds, err));
  for (int i = 0; i < 2; i++) {
    const double h = steps[i], w = bounds.omega;
    ms_step_measurement step[2];
    for (int single = 0; single < 2; single++) {
      msim_options opt = options("velocity-verlet", h);
      opt.precision = single ? MSIM_PRECISION_SINGLE : MSIM_PRECISION_DOUBLE;
      opt.newton_retries = 2; /* for memory of half steps */
      msim_sim *sim = make_sim(scene, &opt);
      assert_ok(ms_step_verification_measure(sim, &scales, &step[single], err));
      msim_sim_destroy(sim);
    }
    const double off = fabs(step[1].error - step[0].error);
    const double most = u * w * h * (w / scales.speed + w * h / scales.extent);
    if (!(off <= most)) fail_msg("h = %g: %g is off by %g, not %g", h, step[0].error, off, most);
    assert_close(step[1].indicator[1], step[0].indicator[1], 1e-6);
    assert_true(step[0].indicator[0] > 0 && step[1].indicator[0] == 0);
  }
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(imprecise_steps_lead_to_doubles),
                                     cmocka_unit_test(the_state_stays),
                                     cmocka_unit_test(doubles_may_lack_memory),
                                     cmocka_unit_test(steps_must_be_verifiable),
                                     cmocka_unit_test(doubles_verify_what_floats_cannot),
                                     cmocka_unit_test(differences_are_those_of_doubles)};
  return cmocka_run_group_tests_name("precision_fallback", tests, NULL, NULL);
}
