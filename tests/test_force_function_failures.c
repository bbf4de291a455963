/* Tests of forces that the program computes, and fails to: in any call of a step, in frames inside
 * steps, in derivatives; and of want of memory. */
#include <math.h>

#include "force_functions.h"
#include "limited_allocator.h"
#include "state_hash.h"

enum { T = MSIM_FORCE_TIME, V = MSIM_FORCE_VELOCITY, J = MSIM_FORCE_JACOBIAN };

static void expect_failure(const char *method, double tol, int32_t code, int64_t at) {
  field of = gusts, undisturbed = gusts;
  msim_scene *scene = hanging_cloth(4, 50, 0), *other = hanging_cloth(4, 50, 0);
  set_field(scene, &of, flags_for(method)), set_field(other, &undisturbed, flags_for(method));
  msim_options opt = options(method, 2e-3);
  if (tol > 0) opt.tol = tol, opt.steps = -1, opt.t_end = 10;
  msim_sim *sim = make_sim(scene, &opt), *plain = make_sim(other, &opt);
  assert_ok(msim_sim_step(sim, 3, err));
  const uint64_t before = hash_sim(sim);
  const double work = state_of(sim).work;
  of.code = code, of.worst = 2, of.fails_at = of.calls + at;
  msim_error why;
  const msim_status status = msim_sim_step(sim, 1, &why);
  if (status != (code ? MSIM_FORCE_FAILED : MSIM_NOT_FINITE) &&
      !(tol > 0 && !code && status == MSIM_NOT_CONVERGED))
    fail_msg("%s, call %d: status %d, %s", method, (int)at, (int)status, why.text);
  if (code && !strstr(why.text, "step 4, t = ")) fail_msg("%s: %s", method, why.text);
  if (!strstr(why.text, code ? "force function 'field' failed: it returned 7"
                             : "force function 'field' returned a number that is NaN"))
    fail_msg("%s: %s", method, why.text);
  if (!code && !strstr(why.text, ", particle 4")) fail_msg("%s: %s", method, why.text);
  assert_true(before == hash_sim(sim) && state_of(sim).step == 3 && work == state_of(sim).work);
  of.fails_at = 0;
  assert_ok(msim_sim_step(sim, 5, err));
  assert_ok(msim_sim_step(plain, 8, err));
  if (strcmp(method, "newmark") == 0) /* may have computed anew the acceleration that it carries */
    assert_close(state_of(sim).x[3], state_of(plain).x[3], 1e-9);
  else if (hash_sim(sim) != hash_sim(plain)) fail_msg("%s, call %d: another path", method, (int)at);
  msim_sim_destroy(sim), msim_sim_destroy(plain);
  msim_scene_destroy(scene), msim_scene_destroy(other);
}

/* A failure in any call of a step: the state is the last good one, and the run may go on. */
static void failures_keep_the_state(void **state) {
  (void)state;
  const char *method;
  for (int32_t i = 0; (method = method_at(i)) != NULL; i++) {
    if (!takes_functions(method)) continue;
    for (int64_t at = 1; at <= 3; at++)
      for (int32_t code = 0; code <= 7; code += 7) {
        expect_failure(method, 0, code, at);
        if (at > 2) expect_failure(method, 1e-5, code, at);
      }
  }
  for (int64_t at = 4; at <= 12; at++) expect_failure("dop853", 0, 7, at);
}

