/* Tests of error control on several ranks: all take the same steps, and those of one process but
 * for the rounding of sums over ranks; the same bits in each run. */
#include "angle_scenes.h"
#include "layout/components.h"
#include "rank_runs.h"
#include "sim/rank_scene.h"

/* The two runs of each number of ranks */
typedef struct control_case {
  run r;
  msim_stats alone;
  double *x; /* of the first run on that many ranks; NULL: this is the first */
  double off;
} control_case;

static const char *check_control_rank(msim_comm *comm, void *data) {
  control_case *c = data;
  msim_options opt = c->r.opt;
  msim_sim *sim = NULL;
  msim_error why = {0};
  msim_state s = {.size = sizeof s};
  msim_stats stats = {.size = sizeof stats};
  const char *wrong = NULL;
  opt.comm = comm;
  EXPECT(msim_sim_create(c->r.scene, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_run(sim, NULL, NULL, &why) == MSIM_OK);
  EXPECT(msim_sim_state(sim, &s) == MSIM_OK && msim_sim_stats(sim, &stats) == MSIM_OK);
  EXPECT(is_common(comm, s.h) && is_common(comm, s.t) && s.t == opt.t_end);
  EXPECT(stats.steps == c->alone.steps && stats.rejected_steps == c->alone.rejected_steps);
  double off = 0;
  for (int32_t i = 0; i < 3 * s.n; i++) off = fmax(off, fabs(s.x[i] - c->r.expected.x[i]));
  if (c->x && !has_same_bits(s.x, c->x, s.n)) wrong = "other bits in the second run";
  double *x = comm->rank == 0 && !c->x ? copy_numbers(s.x, s.n) : NULL;
  EXPECT(is_common(comm, off)); /* all have read c->x */
  if (x) c->x = x, c->off = off;
  msim_sim_destroy(sim);
  return wrong;
}

/* Scenes have the size of 1 m: the distance from one process is a small part of what tol allows. */
static void check_control(const char *name, const msim_scene *scene, msim_options opt) {
  const double most = 1e-3 * (opt.tol > 0 ? opt.tol : 1e-6);
  control_case c = {.r = {.scene = scene, .opt = opt}};
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  c.alone = stats_of(sim);
  c.r.expected = state_of(sim);
  for (int32_t n = 2; n <= 4; n++) {
    for (int twice = 0; twice < 2; twice++) {
      const char *wrong = run_ranks(n, check_control_rank, &c);
      if (wrong) fail_msg("%s, %s, %d ranks: %s", name, opt.integrator, n, wrong);
    }
    print_message("%s, %s, %d ranks: dx %.1e m after %d steps, %d rejected\n", name, opt.integrator,
                  n, c.off, (int)c.alone.steps, (int)c.alone.rejected_steps);
    assert_true(c.off <= most);
    free(c.x);
    c.x = NULL;
  }
  msim_sim_destroy(sim);
}

static void estimates_of_methods(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(12, 400, 0.01), *mesh = random_mesh(300, 1, 0),
             *bent = bent_scene((chain){60, 100, 0.1, 0.05, 0}), *felt = hanging_cloth(12, 400, 10);
  check_control("cloth", cloth, controlled("dop853", 0, 0.05));
  check_control("mesh", mesh, controlled("dop853", 1e-8, 0.05));
  check_control("mesh", mesh, controlled("bdf2", 1e-4, 0.003));
  check_control("chain", bent, controlled("dop853", 1e-8, 0.05));
  check_control("felt", felt, controlled("rkc", 1e-2, 0.3));
  move_corners(cloth, 12);
  check_control("moving pins", cloth, controlled("dop853", 1e-7, 0.02));
  msim_scene_destroy(cloth);
  msim_scene_destroy(mesh);
  msim_scene_destroy(bent);
  msim_scene_destroy(felt);
}

static void step_doubling(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(8, 400, 0.01), *mesh = random_mesh(200, 2, 0.02),
             *jelly = pinned_block(5, 1, 300, 0);
  check_control("mesh", mesh, controlled("rk4", 1e-5, 0.05));
  check_control("mesh", mesh, controlled("linearly-implicit-euler", 0.03, 0.004));
  check_control("mesh", mesh, controlled("newmark", 1e-4, 0.003));
  check_control("cloth", cloth, controlled("velocity-verlet", 1e-5, 0.05));
  check_control("jelly", jelly, controlled("tr-bdf2", 1e-4, 0.02));
  msim_scene_destroy(cloth);
  msim_scene_destroy(mesh);
  msim_scene_destroy(jelly);
}

/* Bodies of different sizes, one of them light and fast, and loose particles: each has its own
 * norm, on all ranks. */
static void several_bodies(void **state) {
  (void)state;
  enum { BALLS = 12 };
  const double mass = 0.5, k = 5;
  double force[3 * (81 + 160 + BALLS)] = {[3 * 40 + 2] = 0.5, [3 * 245] = 3};
  msim_scene *scene = hanging_cloth(9, 400, 0);
  for (int i = 0; i < 2; i++) {
    const msim_rope rope = {.size = sizeof rope,
                            .n = 80,
                            .from = {i, 0, 1},
                            .to = {i, 1, 1.5},
                            .mass = 0.1,
                            .k = i ? 40 : 900};
    assert_ok(msim_scene_add_rope(scene, &rope, err));
  }
  for (int i = 0; i < BALLS; i++)
    assert_ok(msim_scene_add_particles(scene, 1, (double[3]){0.1 * i, 0.5, 3}, NULL, &mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, (int32_t[]){0, 100}, &k, NULL, NULL, err));
  assert_ok(msim_scene_set_forces(scene, force, err));
  check_control("bodies", scene, controlled("dop853", 1e-7, 0.1));
  check_control("bodies", scene, controlled("rk4", 1e-5, 0.1));
  msim_scene_destroy(scene);
}

/* n particles, some pinned, with few springs and angular springs between any of them */
static msim_scene *scattered_scene(int32_t n, unsigned seed) {
  const double k = 1, rest = 2;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int32_t p = 0; p < n; p++) {
    const double x[3] = {uniform(&seed), uniform(&seed), uniform(&seed)};
    assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &k, err));
    if (uniform(&seed) < 0.2) assert_ok(msim_scene_pin(scene, 1, &p, err));
  }
  for (int32_t m = (int32_t)(uniform(&seed) * n); m > 0; m--) {
    const int32_t i = (int32_t)(uniform(&seed) * n), j = (i + 1 + m % 3 * 7) % n;
    const int32_t ijk[3] = {i, j, (j + 1) % n};
    if (m % 8) assert_ok(msim_scene_add_springs(scene, 1, ijk, &k, NULL, NULL, err));
    else if (ijk[2] != i) assert_ok(msim_scene_add_angles(scene, 1, ijk, &k, &rest, NULL, err));
  }
  return scene;
}

