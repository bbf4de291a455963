/* Tests of stiff bodies on colliders on several ranks, collision = reflect: each step is that of
 * one process to the tolerance of the solver, and has the same bits in each run; energy does not
 * grow, and nothing ends inside.
 *
 * Rough solves decide which contacts there are, and how large friction is. They are those of one
 * process where bodies are too small for coarse spaces. With MS_ROUGH_RESIDUAL they are accurate,
 * so that larger bodies are tested, too. */
#include "force_functions.h"
#include "moving_colliders.h"
#include "rank_implicit.h"
#include "stiff_bodies.h"

enum { STEPS = 24, MOST = 256 };

static const char LINEAR[] = "linearly-implicit-euler";

/* At h omega = 100 a residual of RTOL leaves errors of 100 RTOL at most. */
static const double FINE = 1e-6;

/*------------------------------------- steps of one process -------------------------------------*/

/* A state, in memory of its own */
typedef struct snapshot {
  double x[3 * MOST], v[3 * MOST];
  msim_state state;
} snapshot;

static void take_snapshot(msim_sim *sim, snapshot *to) {
  const msim_state s = state_of(sim);
  to->state = s;
  memcpy(to->x, s.x, 3 * (size_t)s.n * sizeof *s.x);
  memcpy(to->v, s.v, 3 * (size_t)s.n * sizeof *s.v);
  to->state.x = to->x, to->state.v = to->v, to->state.v_half = NULL;
}

/* Steps of one process, each from a state that was set */
typedef struct recording {
  const msim_scene *scene;
  msim_options opt;
  double tolerance; /* of velocities, relative to the largest one */
  int is_exact; /* no particle is on a surface up to rounding, where it may be reflected or not */
  snapshot at[STEPS + 1];
  int64_t contacts, solves[STEPS]; /* in all; of each step */
  snapshot last;                   /* of a whole run on ranks */
} recording;

static int64_t difference(int64_t now, int64_t *before) {
  const int64_t since = now - *before;
  *before = now;
  return since;
}

static void record_steps(recording *r) {
  int64_t solves = 0;
  msim_sim *sim = make_sim(r->scene, &r->opt);
  take_snapshot(sim, &r->at[0]);
  for (int k = 0; k < STEPS; k++) {
    assert_ok(msim_sim_set_state(sim, &r->at[k].state, err));
    assert_ok(msim_sim_step(sim, 1, err));
    take_snapshot(sim, &r->at[k + 1]);
    r->solves[k] = difference(stats_of(sim).solves, &solves);
  }
  r->contacts = stats_of(sim).contacts;
  assert_true(r->contacts > 0);
  msim_sim_destroy(sim);
}

/*------------------------------------- the same on ranks ----------------------------------------*/

static double distance_of(const double *a, const double *b, int32_t n) {
  double off = 0;
  for (int32_t i = 0; i < 3 * n; i++) off = fmax(off, fabs(a[i] - b[i]));
  return off;
}

/* NULL: the state is the one that step k of one process has led to. */
static const char *compare_step(const recording *r, int k, const msim_state *s) {
  const msim_state *from = &r->at[k].state, *to = &r->at[k + 1].state;
  const double g = 9.81, h = r->opt.h,
               most = fmax(g * h, fmax(largest_of(from->v, s->n), largest_of(to->v, s->n)));
  const double energy = fmax(1, fabs(to->work));
  if (!(distance_of(s->x, to->x, s->n) <= r->tolerance * h * most)) return "other positions";
  if (!r->is_exact) return NULL;
  if (!(distance_of(s->v, to->v, s->n) <= r->tolerance * most)) return "other velocities";
  return fabs(s->work - to->work) <= 1e-6 * energy ? NULL : "other work";
}

