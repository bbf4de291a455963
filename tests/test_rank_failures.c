/* Tests of what ranks agree on: failures of one of them, requests to stop, observers, rest; each
 * allocation of one rank that fails. */
#include <stdatomic.h>

#include "counting_allocator.h"
#include "rank_runs.h"
#include "sim/sim.h"

/*------------------------------------- numerical events -----------------------------------------*/

/* What one process reports, and the state it leaves */
typedef struct event {
  run r;
  msim_status status;
  char text[1024];
} event;

/* Steps of a run whose text is compared as a whole, as only one particle can be meant */
enum { WHOLE_TEXT = 999 };

static event find_event(const msim_scene *scene, msim_options opt, int32_t steps) {
  event e = {.r = {.scene = scene, .opt = opt, .steps = steps}};
  msim_error why;
  msim_sim *sim = make_sim(scene, &opt);
  e.status = msim_sim_step(sim, steps, &why);
  snprintf(e.text, sizeof e.text, "%s", why.text);
  e.r.expected = state_of(sim);
  e.r.expected.x = copy_numbers(e.r.expected.x, e.r.expected.n);
  e.r.expected.v = copy_numbers(e.r.expected.v, e.r.expected.n);
  msim_sim_destroy(sim);
  return e;
}

static const char *check_event(msim_comm *comm, void *data) {
  const event *e = data;
  msim_options opt = e->r.opt;
  msim_sim *sim;
  msim_error why;
  msim_state s = {.size = sizeof s};
  opt.comm = comm;
  EXPECT(msim_sim_create(e->r.scene, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_step(sim, e->r.steps, &why) == e->status);
  EXPECT(has_same_text(comm, why.text));
  EXPECT(e->r.steps != WHOLE_TEXT || strcmp(why.text, e->text) == 0);
  EXPECT(strncmp(why.text, e->text, strlen("step 100, t = 0")) == 0);
  EXPECT(msim_sim_state(sim, &s) == MSIM_OK && s.step == e->r.expected.step);
  EXPECT(has_same_bits(s.x, e->r.expected.x, s.n) && has_same_bits(s.v, e->r.expected.v, s.n));
  msim_sim_destroy(sim);
  return NULL;
}

static void check_events(const msim_scene *scene, msim_options opt, msim_status status,
                         int32_t steps) {
  event e = find_event(scene, opt, steps);
  assert_int_equal(e.status, status);
  for (int32_t n = 2; n <= 4; n++) {
    const char *wrong = run_ranks(n, check_event, &e);
    if (wrong) fail_msg("%d ranks: %s, not %s", n, wrong, e.text);
  }
  free_run(&e.r);
}

/* Of particle 30, from t = 0.005 on */
static int32_t fail_late(void *data, const msim_force_batch *b) {
  (void)data;
  for (int32_t i = 0; i < b->n; i++)
    if (b->particles[i] == 30 && b->t > 0.005) return 7;
  return 0;
}

static void events_are_those_of_one_process(void **state) {
  (void)state;
  const msim_force_function late = {
      .size = sizeof late, .flags = MSIM_FORCE_TIME, .name = "late", .evaluate = fail_late};
  msim_scene *cloth = hanging_cloth(9, 4000, 0);
  check_events(cloth, options("velocity-verlet", 7e-4), MSIM_UNSTABLE, 1000);
  check_events(cloth, options("rk4", 1.05e-3), MSIM_UNSTABLE, 1000);
  check_events(cloth, options("rk4", 0.002), MSIM_NOT_FINITE,
               1000); /* the last good state is restored */
  msim_options blind = options("symplectic-euler", 0.02);
  blind.watch = MSIM_WATCH_OFF;
  check_events(cloth, blind, MSIM_NOT_FINITE, 1000);
  msim_scene *mesh = random_mesh(120, 7, 0);
  msim_options few = options("implicit-euler", 0.02);
  few.newton_max_iterations = 2, few.newton_retries = 0;
  check_events(mesh, few, MSIM_NOT_CONVERGED, WHOLE_TEXT);
  few.newton_retries = 1;
  check_events(mesh, few, MSIM_NOT_CONVERGED, WHOLE_TEXT);
  check_events(mesh, options("velocity-verlet", 0.008), MSIM_UNSTABLE, WHOLE_TEXT);
  msim_scene_destroy(mesh);
  double force[3 * 81] = {[3 * 40] = 1e200}; /* beyond the limit of numbers, on one rank */
  assert_ok(msim_scene_set_forces(cloth, force, err));
  check_events(cloth, options("linearly-implicit-euler", 1e-3), MSIM_NOT_FINITE, 1000);
  assert_ok(msim_scene_set_forces(cloth, NULL, err));
  assert_ok(msim_scene_set_force_function(cloth, &late, err));
  check_events(cloth, options("velocity-verlet", 1e-4), MSIM_FORCE_FAILED, 1000);
  msim_scene_destroy(cloth);
}

static _Thread_local double armed = INFINITY; /* s */

/* Of particle 30, in a step of 1e-4 s from then on: NaN at its end, so that it is retried in two
 * substeps, and a failure before */
static int32_t fail_in_retry(void *data, const msim_force_batch *b) {
  (void)data;
  for (int32_t i = 0; i < b->n && b->t >= armed; i++) {
    if (b->particles[i] != 30) continue;
    if (b->t < armed + 0.75e-4) return 7;
    b->f[3 * i] = NAN;
  }
  return 0;
}

static double no_potential(void *data, int32_t n, const int32_t *particles, const double *x) {
  (void)data, (void)n, (void)particles, (void)x;
  return 0;
}

static const char *check_failed_force(msim_comm *comm, void *data) {
  const run *r = data;
  msim_options opt = r->opt;
  msim_sim *sim;
  msim_error why;
  opt.comm = comm;
  EXPECT(msim_sim_create(r->scene, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_step(sim, 3, &why) == MSIM_OK);
  armed = 3e-4 - 1e-9;
  EXPECT(msim_sim_step(sim, 1, &why) == MSIM_FORCE_FAILED);
  armed = INFINITY;
  EXPECT(has_same_text(comm, why.text));
  EXPECT(msim_sim_step(sim, 20, &why) == MSIM_OK);
  msim_sim_destroy(sim);
  return NULL;
}

/* No rank goes on from cached stages that another one has lost, as newmark does. */
static void ranks_go_on_after_a_force_failed(void **state) {
  (void)state;
  const char *methods[] = {"velocity-verlet", "newmark", "bdf2", "tr-bdf2"};
  const msim_force_function function = {.size = sizeof function,
                                        .name = "fails in retries",
                                        .evaluate = fail_in_retry,
                                        .potential = no_potential};
  msim_scene *cloth = hanging_cloth(9, 4000, 0);
  assert_ok(msim_scene_set_force_function(cloth, &function, err));
  for (size_t i = 0; i < sizeof methods / sizeof *methods; i++) {
    run r = {.scene = cloth, .opt = options(methods[i], 1e-4)};
    r.opt.newton_retries = 1;
    const char *wrong = run_ranks(3, check_failed_force, &r);
    if (wrong) fail_msg("%s: %s", methods[i], wrong);
  }
  msim_scene_destroy(cloth);
}

/*------------------------------------- stop and observers ---------------------------------------*/

typedef struct stop_case {
  const msim_scene *scene;
  int32_t rank;    /* that asks to stop */
  int by_observer; /* 1: its observer does; 0: msim_sim_stop in the observer of frame 3 */
  int only_one;    /* 1: no other rank has an observer */
  atomic_int frames[MOST_RANKS];
} stop_case;

typedef struct watcher {
  stop_case *of;
  int32_t rank;
} watcher;

static int watch(msim_sim *sim, void *user) {
  const watcher *w = user;
  const int frame = atomic_fetch_add(&w->of->frames[w->rank], 1) + 1;
  if (w->rank != w->of->rank || frame != 3) return 0;
  if (!w->of->by_observer) msim_sim_stop(sim);
  return w->of->by_observer;
}

static const char *check_stop(msim_comm *comm, void *data) {
  stop_case *c = data;
  watcher w = {c, comm->rank};
  msim_options opt = options("velocity-verlet", 1e-4);
  msim_sim *sim;
  msim_error why;
  msim_state s = {.size = sizeof s};
  const int has_observer = !c->only_one || comm->rank == c->rank;
  opt.steps = 100, opt.every = 10, opt.comm = comm;
  EXPECT(msim_sim_create(c->scene, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_run(sim, has_observer ? watch : NULL, &w, &why) == MSIM_STOPPED);
  EXPECT(msim_sim_state(sim, &s) == MSIM_OK);
  EXPECT(s.step == (c->by_observer ? 20 : 21));
  EXPECT(msim_sim_run(sim, has_observer ? watch : NULL, &w, &why) == MSIM_OK);
  EXPECT(msim_sim_state(sim, &s) == MSIM_OK && s.step == 100);
  EXPECT(c->frames[comm->rank] == (has_observer ? 11 : 0));
  msim_sim_destroy(sim);
  return NULL;
}

static void ranks_stop_together(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(9, 100, 0);
  for (int kind = 0; kind < 12; kind++) {
    stop_case c = {.scene = cloth, .rank = kind / 4, .by_observer = kind & 1, .only_one = kind & 2};
    const char *wrong = run_ranks(3, check_stop, &c);
    if (wrong) fail_msg("kind %d: %s", kind, wrong);
  }
  msim_scene_destroy(cloth);
}

/*------------------------------------- rest -----------------------------------------------------*/

typedef struct rest_case {
  const msim_scene *scene;
  double tol;
  int64_t at_rest; /* steps, of 50 */
} rest_case;

static const char *check_rest(msim_comm *comm, void *data) {
  const rest_case *c = data;
  msim_options opt = options("velocity-verlet", 1e-3);
  opt.tol = c->tol;
  msim_sim *sim;
  msim_error why;
  msim_stats stats = {.size = sizeof stats};
  opt.comm = comm;
  EXPECT(msim_sim_create(c->scene, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_step(sim, 50, &why) == MSIM_OK);
  EXPECT(msim_sim_stats(sim, &stats) == MSIM_OK);
  EXPECT(stats.steps == 50 && stats.steps_at_rest == c->at_rest);
  msim_sim_destroy(sim);
  return NULL;
}

static void ranks_rest_together(void **state) {
  (void)state;
  msim_scene *rest = pinned_block(5, 1, 100, 0);
  const double none[3] = {0, 0, 0}, push[3] = {0.01, 0, 0};
  assert_ok(msim_scene_set_gravity(rest, none, err));
  for (int32_t n = 1; n <= 4; n++) {
    const char *wrong = run_ranks(n, check_rest, &(rest_case){rest, n % 2 * 1e-5, 49});
    if (wrong) fail_msg("%d ranks: %s", n, wrong);
  }
  double *force = calloc(3 * 125, sizeof *force);
  assert_non_null(force);
  memcpy(force + 3 * 124, push, sizeof push); /* one particle moves, and then its neighbours */
  assert_ok(msim_scene_set_forces(rest, force, err));
  const char *wrong = run_ranks(4, check_rest, &(rest_case){rest, 0, 0});
  if (wrong) fail_msg("%s", wrong);
  free(force);
  msim_scene_destroy(rest);
}

/*------------------------------------- the energy monitor ---------------------------------------*/

static const char *check_monitor(msim_comm *comm, void *data) {
  const msim_sim *alone = data;
  const ms_energy_monitor *a = &alone->monitor;
  const msim_scene scene = {.data = alone->scene};
  msim_options opt = options("velocity-verlet", 1e-4);
  msim_sim *sim;
  msim_error why;
  opt.comm = comm;
  EXPECT(msim_sim_create(&scene, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_step(sim, 160, &why) == MSIM_OK);
  const ms_energy_monitor *b = &sim->monitor;
  EXPECT(fabs(b->start_bound - a->start_bound) <= 1e-12 * a->start_bound);
  EXPECT(fabs(b->energy_bound - a->energy_bound) <= 1e-12 * a->energy_bound);
  EXPECT(b->extent == a->extent && b->least_mass == a->least_mass);
  EXPECT(b->good.step == 160);
  msim_sim_destroy(sim);
  return NULL;
}

/* Energies, masses, forces, heights and depths are those of all ranks. */
static void bounds_of_energy_are_those_of_one_process(void **state) {
  (void)state;
  msim_scene *scene = random_mesh(200, 6, 0.01);
  double force[600];
  for (int i = 0; i < 600; i++) force[i] = 1e-3 * (i % 7 - 3);
  plane(scene, 0, 0, 1, 0.02, 0.5, 0.4);
  plane(scene, 0, 0, 1, -0.5, 0.5, 0.4);
  assert_ok(msim_scene_set_forces(scene, force, err));
  const msim_options opt = options("velocity-verlet", 1e-4);
  msim_sim *alone = make_sim(scene, &opt);
  assert_ok(msim_sim_step(alone, 160, err));
  for (int32_t n = 2; n <= 4; n++) {
    const char *wrong = run_ranks(n, check_monitor, alone);
    if (wrong) fail_msg("%d ranks: %s", n, wrong);
  }
  msim_sim_destroy(alone);
  msim_scene_destroy(scene);
}

/*------------------------------------- want of memory -------------------------------------------*/

/* Each rank has a scene of its own; the allocation `fail_at` of rank `rank` fails. */
typedef struct memory_case {
  const char *method;
  double tol; /* > 0: without planes */
  int32_t rank;
  int64_t fail_at;
  atomic_int succeeded;
} memory_case;

static msim_scene *small_scene(const msim_allocator *alloc, int has_obstacles) {
  const double x[24] = {0, 0, 0, 1, 0, 0, 2, 0, 0, 3, 0, 0, 4, 0, 0, 5, 0, 1, 6, 0, 0, 7, 0, 0},
               mass[8] = {1, 1, 1, 1, 1, 1, 1, 1}, k[8] = {9, 9, 9, 9, 9, 9, 9, 9}, t[1] = {0};
  const int32_t ij[16] = {0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 1, 3}, angle[3] = {3, 4, 5},
                pin = 0, spring = 3;
  const msim_law law = {.size = sizeof law, .kind = MSIM_LAW_TENSION};
  const msim_motion motion = {
      .size = sizeof motion, .n = 1, .particles = &pin, .nt = 1, .t = t, .x = x};
  const msim_plane ground = {{0, 0, 1}, -1, 0.5, 0};
  const msim_collider ball = {
      .size = sizeof ball, .type = MSIM_COLLIDER_SPHERE, .center = {3, 0, -1}, .radius = 0.5};
  msim_scene *scene;
  int32_t index;
  if (msim_scene_create(alloc, &scene, NULL) ||
      msim_scene_add_particles(scene, 8, x, NULL, mass, NULL) ||
      msim_scene_add_springs(scene, 8, ij, k, NULL, NULL, NULL) ||
      msim_scene_add_angles(scene, 1, angle, k, NULL, NULL, NULL) ||
      msim_scene_add_law(scene, &law, &index, NULL) ||
      msim_scene_set_law(scene, 1, &spring, index, NULL) || msim_scene_pin(scene, 1, &pin, NULL) ||
      msim_scene_add_motion(scene, &motion, NULL) ||
      (has_obstacles &&
       (msim_scene_add_plane(scene, &ground, NULL) || msim_scene_add_collider(scene, &ball, NULL))))
    return NULL;
  return scene;
}

/* Also by loading a checkpoint, in which the allocation `fail_at` may be */
static msim_status make_and_load(const msim_scene *scene, const msim_options *opt, msim_sim **sim,
                                 msim_error *why) {
  char bytes[8192];
  size_t length;
  msim_status status = msim_sim_create(scene, opt, sim, why);
  if (status) return status;
  if (msim_sim_step(*sim, 2, why) || msim_sim_save(*sim, bytes, sizeof bytes, &length, why))
    return MSIM_ERR_ARG;
  status = msim_sim_load(*sim, bytes, length, why);
  if (!status) return MSIM_OK;
  if (msim_sim_step(*sim, 1, NULL)) return MSIM_ERR_ARG; /* the sim is as before */
  msim_sim_destroy(*sim);
  *sim = NULL;
  return status;
}

static const char *check_memory(msim_comm *comm, void *data) {
  memory_case *c = data;
  counting_allocator count = {.fail_at = -1};
  msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free, &count};
  msim_scene *scene = small_scene(&alloc, c->tol == 0);
  msim_options opt = options(c->method, 1e-3);
  msim_sim *sim = NULL;
  msim_error why = {0};
  EXPECT(scene);
  opt.comm = comm, opt.threads = 1, opt.tol = c->tol;
  if (comm->rank == c->rank) count.fail_at = count.calls + c->fail_at;
  const int64_t before = count.live;
  const msim_status status = make_and_load(scene, &opt, &sim, &why);
  count.fail_at = -1;
  EXPECT(status == MSIM_OK || status == MSIM_ERR_MEMORY);
  EXPECT(!status == !!sim && (!status || strstr(why.text, "out of memory")));
  if (!status) {
    EXPECT(msim_sim_step(sim, 10, &why) == MSIM_OK);
    if (comm->rank == 0) c->succeeded = 1;
  }
  msim_sim_destroy(sim);
  EXPECT(count.live == before);
  msim_scene_destroy(scene);
  EXPECT(count.live == 0);
  return NULL;
}

static void check_allocations(const char *method, double tol, int32_t nranks, int32_t rank) {
  memory_case c = {.method = method, .tol = tol, .rank = rank};
  for (; !c.succeeded; c.fail_at++) {
    const char *wrong = run_ranks(nranks, check_memory, &c);
    if (wrong) fail_msg("%s, %d ranks, allocation %d: %s", method, nranks, (int)c.fail_at, wrong);
  }
  assert_true(c.fail_at > 60);
}

static void each_allocation_that_fails_is_a_failure_on_all_ranks(void **state) {
  (void)state;
  for (int32_t n = 2; n <= 3; n++)
    for (int32_t rank = 0; rank < n; rank++) {
      check_allocations("velocity-verlet", 0, n, rank);
      check_allocations("linearly-implicit-euler", 0, n, rank);
      check_allocations("bdf2", 0, n, rank);
      check_allocations("rk4", 1e-6, n, rank);
    }
}

/*------------------------------------- states ---------------------------------------------------*/

/* From the state of one process, also with v(t - h/2) */
static const char *check_states(msim_comm *comm, void *data) {
  const run *r = data;
  msim_options opt = r->opt;
  msim_sim *sim;
  msim_error why = {0};
  msim_state wrong = r->expected;
  opt.comm = comm;
  EXPECT(msim_sim_create(r->scene, &opt, &sim, &why) == MSIM_OK);
  wrong.t = comm->rank == 1 ? INFINITY : 0;
  EXPECT(msim_sim_set_state(sim, &wrong, &why) == MSIM_ERR_ARG);
  EXPECT(strstr(why.text, "must be finite"));
  EXPECT(msim_sim_set_state(sim, &r->expected, &why) == MSIM_OK);
  const char *other = compare_with_run(sim, r);
  msim_sim_destroy(sim);
  return other;
}

static void states_are_set_on_all_ranks(void **state) {
  (void)state;
  const char *methods[] = {"velocity-verlet", "verlet"};
  msim_scene *cloth = hanging_cloth(11, 300, 0);
  for (int i = 0; i < 2; i++) {
    run r = run_alone(cloth, options(methods[i], 1e-4), 30);
    const char *wrong = run_ranks(3, check_states, &r);
    if (wrong) fail_msg("%s: %s", methods[i], wrong);
    free_run(&r);
  }
  msim_scene_destroy(cloth);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(events_are_those_of_one_process),
      cmocka_unit_test(ranks_go_on_after_a_force_failed),
      cmocka_unit_test(ranks_stop_together),
      cmocka_unit_test(ranks_rest_together),
      cmocka_unit_test(bounds_of_energy_are_those_of_one_process),
      cmocka_unit_test(each_allocation_that_fails_is_a_failure_on_all_ranks),
      cmocka_unit_test(states_are_set_on_all_ranks),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