enum { MOST_SCATTERED = 100 };
typedef struct bodies_case {
  const msim_scene *scene;
  int32_t n, of[MOST_SCATTERED], size[MOST_SCATTERED]; /* as ranks have found: of each particle */
} bodies_case;

static const char *find_bodies(msim_comm *comm, void *data) {
  bodies_case *c = data;
  msim_options opt = controlled("dop853", 1e-6, 0.1);
  msim_sim *sim = NULL;
  msim_error why = {0};
  opt.comm = comm;
  EXPECT(msim_sim_create(c->scene, &opt, &sim, &why) == MSIM_OK);
  const ms_norm *norm = &sim->islands->norm;
  const ms_unknowns *rows = &sim->islands->model.unknowns;
  EXPECT(is_common(comm, norm->n));
  if (comm->rank == 0) c->n = norm->n;
  for (int32_t r = 0; r < rows->nfree; r++) {
    const int32_t p = ms_rank_scene_get_particle(sim, rows->particle[r]);
    c->of[p] = norm->body_of[r], c->size[p] = norm->body[norm->body_of[r]].n;
  }
  msim_sim_destroy(sim);
  return NULL;
}

/* Free particles are in the same body if, and only if, they are in the same component of the scene,
 * whose first particle has its number. */
static void check_bodies(const bodies_case *c, const int32_t *of) {
  const ms_scene *s = c->scene->data;
  for (int32_t p = 0; p < s->nparticles; p++) {
    int32_t size = 0;
    for (int32_t q = 0; q < s->nparticles && of[p] >= 0; q++) {
      size += of[q] == of[p];
      if (of[q] >= 0) assert_int_equal(of[p] == of[q], c->of[p] == c->of[q]);
    }
    if (of[p] >= 0) assert_true(c->size[p] == size && c->of[p] >= 0 && c->of[p] < c->n);
  }
}

static void bodies_are_components_of_the_scene(void **state) {
  (void)state;
  for (unsigned seed = 1; seed <= 60; seed++) {
    const int32_t n = 20 + (int32_t)seed;
    int32_t of[MOST_SCATTERED];
    msim_scene *scene = scattered_scene(n, seed);
    const int32_t count = ms_components_number_particles(scene->data, of);
    for (int32_t ranks = 2; ranks <= MOST_RANKS; ranks++) {
      bodies_case c = {.scene = scene};
      const char *wrong = run_ranks(ranks, find_bodies, &c);
      if (wrong) fail_msg("seed %u, %d ranks: %s", seed, ranks, wrong);
      assert_int_equal(c.n, count);
      check_bodies(&c, of);
    }
    msim_scene_destroy(scene);
  }
}

/* Frames inside steps, by dense output, which evaluates forces */
typedef struct frames {
  double x[16]; /* the sum of coordinates in each frame */
  int n;
} frames;

