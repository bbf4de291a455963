/* Tests of what an observer of msim_sim_run may do with its sim: reading changes no bit, changes
 * act as between two runs, and what would enter the run again is refused. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "checkpoints.h"

enum { SIDE = 4, SPRINGS = 58, FRAME = 4 };

/* Runs with fixed steps, with frames inside of steps, and of a method with a matrix. */
enum { KINDS = 4 };
static msim_options options_of(int kind) {
  static const char *const methods[KINDS] = {"velocity-verlet", "dop853", "implicit-midpoint",
                                             "verlet"};
  msim_options opt;
  msim_options_init(&opt, sizeof opt);
  opt.integrator = methods[kind];
  opt.h = 1e-3, opt.t_end = 0.1;
  if (kind == 1) opt.tol = 1e-4, opt.fps = 150;
  else opt.every = 10;
  return opt;
}

/*------------------------------------- what is refused ------------------------------------------*/

static char warning[256];
static void keep_warning(const char *text, void *user) {
  (void)user;
  snprintf(warning, sizeof warning, "%s", text);
}

static void assert_refused(msim_status status, const msim_error *why, const char *function) {
  assert_int_equal(status, MSIM_ERR_ARG);
  assert_ptr_equal(strstr(why->text, function), why->text);
  assert_non_null(strstr(why->text, "must not be called in an observer of the same sim"));
}

static int enter_again(msim_sim *sim, void *user) {
  msim_error why;
  ++*(int *)user;
  assert_refused(msim_sim_step(sim, 1, &why), &why, "msim_sim_step");
  assert_refused(msim_sim_run(sim, NULL, NULL, &why), &why, "msim_sim_run");
  warning[0] = 0;
  msim_sim_destroy(sim);
  assert_string_equal(warning, "the sim is not destroyed: its observer must not do that");
  return 0;
}

static void the_run_is_not_entered_again(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 100, 0.01);
  for (int kind = 0; kind < KINDS; kind++) {
    msim_options opt = options_of(kind);
    opt.warn = keep_warning;
    msim_sim *sim = make_sim(scene, &opt), *alone = make_sim(scene, &opt);
    int calls = 0;
    assert_ok(msim_sim_run(sim, enter_again, &calls, err));
    assert_ok(msim_sim_run(alone, NULL, NULL, err));
    assert_true(calls > 10);
    expect_same(sim, alone, opt.integrator);
    assert_ok(msim_sim_step(sim, 1, err)); /* after the run */
    msim_sim_destroy(sim), msim_sim_destroy(alone);
  }
  msim_scene_destroy(scene);
}

/*------------------------------------- reading --------------------------------------------------*/

/* The dense output of a step may take evaluations, which stats count: they are read, too. */
static int read_state(msim_sim *sim, void *user) {
  (void)user;
  (void)state_of(sim);
  return 0;
}

static int read_all(msim_sim *sim, void *user) {
  const msim_state s = state_of(sim);
  double *force = malloc(3 * (size_t)s.n * sizeof *force);
  const char *text;
  msim_energy energy = {.size = sizeof energy};
  msim_plan p = {.size = sizeof p};
  msim_csr A = {.size = sizeof A};
  assert_int_equal(msim_sim_energy(sim, &energy), MSIM_OK);
  assert_int_equal(msim_sim_plan(sim, &p), MSIM_OK);
  msim_sim_force(sim, s.x, s.v, force);
  assert_ok(msim_sim_explain(sim, &text, err));
  if (is_implicit(p.integrator)) assert_ok(msim_sim_matrix(sim, &A, err));
  assert_true(msim_sim_next_frame(sim) >= stats_of(sim).steps);
  const checkpoint c = save(sim);
  free(c.bytes), free(force);
  ++*(int *)user;
  return 0;
}

static void reading_changes_no_bit(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 100, 0.01);
  for (int kind = 0; kind < KINDS; kind++) {
    const msim_options opt = options_of(kind);
    msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &opt);
    int calls = 0;
    assert_ok(msim_sim_run(sim, read_all, &calls, err));
    assert_ok(msim_sim_run(other, read_state, NULL, err));
    assert_true(calls > 10);
    expect_same(sim, other, opt.integrator);
    msim_sim_destroy(sim), msim_sim_destroy(other);
  }
  msim_scene_destroy(scene);
}

/*------------------------------------- changing -------------------------------------------------*/

static checkpoint early; /* of a frame before the change */

static void change_springs(msim_sim *sim) {
  double k[SPRINGS];
  for (int e = 0; e < SPRINGS; e++) k[e] = 50 + e;
  assert_ok(msim_sim_set_springs(sim, k, NULL, NULL, err));
}

static void change_step(msim_sim *sim) { assert_ok(msim_sim_set_step(sim, 5e-4, err)); }

static void change_state(msim_sim *sim) {
  const msim_state now = state_of(sim);
  double v[3 * SIDE * SIDE];
  for (int32_t i = 0; i < 3 * now.n; i++) v[i] = 0.5 * now.v[i];
  msim_state slower = {.size = sizeof slower, .t = 0.02, .n = now.n, .x = now.x, .v = v};
  assert_ok(msim_sim_set_state(sim, &slower, err));
}

static void change_back(msim_sim *sim) {
  assert_ok(msim_sim_load(sim, early.bytes, early.length, err));
}

typedef struct plan_of_change {
  void (*change)(msim_sim *);
  int frames, stops; /* stops: the run is to stop, and the caller makes the change */
} plan_of_change;

static int change_at_frame(msim_sim *sim, void *user) {
  plan_of_change *p = user;
  const int frame = p->frames++;
  (void)state_of(sim); /* as read_state() */
  if (frame == FRAME / 2) {
    free(early.bytes);
    early = save(sim);
  }
  if (frame != FRAME) return 0;
  if (p->stops) return 1;
  p->change(sim);
  return 0;
}

static void changes_act_as_between_two_runs(void **state) {
  (void)state;
  static void (*const changes[])(msim_sim *) = {change_springs, change_step, change_state,
                                                change_back};
  static const char *const labels[] = {"springs", "step", "state", "checkpoint"};
  msim_scene *scene = hanging_cloth(SIDE, 100, 0.01);
  msim_scene_view view = {.size = sizeof view};
  assert_int_equal(msim_scene_get(scene, &view), MSIM_OK);
  assert_int_equal(view.nsprings, SPRINGS);
  for (int kind = 0; kind < KINDS; kind++)
    for (int i = 0; i < 4; i++) {
      const msim_options opt = options_of(kind);
      msim_sim *inside = make_sim(scene, &opt), *between = make_sim(scene, &opt);
      plan_of_change p = {changes[i], 0, 0}, q = {changes[i], 0, 1};
      assert_ok(msim_sim_run(inside, change_at_frame, &p, err));
      assert_int_equal(msim_sim_run(between, change_at_frame, &q, NULL), MSIM_STOPPED);
      changes[i](between);
      assert_ok(msim_sim_run(between, read_state, NULL, err));
      assert_true(p.frames > FRAME);
      expect_same(inside, between, labels[i]);
      msim_sim_destroy(inside), msim_sim_destroy(between);
    }
  free(early.bytes);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(the_run_is_not_entered_again),
                                     cmocka_unit_test(reading_changes_no_bit),
                                     cmocka_unit_test(changes_act_as_between_two_runs)};
  return cmocka_run_group_tests_name("observer", tests, NULL, NULL);
}
