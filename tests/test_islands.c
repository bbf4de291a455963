/* Tests of islands: components that no spring connects move bit by bit as each does alone; one at
 * rest is not stepped; after a failure in one, all keep their states. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "counting_allocator.h"
#include "scenes.h"
#include "sim/sim.h"

enum { SIDE = 24, N = SIDE * SIDE, MOST = 6 * N, STEPS = 12 };
enum { APART, INTERLEAVED, SHARED_PIN, KINDS };

/* A cloth pinned at two corners, and its arrays. */
typedef struct body {
  double x[3 * N], v[3 * N], mass[N], k[MOST], rest[MOST], damping[MOST];
  int32_t ij[2 * MOST], nsprings;
} body;

static body cloth(double k, double stretch, double damping, double speed) {
  static body b;
  msim_scene *like = hanging_cloth(SIDE, k, damping);
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(like, &view);
  assert_in_range(view.nsprings, 1, MOST);
  b.nsprings = view.nsprings;
  memcpy(b.x, view.x, sizeof b.x);
  memcpy(b.mass, view.mass, sizeof b.mass);
  memcpy(b.ij, view.ij, 2 * (size_t)view.nsprings * sizeof *b.ij);
  for (int32_t e = 0; e < view.nsprings; e++)
    b.k[e] = view.k[e], b.rest[e] = stretch * view.rest[e], b.damping[e] = view.damping[e];
  for (int p = 0; p < N; p++) {
    const double sway = view.pinned[p] ? 0 : speed * sin(0.37 * p);
    b.v[3 * p] = 0.3 * sway, b.v[3 * p + 1] = sway, b.v[3 * p + 2] = 0;
  }
  msim_scene_destroy(like);
  return b;
}

/* The index of a particle of the first or second body in the scene of both. */
static int32_t place(int kind, int second, int32_t p) {
  if (kind == INTERLEAVED) return 2 * p + second;
  if (kind == SHARED_PIN && second) return p == 0 ? 0 : N + p - 1;
  return second * N + p;
}

static void add_spring(msim_scene *scene, const body *b, int kind, int second, int32_t e) {
  const int32_t ij[2] = {place(kind, second, b->ij[2 * e]), place(kind, second, b->ij[2 * e + 1])};
  if (e < b->nsprings)
    assert_ok(msim_scene_add_springs(scene, 1, ij, b->k + e, b->rest + e, b->damping + e, err));
}

static msim_scene *join(const msim_allocator *alloc, int kind, const body *const bodies[2],
                        const double gravity[3]) {
  static double x[6 * N], v[6 * N], mass[2 * N];
  const int count = bodies[1] ? 2 : 1;
  msim_scene *scene;
  for (int32_t p = 0; p < count * N; p++) {
    const body *b = bodies[p / N];
    const int32_t from = p % N, to = place(kind, p / N, from);
    memcpy(x + 3 * to, b->x + 3 * from, 3 * sizeof *x);
    memcpy(v + 3 * to, b->v + 3 * from, 3 * sizeof *v);
    mass[to] = b->mass[from];
  }
  assert_ok(msim_scene_create(alloc, &scene, err));
  assert_ok(msim_scene_add_particles(scene, count * N - (count == 2 && kind == SHARED_PIN), x, v,
                                     mass, err));
  for (int32_t e = 0; e < count * MOST; e++) {
    const int second = count == 1 ? 0 : kind == INTERLEAVED ? e % 2 : e / MOST;
    add_spring(scene, bodies[second], kind, second,
               count == 2 && kind == INTERLEAVED ? e / 2 : e % MOST);
  }
  for (int second = 0; second < count; second++) {
    const int32_t pins[2] = {place(kind, second, 0), place(kind, second, SIDE - 1)};
    assert_ok(msim_scene_pin(scene, 2, pins, err));
  }
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  return scene;
}

static const double down[3] = {0, 0, -9.81}, along[3] = {0, 9.81, 0}, none[3] = {0, 0, 0};

/* a single body has the first indices of APART */
static msim_scene *alone(const body *b, const double gravity[3]) {
  return join(NULL, APART, (const body *const[2]){b, NULL}, gravity);
}