static const char *check_steps(msim_comm *comm, void *data) {
  recording *r = data;
  msim_options opt = r->opt;
  msim_sim *sim = NULL;
  msim_error why = {0};
  int64_t solves = 0;
  opt.comm = comm;
  EXPECT(msim_sim_create(r->scene, &opt, &sim, &why) == MSIM_OK);
  for (int k = 0; k < STEPS; k++) {
    msim_state s = {.size = sizeof s};
    msim_stats stats = {.size = sizeof stats};
    char what[64];
    EXPECT(msim_sim_set_state(sim, &r->at[k].state, &why) == MSIM_OK);
    EXPECT(msim_sim_step(sim, 1, &why) == MSIM_OK && msim_sim_state(sim, &s) == MSIM_OK);
    EXPECT(msim_sim_stats(sim, &stats) == MSIM_OK);
    snprintf(what, sizeof what, "step %d", k);
    const char *wrong = compare_step(r, k, &s);
    const int is_linear = strcmp(opt.integrator, LINEAR) == 0;
    if (difference(stats.solves, &solves) != r->solves[k] && is_linear)
      wrong = "another number of solves";
    if (wrong) return fail_rank(comm, what, wrong);
    if (k + 1 == STEPS) /* particles on a surface up to rounding may count or not */
      EXPECT(llabs(stats.contacts - r->contacts) <= 3 + r->contacts / 5);
  }
  msim_sim_destroy(sim);
  return NULL;
}