static int sum_frame(msim_sim *sim, void *user) {
  frames *f = user;
  const msim_state s = state_of(sim);
  for (int32_t i = 0; i < 3 * s.n && f->n < 16; i++) f->x[f->n] += s.x[i];
  return f->n++ >= 16;
}

typedef struct film {
  const msim_scene *scene;
  msim_options opt;
  frames alone; /* of one process */
} film;

static const char *check_frames(msim_comm *comm, void *data) {
  const film *c = data;
  msim_options opt = c->opt;
  frames f = {.n = 0};
  msim_sim *sim = NULL;
  msim_error why = {0};
  opt.comm = comm;
  EXPECT(msim_sim_create(c->scene, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_run(sim, sum_frame, &f, &why) == MSIM_OK);
  EXPECT(f.n == c->alone.n);
  for (int i = 0; i < f.n; i++) EXPECT(fabs(f.x[i] - c->alone.x[i]) <= 1e-9);
  msim_sim_destroy(sim);
  return NULL;
}

static void frames_inside_steps(void **state) {
  (void)state;
  const char *methods[] = {"dop853", "rk4", "tr-bdf2"};
  msim_scene *mesh = random_mesh(200, 3, 0.01);
  for (size_t i = 0; i < sizeof methods / sizeof *methods; i++) {
    film c = {.scene = mesh, .opt = controlled(methods[i], 1e-4, 0.02)};
    c.opt.fps = 500;
    msim_sim *sim = make_sim(mesh, &c.opt);
    assert_ok(msim_sim_run(sim, sum_frame, &c.alone, err));
    assert_int_equal(c.alone.n, 11);
    msim_sim_destroy(sim);
    const char *wrong = run_ranks(3, check_frames, &c);
    if (wrong) fail_msg("%s: %s", methods[i], wrong);
  }
  msim_scene_destroy(mesh);
}

static const char *check_stop(msim_comm *comm, void *data) {
  msim_options opt = controlled("dop853", 1e-6, 1);
  msim_sim *sim = NULL;
  msim_error why = {0};
  opt.comm = comm;
  EXPECT(msim_sim_create(data, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_step(sim, 5, &why) == MSIM_OK);
  if (comm->rank == 1) msim_sim_stop(sim);
  EXPECT(msim_sim_step(sim, 5, &why) == MSIM_STOPPED && state_of(sim).step == 6);
  EXPECT(msim_sim_step(sim, 5, &why) == MSIM_OK && state_of(sim).step == 11);
  msim_sim_destroy(sim);
  return NULL;
}

static void ranks_stop_together(void **state) {
  (void)state;
  msim_scene *mesh = random_mesh(200, 4, 0);
  const char *wrong = run_ranks(3, check_stop, mesh);
  if (wrong) fail_msg("%s", wrong);
  msim_scene_destroy(mesh);
}

/* Of particle 30, from t = 0.01 on */
static int32_t become_invalid(void *data, const msim_force_batch *b) {
  (void)data;
  for (int32_t i = 0; i < b->n; i++)
    if (b->particles[i] == 30 && b->t > 0.01) b->f[3 * i] = NAN;
  return 0;
}

static const char *check_shortest_step(msim_comm *comm, void *data) {
  msim_options opt = controlled("dop853", 1e-6, 1);
  msim_sim *sim = NULL;
  msim_error why = {0};
  opt.comm = comm;
  EXPECT(msim_sim_create(data, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_run(sim, NULL, NULL, &why) == MSIM_NOT_FINITE);
  EXPECT(strstr(why.text, "particle 30") && strstr(why.text, "failed even with h"));
  EXPECT(has_same_text(comm, why.text) && state_of(sim).t > 0.0099);
  msim_sim_destroy(sim);
  return NULL;
}

/* The rank that computes the particle reports it. */
static void shortest_steps_fail_on_all_ranks(void **state) {
  (void)state;
  const msim_force_function function = {.size = sizeof function,
                                        .flags = MSIM_FORCE_TIME,
                                        .name = "becomes invalid",
                                        .evaluate = become_invalid};
  msim_scene *mesh = random_mesh(200, 5, 0);
  assert_ok(msim_scene_set_force_function(mesh, &function, err));
  for (int32_t n = 2; n <= 4; n++) {
    const char *wrong = run_ranks(n, check_shortest_step, mesh);
    if (wrong) fail_msg("%d ranks: %s", n, wrong);
  }
  msim_scene_destroy(mesh);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(estimates_of_methods),
      cmocka_unit_test(step_doubling),
      cmocka_unit_test(several_bodies),
      cmocka_unit_test(bodies_are_components_of_the_scene),
      cmocka_unit_test(frames_inside_steps),
      cmocka_unit_test(ranks_stop_together),
      cmocka_unit_test(shortest_steps_fail_on_all_ranks),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