/* One failed call ends the step; the function is not called again in it. */
static void single_failures_are_reported(void **state) {
  (void)state;
  const char *const methods[] = {"rk4", "dop853", "implicit-midpoint", "linearly-implicit-euler"};
  for (int i = 0; i < 4; i++) {
    field of = gusts;
    msim_scene *scene = hanging_cloth(4, 50, 0);
    set_field(scene, &of, T | V | J);
    const msim_options opt = options(methods[i], 1e-3);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 2, err));
    of.once = 1, of.code = 3, of.fails_at = of.calls + 1;
    assert_int_equal(msim_sim_step(sim, 1, NULL), MSIM_FORCE_FAILED);
    assert_int_equal(of.calls, of.fails_at);
    assert_ok(msim_sim_step(sim, 1, err));
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* NaN in derivatives is the function's, too, in steps and where the matrix is exported. */
static void bad_derivatives_are_reported(void **state) {
  (void)state;
  field of = gusts;
  msim_scene *scene = hanging_cloth(4, 50, 0);
  set_field(scene, &of, T | V | J);
  const msim_options opt = options("linearly-implicit-euler", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  msim_csr A = {.size = sizeof A};
  msim_error why;
  assert_ok(msim_sim_step(sim, 2, err));
  const uint64_t before = hash_sim(sim);
  of.bad_derivative = 1, of.worst = 1, of.fails_at = 1;
  assert_int_equal(msim_sim_step(sim, 1, &why), MSIM_NOT_FINITE);
  assert_non_null(strstr(why.text, "particle 2: force function 'field' returned a number that is"));
  assert_int_equal(msim_sim_matrix(sim, &A, &why), MSIM_NOT_FINITE);
  assert_non_null(strstr(why.text, "force function 'field' returned a number that is"));
  assert_true(before == hash_sim(sim));
  of.fails_at = 0;
  assert_ok(msim_sim_matrix(sim, &A, err));
  assert_ok(msim_sim_step(sim, 1, err));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* The state at a frame inside a step is finite, even where the function fails for dense output. */
static int observe_frame(msim_sim *sim, void *data) {
  field *of = data;
  of->fails_at = of->calls + 1;
  const msim_state s = state_of(sim);
  for (int32_t i = 0; i < 3 * s.n; i++) assert_true(isfinite(s.x[i]) && isfinite(s.v[i]));
  of->fails_at = 0;
  return 0;
}

static void frames_are_finite(void **state) {
  (void)state;
  const char *const methods[] = {"dop853", "velocity-verlet", "implicit-midpoint"};
  for (int i = 0; i < 3; i++) {
    field of = gusts;
    of.code = 7;
    msim_scene *scene = hanging_cloth(4, 50, 0);
    set_field(scene, &of, T | V | J);
    msim_options opt = options(methods[i], 1e-3);
    opt.tol = 1e-5, opt.steps = -1, opt.t_end = 0.5, opt.fps = 100;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_run(sim, observe_frame, &of, err));
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* 1 N along x; fails while *data is not 0. */
static int32_t push_along_x(void *data, const msim_force_batch *b) {
  for (int32_t i = 0; i < b->n; i++) b->f[3 * i] = 1;
  return *(int *)data;
}

static int observe_acceleration(msim_sim *sim, void *data) {
  *(int *)data = 7;
  const msim_state s = state_of(sim);
  assert_close(s.x[0], s.t * s.t / 2, 1e-14);
  assert_close(s.v[0], s.t, 1e-14);
  *(int *)data = 0;
  return 0;
}

/* Where the function fails for dense output, the states at both ends of the step still give x to
 * third and v to first order: exactly for a constant force of 1 N on 1 kg. */
static void frames_are_interpolated_without_forces(void **state) {
  (void)state;
  const char *const methods[] = {"dop853", "rk4", "velocity-verlet", "implicit-midpoint"};
  for (int i = 0; i < 4; i++) {
    int fails = 0;
    const msim_force_function is = {
        .size = sizeof is, .name = "push", .evaluate = push_along_x, .data = &fails};
    const double zero[3] = {0};
    msim_scene *scene = make_single_particle(zero, zero, 0);
    assert_ok(msim_scene_set_force_function(scene, &is, err));
    msim_options opt = options(methods[i], 0.125);
    opt.tol = 1e-3, opt.steps = -1, opt.t_end = 1, opt.fps = 100;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_run(sim, observe_acceleration, &fails, err));
    assert_true(stats_of(sim).steps < 50); /* frames are inside steps */
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- memory ---------------------------------------------------*/

/* A scene of its own, its function twice, a sim by an implicit method and a step */
static msim_status run_all(const msim_allocator *alloc, void *data) {
  (void)data;
  field of = gusts;
  const msim_force_function is = field_function(&of, T | V | J);
  const double x[6] = {0, 0, 0, 1, 0, 0}, mass[2] = {1, 1}, k = 10;
  const int32_t ij[2] = {0, 1};
  const msim_options opt = options("implicit-euler", 1e-3);
  msim_scene *scene = NULL;
  msim_sim *sim = NULL;
  msim_csr A = {.size = sizeof A};
  msim_status status = msim_scene_create(alloc, &scene, NULL);
  if (!status) status = msim_scene_add_particles(scene, 2, x, NULL, mass, NULL);
  if (!status) status = msim_scene_add_springs(scene, 1, ij, &k, NULL, NULL, NULL);
  if (!status) status = msim_scene_set_force_function(scene, &is, NULL);
  if (!status) status = msim_sim_create(scene, &opt, &sim, NULL);
  if (!status) status = msim_scene_set_force_function(scene, &is, NULL); /* copies the scene */
  if (!status) status = msim_sim_step(sim, 2, NULL);
  if (!status) status = msim_sim_matrix(sim, &A, NULL);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return status;
}

static void every_allocation_may_fail(void **state) {
  (void)state;
  assert_true(expect_memory_errors(run_all, NULL) > 50);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(failures_keep_the_state),
      cmocka_unit_test(single_failures_are_reported),
      cmocka_unit_test(bad_derivatives_are_reported),
      cmocka_unit_test(frames_are_finite),
      cmocka_unit_test(frames_are_interpolated_without_forces),
      cmocka_unit_test(every_allocation_may_fail),
  };
  return cmocka_run_group_tests_name("force_function_failures", tests, NULL, NULL);
}