static msim_scene *both(int kind, const body *a, const body *b, const double gravity[3]) {
  return join(NULL, kind, (const body *const[2]){a, b}, gravity);
}

static msim_options lean(const char *method) {
  msim_options opt = options(method, is_implicit(method) ? 2e-3 : 1e-4);
  opt.newton_rtol = 1e-13;
  opt.jacobian = MSIM_JACOBIAN_CLAMP;
  return opt;
}

static msim_sim *together(const msim_scene *scene, msim_options opt) {
  assert_ok(msim_options_set(&opt, "skip.islands", "off", err));
  return make_sim(scene, &opt);
}

static void same_as_alone(msim_sim *sim, int kind, int second, msim_sim *single) {
  const msim_state s = state_of(sim), t = state_of(single);
  for (int32_t p = 0; p < N; p++) {
    const int32_t at = 3 * place(kind, second, p);
    assert_memory_equal(s.x + at, t.x + 3 * p, 3 * sizeof *s.x);
    assert_memory_equal(s.v + at, t.v + 3 * p, 3 * sizeof *s.v);
    if (s.v_half) assert_memory_equal(s.v_half + at, t.v_half + 3 * p, 3 * sizeof *s.v);
  }
}

static void push(msim_sim *sim) {
  static double v[6 * N];
  msim_state s = state_of(sim);
  for (int32_t i = 0; i < 3 * s.n; i++) v[i] = 2 * s.v[i];
  s.v = v, s.v_half = NULL;
  assert_ok(msim_sim_set_state(sim, &s, err));
}

static void move_as_alone(const char *method, const double gravity[3], int kind, const body *a,
                          const body *b) {
  const msim_options opt = lean(method);
  msim_scene *scenes[3] = {both(kind, a, b, gravity), alone(a, gravity), alone(b, gravity)};
  msim_sim *sims[3];
  for (int i = 0; i < 3; i++) sims[i] = make_sim(scenes[i], &opt);
  assert_int_equal(sims[0]->nislands, 2);
  for (int round = 0; round < 3; round++) {
    for (int i = 0; i < 3; i++) {
      assert_ok(msim_sim_step(sims[i], STEPS / 2, err));
      if (round == 0) assert_ok(msim_sim_set_step(sims[i], opt.h / 2, err));
      if (round == 1) push(sims[i]);
    }
    same_as_alone(sims[0], kind, 0, sims[1]);
    same_as_alone(sims[0], kind, 1, sims[2]);
  }
  const msim_stats s = stats_of(sims[0]), t = stats_of(sims[1]), u = stats_of(sims[2]);
  assert_int_equal(s.iterations, t.iterations + u.iterations);
  assert_int_equal(s.force_evaluations, t.force_evaluations + u.force_evaluations);
  for (int i = 0; i < 3; i++) msim_sim_destroy(sims[i]), msim_scene_destroy(scenes[i]);
}

/* All rest lengths of the second body are 0, so that its matrix has scalar blocks. */
static void each_moves_as_alone(void **state) {
  (void)state;
  static body a, b;
  a = cloth(100, 1, 0.01, 1), b = cloth(50, 0, 0, 0.5);
  const msim_integrator_entry *method;
  for (int32_t i = 0; (method = msim_integrator_info(i)) != NULL; i++)
    for (int kind = 0; kind < KINDS && method->order > 0 && !takes_positions_only(method->name);
         kind++)
      for (int flat = 0;
           flat < (kind == APART ? 2 : 1) && !(HAS_ADDRESS_SANITIZER && (i + kind) % 3); flat++)
        move_as_alone(method->name, flat ? along : down, kind, &a, &b);
}

