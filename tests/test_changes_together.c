/* Tests of laws, motions, colliders and constant forces in one scene whose forces, pins and springs
 * change at random: clones and resumed sims against a plain one, and energy less work. */
#include <math.h>

#include "checkpoints.h"
#include "state_hash.h"

enum { SIDE = 5, N = SIDE * SIDE, MOST_SPRINGS = 8 * N };

static int is(const char *method, const char *name) { return strcmp(method, name) == 0; }

/* A law for every third spring, in turn */
static void add_laws(msim_scene *scene) {
  static const double stretch[] = {-0.2, 0, 0.1, 0.3}, force[] = {-30, 0, 20, 90}, p[] = {1, 0, 40};
  const msim_law laws[] = {
      {.size = sizeof *laws, .kind = MSIM_LAW_TENSION},
      {.size = sizeof *laws, .kind = MSIM_LAW_POLYNOMIAL, .n = 3, .limit = 0.5, .coefficients = p},
      {.size = sizeof *laws, .kind = MSIM_LAW_TABLE, .n = 4, .stretch = stretch, .force = force}};
  msim_scene_view s = {.size = sizeof s};
  int32_t number[3];
  for (int i = 0; i < 3; i++) assert_ok(msim_scene_add_law(scene, &laws[i], &number[i], err));
  assert_int_equal(msim_scene_get(scene, &s), MSIM_OK);
  for (int32_t e = 0, n = s.nsprings; e < n; e += 3)
    assert_ok(msim_scene_set_law(scene, 1, &e, number[e % 9 / 3], err));
}

static void add_motion(msim_scene *scene) {
  static const int32_t corner = 0;
  static const double t[] = {0, 0.02, 0.05};
  msim_scene_view s = {.size = sizeof s};
  double x[9];
  assert_int_equal(msim_scene_get(scene, &s), MSIM_OK);
  for (int k = 0; k < 3; k++)
    for (int c = 0; c < 3; c++) x[3 * k + c] = s.x[c] + 0.02 * k * (c - 1);
  const msim_motion m = {.size = sizeof m,
                         .n = 1,
                         .particles = &corner,
                         .nt = 3,
                         .t = t,
                         .x = x,
                         .interpolation = MSIM_MOTION_CUBIC};
  assert_ok(msim_scene_add_motion(scene, &m, err));
}

/* controlled: under error control, which colliders do not support */
static msim_scene *make_scene(const char *method, int controlled) {
  msim_scene *scene = hanging_cloth(SIDE, 300, takes_positions_only(method) ? 0 : 0.01);
  const msim_collider ball = {.size = sizeof ball,
                              .type = MSIM_COLLIDER_SPHERE,
                              .center = {0.5, 0.5, -0.35},
                              .radius = 0.3,
                              .restitution = 0.5,
                              .friction = 0.2};
  add_laws(scene);
  if (is(method, "takahashi-imada")) return scene; /* refuses both */
  if (!is(method, "respa")) add_motion(scene);
  if (!controlled) assert_ok(msim_scene_add_collider(scene, &ball, err));
  return scene;
}

/*------------------------------------- random changes -------------------------------------------*/

typedef struct change {
  int kind;
  int32_t particle, pinned;
  double number, vector[3], force[3 * N];
} change;

static change make_change(unsigned *seed) {
  change c = {.kind = (int)(uniform(seed) * 7)};
  c.particle = (int32_t)(uniform(seed) * N), c.pinned = uniform(seed) < 0.5;
  c.number = uniform(seed);
  for (int i = 0; i < 3; i++) c.vector[i] = uniform(seed) - 0.5;
  for (int i = 0; i < 3 * N; i++) c.force[i] = 0.1 * (uniform(seed) - 0.5);
  return c;
}

static msim_status scale_springs(msim_sim *sim, const msim_scene *scene, double by) {
  msim_scene_view s = {.size = sizeof s};
  double k[MOST_SPRINGS];
  assert_int_equal(msim_scene_get(scene, &s), MSIM_OK);
  assert_true(s.nsprings <= MOST_SPRINGS);
  for (int32_t e = 0; e < s.nsprings; e++) k[e] = s.k[e] * by;
  return msim_sim_set_springs(sim, k, NULL, NULL, NULL);
}

/* Returns a status: methods may refuse. */
static msim_status make_one_change(msim_sim *sim, const msim_scene *scene, const change *c) {
  double to[3];
  switch (c->kind) {
    case 0:
      return msim_sim_set_forces(sim, c->pinned ? c->force : NULL, NULL);
    case 1:
      return msim_sim_set_gravity(sim, (double[]){c->vector[0], c->vector[1], -9.81}, NULL);
    case 2:
      return msim_sim_set_drag(sim, 0.02 * c->number, NULL);
    case 3:
      return msim_sim_set_pinned(sim, 1, &c->particle, c->pinned, NULL);
    case 4:
      for (int i = 0; i < 3; i++)
        to[i] = state_of(sim).x[3 * c->particle + i] + 0.05 * c->vector[i];
      return msim_sim_move_pinned(sim, 1, &c->particle, to, 0.01 + 0.05 * c->number, NULL);
    case 5:
      return scale_springs(sim, scene, 0.5 + c->number);
    default:
      return msim_sim_step(sim, 1 + (int64_t)(5 * c->number), NULL);
  }
}