/* A run without interruption has the bits of the one before by as many ranks. */
static const char *check_bits(msim_comm *comm, void *data) {
  recording *r = data;
  msim_options opt = r->opt;
  msim_sim *sim = NULL;
  msim_error why = {0};
  msim_state s = {.size = sizeof s};
  double unused = 0;
  opt.comm = comm;
  EXPECT(msim_sim_create(r->scene, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_step(sim, STEPS, &why) == MSIM_OK && msim_sim_state(sim, &s) == MSIM_OK);
  EXPECT(!r->last.state.n ||
         (has_same_bits(s.x, r->last.x, s.n) && has_same_bits(s.v, r->last.v, s.n)));
  comm->sum(comm->self, 1, &unused); /* all have compared */
  if (comm->rank == 0) take_snapshot(sim, &r->last);
  msim_sim_destroy(sim);
  return NULL;
}

static void check_scene(const char *name, msim_scene *scene, const char *method, double tolerance,
                        int is_exact) {
  recording *r = calloc(1, sizeof *r);
  assert_non_null(r);
  r->scene = scene, r->opt = options(method, 1. / 60), r->tolerance = tolerance,
  r->is_exact = is_exact;
  r->opt.solver = "pcg", r->opt.solver_rtol = r->opt.newton_rtol = RTOL;
  record_steps(r);
  const int is_linear = strcmp(method, LINEAR) == 0; /* others take many more messages */
  for (int32_t n = is_linear ? 1 : 3; n <= (is_linear ? 4 : 3); n++) {
    r->last.state.n = 0;
    const char *wrong = run_ranks(n, check_steps, r);
    for (int twice = 0; twice < 2 && n == 3 && !wrong; twice++) wrong = run_ranks(n, check_bits, r);
    if (wrong) fail_msg("%s, %s, %d ranks: %s", name, method, n, wrong);
  }
  free(r);
  msim_scene_destroy(scene);
}

#ifdef MS_ROUGH_RESIDUAL

static void bodies_with_coarse_spaces(void **state) {
  (void)state;
  /* in each of the two runs that are compared */
  check_scene("cloth on a sphere", stiff_body(0, 3000, 0.5, 0.3), LINEAR, 2 * FINE, 1);
  check_scene("stiff cloth on a box", stiff_body(1, 30000, 0, 0.3), LINEAR, FINE, 1);
  check_scene("stiff rope", stiff_body(2, 1e5, 0, 0), LINEAR, FINE, 1);
  check_scene("stiff jelly", stiff_body(3, 30000, 0.5, 0.3), LINEAR, FINE, 1);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(bodies_with_coarse_spaces)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}

#else

/* A tilted chain falls; its last particle, at its lower end, touches the plane at the start. */
static msim_scene *falling_chain(void) {
  enum { N = 30 };
  const double at[3] = {0}, along[3] = {0, 0.6, 0}, k = 3000, rest = 0.05;
  msim_scene *scene = new_scene();
  for (int32_t i = 0; i < N; i++) {
    const double x[3] = {-0.8 + rest * i, 0, 0.1 + 0.01 * (N - 1 - i)}, v[3] = {0, 0, -1},
                 mass = 0.2 / N;
    assert_ok(msim_scene_add_particles(scene, 1, x, v, &mass, err));
    if (i == 0) continue;
    assert_ok(msim_scene_add_springs(scene, 1, (int32_t[]){i - 1, i}, &k, &rest, NULL, err));
  }
  plane(scene, 0, 0, 1, 0.1, 0.5, 0.2);
  add(scene, round_bar(MSIM_COLLIDER_CAPSULE, at, along, 0.2, 0.5, 0.3), 0);
  return scene;
}

/* Colliders and planes at rest */
static void small_bodies(void **state) {
  (void)state;
  msim_scene *rope = stiff_body(2, 3000, 0.5, 0.3);
  plane(rope, 0, 0, 1, 0.05, 0.3, 0.2);
  check_scene("rope", rope, LINEAR, FINE, 1);
  check_scene("falling chain", falling_chain(), LINEAR, FINE, 1);
  check_scene("jelly", stiff_body(3, 3000, 0.5, 0.3), LINEAR, FINE, 1);
}

/* Their steps take some thousand messages. */
static void nonlinear_methods(void **state) {
  (void)state;
  check_scene("falling chain", falling_chain(), "implicit-euler", FINE, 1);
}

/* A capsule that moves and turns, a pin of one rank that moves, a force with a potential: their
 * energy and work are those of all ranks. */
static void work_on_one_rank(void **state) {
  (void)state;
  static const int32_t end = 29;
  const double at[3] = {0}, u[3] = {0.3, 0.1, 0.6}, w[3] = {0, 1, 2}, t[2] = {0, 0.5},
               x[6] = {0.6, 0, 0.5, 0.4, 0.2, -0.2};
  const msim_motion motion = {
      .size = sizeof motion, .n = 1, .particles = &end, .nt = 2, .t = t, .x = x};
  field of = gusts;
  of.push[0] = of.push[1] = of.push[2] = 0;
  msim_scene *moved = stiff_body(2, 3000, 0.5, 0.3), *pulled = stiff_body(2, 3000, 0.5, 0.3),
             *blown = stiff_body(2, 3000, 0.5, 0.3);
  set_uniform(moved, at, u, w);
  assert_ok(msim_scene_pin(pulled, 1, &end, err));
  assert_ok(msim_scene_add_motion(pulled, &motion, err));
  set_field(blown, &of, flags_for(LINEAR));
  check_scene("moving capsule", moved, LINEAR, FINE, 0);
  check_scene("moving pin", pulled, LINEAR, FINE, 1);
  check_scene("force function", blown, LINEAR, FINE, 1);
}

static const char *check_stiff_cloth(msim_comm *comm, void *data) {
  const int *scene_index = data;
  msim_scene *scene = stiff_body(*scene_index, 30000, 0.5, 0.3);
  msim_options opt = options(LINEAR, 1. / 60);
  msim_sim *sim = NULL;
  msim_error why = {0};
  msim_energy e = {.size = sizeof e};
  msim_state s = {.size = sizeof s};
  msim_stats stats = {.size = sizeof stats};
  opt.comm = comm;
  EXPECT(msim_sim_create(scene, &opt, &sim, &why) == MSIM_OK && !msim_sim_energy(sim, &e));
  const double start = e.total;
  for (int k = 0; k < 2 * STEPS; k++) {
    EXPECT(msim_sim_step(sim, 1, &why) == MSIM_OK && msim_sim_state(sim, &s) == MSIM_OK);
    EXPECT(msim_sim_energy(sim, &e) == MSIM_OK && e.total <= start + 1e-9);
    for (int32_t p = 0; p < s.n; p++) EXPECT(distance_from(*scene_index, s.x + 3 * p) >= -1e-11);
  }
  EXPECT(msim_sim_stats(sim, &stats) == MSIM_OK && stats.contacts > 0);
  EXPECT(stats.solves <= 2 * stats.steps);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return NULL;
}

/* As in one process energy does not grow, no particle ends inside, and a step takes two solves. */
static void stiff_cloth_keeps_its_energy(void **state) {
  (void)state;
  for (int i = 0; i < 2; i++) {
    const char *wrong = run_ranks(3, check_stiff_cloth, &i);
    if (wrong) fail_msg("scene %d: %s", i, wrong);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(small_bodies), cmocka_unit_test(nonlinear_methods),
      cmocka_unit_test(work_on_one_rank), cmocka_unit_test(stiff_cloth_keeps_its_energy)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}

#endif