/* msim_sim_force(), msim_sim_matrix() and msim_sim_explain() treat the scene as one system. */
static void queries_return_the_whole_system(void **state) {
  (void)state;
  static double f[6 * N], g[6 * N];
  static body a, b;
  a = cloth(100, 1, 0.01, 1), b = cloth(50, 0, 0, 0.5);
  for (int kind = 0; kind < KINDS; kind++) {
    msim_scene *scene = both(kind, &a, &b, down);
    const msim_options opt = lean("linearly-implicit-euler");
    msim_sim *sim = make_sim(scene, &opt), *one = together(scene, opt);
    msim_csr A = {.size = sizeof A}, B = {.size = sizeof B};
    assert_int_equal(one->nislands, 1);
    assert_int_equal(sim->islands[0].stepper.solver->system.a.block, 3);
    assert_int_equal(sim->islands[1].stepper.solver->system.a.block, 1);
    const msim_state s = state_of(sim);
    msim_sim_force(sim, s.x, s.v, f), msim_sim_force(one, s.x, s.v, g);
    /* with rest length 0 a spring's direction is not computed, so that last bits differ */
    for (int i = 0; i < 3 * s.n; i++) assert_close(f[i], g[i], 1e-13 * (1 + fabs(g[i])));
    assert_ok(msim_sim_matrix(sim, &A, err));
    assert_ok(msim_sim_matrix(one, &B, err));
    assert_memory_equal(A.rowptr, B.rowptr, (size_t)(A.n + 1) * sizeof *A.rowptr);
    for (int32_t e = 0; e < A.rowptr[A.n]; e++) assert_true(A.val[e] == B.val[e]);
    const char *text;
    assert_ok(msim_sim_explain(sim, &text, err));
    assert_non_null(strstr(text, "islands       2, not connected by springs, with 574 free"));
    assert_non_null(strstr(text, "a common system: each island has its own"));
    assert_ok(msim_sim_explain(one, &text, err));
    assert_null(strstr(text, "islands"));
    msim_sim_destroy(sim), msim_sim_destroy(one);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- islands at rest ------------------------------------------*/

/* The second body is at its rest lengths without gravity, until it is pushed or its springs
 * change. */
static void one_rests_while_the_other_moves(void **state) {
  (void)state;
  static body a, b;
  a = cloth(100, 1, 0, 1), b = cloth(100, 1, 0, 0);
  const msim_integrator_entry *method;
  for (int32_t i = 0; (method = msim_integrator_info(i)) != NULL; i++) {
    if (method->order == 0 || takes_positions_only(method->name)) continue;
    static double rest[2 * MOST];
    msim_scene *scene = both(APART, &a, &b, none);
    msim_options opt = lean(method->name);
    opt.solver_rtol = 1e-13;
    msim_sim *sim = make_sim(scene, &opt), *one = together(scene, opt);
    for (int round = 0; round < 3; round++) {
      assert_ok(msim_sim_step(sim, STEPS, err));
      assert_ok(msim_sim_step(one, STEPS, err));
      const msim_state s = state_of(sim), t = state_of(one);
      for (int q = 0; q < 3 * s.n; q++) {
        assert_close(s.x[q], t.x[q], method->implicit ? 1e-12 : 0);
        assert_close(s.v[q], t.v[q], method->implicit ? 1e-10 : 0);
      }
      assert_int_equal(s.x[3 * (N + 1)] != b.x[3], round == 2);
      const int rested = round == 0 ? STEPS - 1 : 2 * (STEPS - 1);
      assert_int_equal(stats_of(sim).islands_at_rest, rested);
      assert_int_equal(stats_of(sim).steps_at_rest, 0);
      for (int32_t e = 0; e < b.nsprings; e++)
        rest[e] = a.rest[e], rest[b.nsprings + e] = b.rest[e];
      if (round == 1) rest[b.nsprings] *= 2;
      assert_ok(msim_sim_set_springs(sim, NULL, rest, NULL, err));
      assert_ok(msim_sim_set_springs(one, NULL, rest, NULL, err));
    }
    assert_int_equal(stats_of(one).islands_at_rest, 0);
    if (stats_of(sim).newton_iterations == 0) assert_true(stats_of(sim).solves < 2 * 3 * STEPS);
    msim_sim_destroy(sim), msim_sim_destroy(one);
    msim_scene_destroy(scene);
  }
}

/* If all islands rest, none is stepped, until a state with a velocity is set. */
static void all_may_rest(void **state) {
  (void)state;
  static body a;
  a = cloth(100, 1, 0, 0);
  msim_scene *scene = both(INTERLEAVED, &a, &a, none);
  const msim_options opt = lean("linearly-implicit-euler");
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 10, err));
  assert_int_equal(stats_of(sim).steps, 10);
  assert_int_equal(stats_of(sim).steps_at_rest, 9);
  assert_int_equal(stats_of(sim).islands_at_rest, 18);
  assert_int_equal(stats_of(sim).solves, 2);
  static double v[6 * N];
  msim_state s = state_of(sim);
  v[3 * place(INTERLEAVED, 1, 30)] = 1;
  s.v = v;
  assert_ok(msim_sim_set_state(sim, &s, err));
  assert_ok(msim_sim_step(sim, 10, err));
  assert_int_equal(stats_of(sim).steps_at_rest, 9);
  assert_int_equal(stats_of(sim).islands_at_rest, 18 + 9);
  assert_true(state_of(sim).x[3 * place(INTERLEAVED, 1, 31)] != a.x[3 * 31]);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- solvers --------------------------------------------------*/

/* A soft cloth needs as many iterations as it does alone, whatever else the scene contains. */
static void iterations_are_those_of_each(void **state) {
  (void)state;
  static body soft, stiff;
  soft = cloth(1, 1, 0, 1), stiff = cloth(1e5, 1, 0, 1);
  msim_scene *scene = both(INTERLEAVED, &soft, &stiff, down), *single = alone(&soft, down);
  msim_options opt = lean("linearly-implicit-euler");
  opt.solver = "pcg";
  msim_sim *sim = make_sim(scene, &opt), *one = together(scene, opt);
  msim_sim *easy = make_sim(single, &opt);
  assert_ok(msim_sim_step(sim, STEPS, err));
  assert_ok(msim_sim_step(one, STEPS, err));
  assert_ok(msim_sim_step(easy, STEPS, err));
  const int64_t hard = stats_of(sim).iterations - stats_of(easy).iterations;
  assert_true(3 * stats_of(easy).iterations < hard);
  /* each on half of the unknowns */
  assert_true(4 * stats_of(sim).iterations < 3 * 2 * stats_of(one).iterations);
  msim_sim_destroy(sim), msim_sim_destroy(one), msim_sim_destroy(easy);
  msim_scene_destroy(scene), msim_scene_destroy(single);
}

/* The step of the first island succeeds, that of the second fails: neither changes, and the message
 * names the particle. */
static void one_that_fails_stops_all(void **state) {
  (void)state;
  static const char *const methods[] = {"velocity-verlet", "rk4", "linearly-implicit-euler"};
  static double x[6 * N], v[6 * N];
  static body a, b;
  a = cloth(100, 1, 0, 1);
  for (int m = 0; m < 3; m++) {
    const int implicit = m == 2;
    b = cloth(implicit ? 1e5 : 1e9, implicit ? 2 : 1, 0, 1);
    msim_scene *scene = both(APART, &a, &b, down);
    msim_options opt = lean(methods[m]);
    opt.jacobian = MSIM_JACOBIAN_EXACT, opt.indefinite = MSIM_INDEFINITE_STOP;
    opt.watch = MSIM_WATCH_OFF;
    msim_sim *sim = make_sim(scene, &opt);
    msim_error why;
    msim_status status;
    do {
      memcpy(x, state_of(sim).x, sizeof x), memcpy(v, state_of(sim).v, sizeof v);
      status = msim_sim_step(sim, 1, &why);
    } while (!status && state_of(sim).step < 1000);
    const int64_t step = state_of(sim).step;
    assert_int_equal(status, implicit ? MSIM_NOT_SPD : MSIM_NOT_FINITE);
    for (int again = 0; again < 2; again++) {
      const char *particle = strstr(why.text, "particle ");
      assert_non_null(particle);
      assert_in_range(strtol(particle + strlen("particle "), NULL, 10), N, 2 * N - 1);
      assert_memory_equal(state_of(sim).x, x, sizeof x);
      assert_memory_equal(state_of(sim).v, v, sizeof v);
      assert_int_equal(state_of(sim).step, step);
      assert_int_equal(stats_of(sim).steps, step);
      assert_int_equal(msim_sim_step(sim, 1, &why), status);
    }
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

static void threads_change_no_bit(void **state) {
  (void)state;
  static const char *const methods[] = {"velocity-verlet", "linearly-implicit-euler"};
  static body a, b;
  a = cloth(100, 1, 0.01, 1), b = cloth(5000, 1, 0, 1);
  for (int m = 0; m < 2; m++) {
    msim_scene *scene = both(SHARED_PIN, &a, &b, down);
    msim_options opt = lean(methods[m]);
    msim_sim *sims[3];
    for (int i = 0; i < 3; i++) {
      opt.threads = i + 1;
      sims[i] = make_sim(scene, &opt);
      assert_ok(msim_sim_step(sims[i], STEPS, err));
      const msim_state s = state_of(sims[i]), t = state_of(sims[0]);
      assert_memory_equal(s.x, t.x, 3 * (size_t)s.n * sizeof *s.x);
      assert_memory_equal(s.v, t.v, 3 * (size_t)s.n * sizeof *s.v);
    }
    for (int i = 0; i < 3; i++) msim_sim_destroy(sims[i]);
    msim_scene_destroy(scene);
  }
}

enum { MANY = 7, RESTING = 1, BROKEN = 4 };

/* Similar cloths over a plane, without gravity. */
static msim_scene *many(void) {
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int i = 0; i < MANY; i++) {
    const msim_cloth c = {.size = sizeof c,
                          .rows = SIDE,
                          .columns = SIDE,
                          .origin = {2 * i, 0, 0},
                          .row = {0, 1, 0},
                          .column = {1, 0, 0},
                          .mass = 0.3,
                          .k_structural = 100,
                          .k_shear = 50 + i};
    assert_ok(msim_scene_add_cloth(scene, &c, err));
  }
  plane(scene, 0, 0, 1, -1e-4, 0.5, 0.1);
  return scene;
}

/* Some steps in which all but one of them move. */
static msim_sim *run_many(const msim_scene *scene, const char *method, int32_t threads) {
  static double v[3 * MANY * N];
  msim_options opt = lean(method);
  opt.threads = threads, opt.newton_retries = 2;
  msim_sim *sim = make_sim(scene, &opt);
  assert_int_equal(sim->any_single_thread, threads > 1);
  for (int p = 0; p < MANY * N; p++) v[3 * p + 2] = p / N == RESTING ? 0 : sin(0.37 * p);
  msim_state s = state_of(sim);
  s.v = v, s.v_half = NULL;
  assert_ok(msim_sim_set_state(sim, &s, err));
  assert_ok(msim_sim_step(sim, STEPS, err));
  return sim;
}

static void same_run(msim_sim *sim, msim_sim *by_one_thread) {
  const msim_state s = state_of(sim), t = state_of(by_one_thread);
  const msim_stats a = stats_of(sim), b = stats_of(by_one_thread);
  assert_memory_equal(s.x, t.x, 3 * MANY * N * sizeof *s.x);
  assert_memory_equal(s.v, t.v, 3 * MANY * N * sizeof *s.v);
  assert_int_equal(a.islands_at_rest, STEPS - 1);
  assert_int_equal(a.force_evaluations, b.force_evaluations);
  assert_int_equal(a.contacts, b.contacts);
  assert_true(a.contacts > 0 && a.force_s > 0 && a.collide_s > 0);
  assert_true(a.force_s + a.collide_s <= a.total_s);
}

/* A velocity that overflows in a step that is too long. */
static msim_error break_one(msim_sim *sim) {
  static double v[3 * MANY * N];
  msim_error why;
  msim_state s = state_of(sim);
  v[3 * (BROKEN * N + 50)] = 9e139;
  s.v = v, s.v_half = NULL;
  assert_ok(msim_sim_set_state(sim, &s, err));
  assert_ok(msim_sim_set_step(sim, 1, err));
  assert_int_equal(msim_sim_step(sim, 3, &why), MSIM_NOT_FINITE);
  assert_int_equal(strtol(strstr(why.text, "particle ") + 9, NULL, 10) / N, BROKEN);
  return why;
}

/* Small islands stepped by several threads: motion, counts and errors are those of one thread. */
static void small_islands_are_shared_out(void **state) {
  (void)state;
  const msim_integrator_entry *method;
  msim_scene *scene = many();
  for (int32_t i = 0; (method = msim_integrator_info(i)) != NULL; i++) {
    msim_sim *sims[3];
    msim_error why[3];
    const int runs = !takes_positions_only(method->name) && !refuses_planes(method->name);
    if (method->order == 0 || method->implicit || !runs) continue;
    for (int t = 0; t < 3; t++) sims[t] = run_many(scene, method->name, t + 1);
    for (int t = 0; t < 3; t++) same_run(sims[t], sims[0]);
    for (int t = 0; t < 3; t++) {
      why[t] = break_one(sims[t]);
      assert_string_equal(why[t].text, why[0].text);
      assert_int_equal(stats_of(sims[t]).force_evaluations, stats_of(sims[0]).force_evaluations);
      assert_int_equal(stats_of(sims[t]).rejected_steps, 2);
      assert_memory_equal(state_of(sims[t]).x, state_of(sims[0]).x, 3 * MANY * N * sizeof(double));
    }
    for (int t = 0; t < 3; t++) msim_sim_destroy(sims[t]);
  }
  msim_scene_destroy(scene);
}

/*------------------------------------- memory ---------------------------------------------------*/

static void every_allocation_may_fail(void **state) {
  (void)state;
  static body a;
  a = cloth(100, 1, 0, 1);
  counting_allocator b = {.fail_at = -1};
  const msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free,
                                &b};
  msim_scene *scene = join(&alloc, INTERLEAVED, (const body *const[2]){&a, &a}, down);
  const int64_t live = b.live;
  msim_options opt = lean("linearly-implicit-euler");
  opt.solver = "pcg", opt.threads = 2;
  msim_sim *sim;
  int64_t failures = 0;
  /* a sim that cannot start all threads uses fewer */
  for (b.fail_at = b.calls = 0; b.calls >= b.fail_at; b.fail_at++) {
    b.calls = 0;
    if (msim_sim_create(scene, &opt, &sim, NULL)) failures++;
    else msim_sim_destroy(sim);
    assert_int_equal(b.live, live);
  }
  assert_in_range(failures, 100, 400);
  msim_scene_destroy(scene);
  assert_int_equal(b.live, 0);
}

/* Either the solvers of both islands are replaced, or none. */
static void a_change_that_fails_changes_nothing(void **state) {
  (void)state;
  static double zeros[2 * MOST];
  static body a;
  a = cloth(100, 1, 0, 1);
  counting_allocator b = {.fail_at = -1};
  const msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free,
                                &b};
  msim_scene *scene = join(&alloc, INTERLEAVED, (const body *const[2]){&a, &a}, down);
  msim_options opt = lean("linearly-implicit-euler");
  opt.solver = "pcg";
  msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &opt);
  const int64_t live = b.live;
  int64_t failures = 0;
  for (b.fail_at = b.calls; msim_sim_set_springs(sim, NULL, zeros, NULL, NULL);
       b.fail_at = b.calls + failures) {
    failures++;
    assert_int_equal(b.live, live);
    for (int i = 0; i < 2; i++) assert_int_equal(sim->islands[i].stepper.solver->system.a.block, 3);
    assert_ok(msim_sim_step(sim, 1, err));
    assert_ok(msim_sim_step(other, 1, err));
    assert_memory_equal(state_of(sim).x, state_of(other).x, 6 * N * sizeof(double));
  }
  assert_in_range(failures, 15, 100);
  for (int i = 0; i < 2; i++) assert_int_equal(sim->islands[i].stepper.solver->system.a.block, 1);
  assert_ok(msim_sim_step(sim, 2, err));
  msim_sim_destroy(sim), msim_sim_destroy(other);
  msim_scene_destroy(scene);
  assert_int_equal(b.live, 0);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(each_moves_as_alone),
                                     cmocka_unit_test(queries_return_the_whole_system),
                                     cmocka_unit_test(one_rests_while_the_other_moves),
                                     cmocka_unit_test(all_may_rest),
                                     cmocka_unit_test(iterations_are_those_of_each),
                                     cmocka_unit_test(one_that_fails_stops_all),
                                     cmocka_unit_test(threads_change_no_bit),
                                     cmocka_unit_test(small_islands_are_shared_out),
                                     cmocka_unit_test(every_allocation_may_fail),
                                     cmocka_unit_test(a_change_that_fails_changes_nothing)};
  return cmocka_run_group_tests_name("islands", tests, NULL, NULL);
}