/* Sims of one scene. springs: the factor of all k, which a sim must have before it is loaded. */
typedef struct sims {
  const msim_scene *scene;
  const msim_options *opt;
  msim_sim *plain, *other, *used;
  double springs;
} sims;

static void load(const sims *s, msim_sim *to) {
  const checkpoint c = save(s->other);
  if (s->springs != 1) assert_ok(scale_springs(to, s->scene, s->springs));
  assert_ok(msim_sim_load(to, c.bytes, c.length, err));
  free(c.bytes);
}

/* Replace the other sim by a clone, by a new sim with its checkpoint, or by a used one with it. */
static void replace_other(sims *s, double how) {
  msim_sim *next = s->used;
  if (how < 0.3) assert_ok(msim_sim_clone(s->other, &next, err));
  else if (how < 0.6) next = make_sim(s->scene, s->opt);
  if (how >= 0.3) load(s, next);
  if (how >= 0.6) s->used = s->other;
  else msim_sim_destroy(s->other);
  s->other = next;
}

static void change_both(sims *s, const change *c, const char *label) {
  const msim_status status = make_one_change(s->plain, s->scene, c);
  if (make_one_change(s->other, s->scene, c) != status)
    fail_msg("%s: one of two equal changes is refused", label);
  if (c->kind == 5 && !status) s->springs = 0.5 + c->number;
  assert_ok(msim_sim_step(s->plain, 2, err));
  assert_ok(msim_sim_step(s->other, 2, err));
  if (hash_sim(s->plain) != hash_sim(s->other))
    fail_msg("%s: the states differ after a change of kind %d", label, c->kind);
}

static void test_changes(const char *method, int controlled, unsigned seed) {
  msim_scene *scene = make_scene(method, controlled);
  msim_options opt = options(method, 1e-3);
  opt.threads = 1 + (int32_t)seed % 2, opt.newton_rtol = 1e-6;
  if (controlled) opt.tol = 1e-3, opt.steps = -1, opt.t_end = 100;
  sims s = {scene, &opt, make_sim(scene, &opt), make_sim(scene, &opt), make_sim(scene, &opt), 1};
  for (int i = 0; i < 30; i++) {
    const change c = make_change(&seed);
    change_both(&s, &c, method);
    if (uniform(&seed) < 0.5) replace_other(&s, uniform(&seed));
  }
  expect_same_save(s.plain, s.other, method);
  msim_sim_destroy(s.plain), msim_sim_destroy(s.other), msim_sim_destroy(s.used);
  msim_scene_destroy(scene);
}

static void changes_survive_clones_and_loads(void **state) {
  (void)state;
  const char *method;
  for (int32_t i = 0; (method = method_at(i)) != NULL; i++)
    for (unsigned seed = 1; seed <= 4; seed++) {
      const int fixed =
          is(method, "verlet") || is(method, "respa") || is(method, "takahashi-imada");
      if (!is(method, "dop853")) test_changes(method, 0, 100 * (unsigned)i + seed);
      if (!fixed) test_changes(method, 1, 100 * (unsigned)i + seed);
    }
}

/*------------------------------------- energy ---------------------------------------------------*/

/* All springs have a smooth law; a pin moves, forces and pins change. */
static void energy_is_balanced(void **state) {
  (void)state;
  static const double p[] = {1, 0.5, 3};
  const msim_law law = {
      .size = sizeof law, .kind = MSIM_LAW_POLYNOMIAL, .n = 3, .limit = 10, .coefficients = p};
  msim_scene *scene = hanging_cloth(SIDE, 50, 0);
  msim_scene_view s = {.size = sizeof s};
  int32_t number;
  assert_ok(msim_scene_add_law(scene, &law, &number, err));
  assert_int_equal(msim_scene_get(scene, &s), MSIM_OK);
  for (int32_t e = 0, n = s.nsprings; e < n; e++)
    assert_ok(msim_scene_set_law(scene, 1, &e, number, err));
  add_motion(scene);
  msim_options opt = options("dop853", 1e-3);
  opt.tol = 1e-12, opt.steps = -1, opt.t_end = 100;
  msim_sim *sim = make_sim(scene, &opt);
  const double start = energy_less_work(sim);
  unsigned seed = 5;
  for (int i = 0; i < 40; i++) {
    change c = make_change(&seed);
    if (c.kind == 2 || c.kind == 5) continue; /* drag, and springs whose change is not counted */
    make_one_change(sim, scene, &c);
    assert_ok(msim_sim_step(sim, 10, err));
    assert_close(energy_less_work(sim), start, 1e-10 * (1 + fabs(start)));
  }
  assert_true(fabs(state_of(sim).work) > 0.01);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(changes_survive_clones_and_loads),
                                     cmocka_unit_test(energy_is_balanced)};
  return cmocka_run_group_tests_name("changes_together", tests, NULL, NULL);
}
