/* Tests of checkpoints on several ranks: they describe the whole scene, so that a run goes on under
 * any number of ranks, or in one process, as it would have without them. */
#include <stdint.h>

#include "base/archive.h"
#include "colliders.h"
#include "rank_runs.h"

/* A run of N ranks to `half`, whose checkpoint others continue */
typedef struct saved_run {
  run r;
  int32_t half;
  void *bytes;
  size_t length, size;
} saved_run;

static const char *save_ranks(msim_comm *comm, void *data) {
  saved_run *s = data;
  msim_options opt = s->r.opt;
  msim_sim *sim;
  msim_error why = {0};
  size_t length;
  opt.comm = comm;
  EXPECT(msim_sim_create(s->r.scene, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_step(sim, s->half, &why) == MSIM_OK);
  const size_t size = msim_sim_save_size(sim);
  void *bytes = malloc(size);
  EXPECT(bytes);
  memset(bytes, 0, size);
  EXPECT(msim_sim_save(sim, bytes, size, &length, &why) == MSIM_OK);
  if (comm->rank == 0) s->bytes = malloc(length), memcpy(s->bytes, bytes, length);
  if (comm->rank == 0) s->length = length, s->size = size;
  EXPECT(length <= size && comm->broadcast(comm->self, 0, 0, NULL) == MSIM_OK);
  void *first = malloc(size);
  EXPECT(first);
  memcpy(first, bytes, length);
  EXPECT(comm->broadcast(comm->self, 0, (int64_t)length, first) == MSIM_OK);
  EXPECT(memcmp(first, bytes, length) == 0);
  EXPECT(msim_sim_step(sim, s->r.steps - s->half, &why) == MSIM_OK); /* saving changed nothing */
  const char *other = s->r.expected.x ? compare_with_run(sim, &s->r) : NULL;
  msim_sim_destroy(sim);
  free(bytes), free(first);
  return other;
}

/* Once in a new sim, and once more in that sim after its steps */
static const char *load_ranks(msim_comm *comm, void *data) {
  const saved_run *s = data;
  msim_options opt = s->r.opt;
  msim_sim *sim;
  msim_error why = {0};
  opt.comm = comm;
  EXPECT(msim_sim_create(s->r.scene, &opt, &sim, &why) == MSIM_OK);
  for (int again = 0; again < 2; again++) {
    EXPECT(msim_sim_load(sim, s->bytes, s->length, &why) == MSIM_OK);
    EXPECT(msim_sim_step(sim, s->r.steps - s->half, &why) == MSIM_OK);
    const char *other = compare_with_run(sim, &s->r);
    if (other) return other;
  }
  msim_sim_destroy(sim);
  return NULL;
}

static saved_run save_alone(const msim_scene *scene, msim_options opt, int32_t steps,
                            int32_t half) {
  saved_run s = {.r = run_alone(scene, opt, steps), .half = half};
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, half, err));
  s.size = msim_sim_save_size(sim);
  s.bytes = malloc(s.size);
  assert_non_null(s.bytes);
  assert_ok(msim_sim_save(sim, s.bytes, s.size, &s.length, err));
  msim_sim_destroy(sim);
  return s;
}

/* From N to M ranks, 1 for one process, all pairs of up to `most` */
static void check_checkpoints(const char *name, const msim_scene *scene, msim_options opt,
                              int32_t steps, int32_t half, int32_t most) {
  saved_run alone = save_alone(scene, opt, steps, half);
  for (int32_t n = 1; n <= most; n++) {
    saved_run s = alone;
    const char *wrong = n > 1 ? run_ranks(n, save_ranks, &s) : NULL;
    if (wrong) fail_msg("%s, %s, saved by %d ranks: %s", name, opt.integrator, n, wrong);
    assert_int_equal(s.length, alone.length);
    assert_int_equal(s.size, alone.size);
    for (int32_t m = 1; m <= most; m++) {
      wrong = run_ranks(m, load_ranks, &s);
      if (wrong) fail_msg("%s, %s, %d to %d ranks: %s", name, opt.integrator, n, m, wrong);
    }
    if (n > 1) free(s.bytes);
  }
  free(alone.bytes);
  free_run(&alone.r);
}

static void check_all_methods(const char *name, const msim_scene *scene, double h, int32_t most,
                              int positions_only, int planes) {
  const char *method;
  for (int32_t i = 0; (method = method_at(i)) != NULL; i++)
    if (is_tested(method) && (positions_only || !takes_positions_only(method)) &&
        !(planes && refuses_planes(method)))
      check_checkpoints(name, scene, options(method, h), 11, 5, most);
}

static void explicit_methods(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(11, 800, 0), *mesh = random_mesh(200, 3, 0.02);
  plane(cloth, 0.1, 0, 1, -0.001, 0.5, 0.3);
  plane(mesh, 0, 0, 1, 0.05, 0.5, 0.4);
  check_all_methods("mesh", mesh, 1e-4, 4, 0, 1);
  check_all_methods("cloth", cloth, 1e-4, 3, 1, 1);
  msim_scene_destroy(cloth);
  msim_scene_destroy(mesh);
}

/* Three blocks of 729 particles, of which one rests on the floor and the others fall */
static msim_scene *three_blocks(void) {
  const double g[3] = {0, 0, -9.81};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int i = 0; i < 3; i++) {
    const msim_lattice lattice = {.size = sizeof lattice,
                                  .n = {9, 9, 9},
                                  .origin = {2. * i, 0, 0.002 * i},
                                  .extent = {1, 1, 1},
                                  .mass = 1,
                                  .k = 100 * (i + 1)};
    assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  }
  const int32_t pin = 1500;
  assert_ok(msim_scene_pin(scene, 1, &pin, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  plane(scene, 0, 0, 1, -0.001, 0.5, 0.3);
  return scene;
}

static void islands_of_one_process(void **state) {
  (void)state;
  msim_scene *blocks = three_blocks(), *block = pinned_block(9, 1, 100, 0);
  const double none[3] = {0, 0, 0};
  check_checkpoints("blocks", blocks, options("velocity-verlet", 5e-4), 60, 31, 3);
  check_checkpoints("blocks", blocks, options("verlet", 5e-4), 60, 31, 3);
  assert_ok(msim_scene_set_gravity(block, none, err));
  check_checkpoints("at rest", block, options("velocity-verlet", 5e-4), 10, 5, 3);
  msim_scene_destroy(blocks);
  msim_scene_destroy(block);
}

/* The second block rests, and is the last one that is read. */
static void some_islands_at_rest(void **state) {
  (void)state;
  msim_scene *scene;
  double force[3 * 2 * 729] = {[0] = 0.1};
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int i = 0; i < 2; i++) {
    const msim_lattice lattice = {.size = sizeof lattice,
                                  .n = {9, 9, 9},
                                  .origin = {2. * i, 0, 0},
                                  .extent = {1, 1, 1},
                                  .mass = 1,
                                  .k = 100};
    assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  }
  assert_ok(msim_scene_set_forces(scene, force, err));
  check_checkpoints("one block rests", scene, options("velocity-verlet", 5e-4), 20, 9, 3);
  msim_scene_destroy(scene);
}

/* Some ranks have no particle, and some write no whole vector. */
static void more_ranks_than_particles(void **state) {
  (void)state;
  msim_scene *rope = folded_rope(4);
  check_checkpoints("short rope", rope, options("velocity-verlet", 1e-3), 20, 9, MOST_RANKS);
  msim_scene_destroy(rope);
}

static void planar_scenes_and_moving_pins(void **state) {
  (void)state;
  const int32_t pin = 0;
  const double g[3] = {0.3, -9.81, 0}, t[2] = {0, 1}, x[6] = {0, 0, 0, 0.1, 0, 0};
  const msim_cloth cloth = {.size = sizeof cloth,
                            .rows = 12,
                            .columns = 13,
                            .row = {0, 1, 0},
                            .column = {1, 0, 0},
                            .mass = 0.3,
                            .k_structural = 100,
                            .k_shear = 50,
                            .npinned = 1,
                            .pinned = &pin};
  const msim_motion motion = {
      .size = sizeof motion, .n = 1, .particles = &pin, .nt = 2, .t = t, .x = x};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_cloth(scene, &cloth, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  check_checkpoints("planar", scene, options("rk4", 1e-3), 30, 13, 3);
  assert_ok(msim_scene_add_motion(scene, &motion, err));
  check_checkpoints("moving pin", scene, options("rk4", 1e-3), 30, 13, 3);
  msim_scene_destroy(scene);
}

/* The last good state is that of step 160; from a state beyond the energy bound the run returns to
 * it. */
static const char *return_to_good_state(msim_comm *comm, void *data) {
  const saved_run *s = data;
  msim_options opt = s->r.opt;
  msim_sim *sim;
  msim_error why = {0};
  msim_state now = {.size = sizeof now};
  opt.comm = comm;
  EXPECT(msim_sim_create(s->r.scene, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_load(sim, s->bytes, s->length, &why) == MSIM_OK);
  EXPECT(msim_sim_step(sim, 1000, &why) > 0);
  EXPECT(msim_sim_state(sim, &now) == MSIM_OK && now.step == s->r.expected.step);
  EXPECT(memcmp(now.x, s->r.expected.x, 3 * (size_t)now.n * sizeof *now.x) == 0);
  msim_sim_destroy(sim);
  return NULL;
}

static void last_good_state(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(9, 4000, 0);
  const msim_options opt = options("velocity-verlet", 6.27e-4);
  enum { SAVED = 170 }; /* becomes unstable between 160 and 320 */
  msim_sim *sim = make_sim(cloth, &opt);
  assert_true(msim_sim_step(sim, 1000, NULL) > 0);
  saved_run s = {.r = {.scene = cloth, .opt = opt, .steps = SAVED}, .half = SAVED};
  s.r.expected = state_of(sim);
  s.r.expected.x = copy_numbers(s.r.expected.x, s.r.expected.n);
  s.r.expected.v = NULL, s.r.expected.v_half = NULL;
  assert_int_equal(s.r.expected.step, 160);
  msim_sim_destroy(sim);
  saved_run by_ranks = s;
  by_ranks.r.expected.x = NULL;
  const char *wrong = run_ranks(3, save_ranks, &by_ranks);
  if (wrong) fail_msg("%s", wrong);
  s.bytes = by_ranks.bytes, s.length = by_ranks.length;
  for (int32_t m = 1; m <= 3; m++) {
    wrong = run_ranks(m, return_to_good_state, &s);
    if (wrong) fail_msg("%d ranks: %s", m, wrong);
  }
  free(s.bytes);
  free_run(&s.r);
  msim_scene_destroy(cloth);
}

/*------------------------------------- implicit steps -------------------------------------------*/

/* The state to which ranks continue a checkpoint, in a new sim, in it again, and in another one */
typedef struct continued_run {
  saved_run s;
  msim_state first;
  double tolerance; /* of velocities, per step, relative to the largest one */
} continued_run;

static const char *continue_implicit(msim_comm *comm, void *data) {
  continued_run *c = data;
  msim_options opt = c->s.r.opt;
  msim_error why = {0};
  opt.comm = comm;
  for (int k = 0; k < 2; k++) {
    msim_sim *sim;
    EXPECT(msim_sim_create(c->s.r.scene, &opt, &sim, &why) == MSIM_OK);
    for (int again = 0; again < 2; again++) {
      msim_state s = {.size = sizeof s};
      EXPECT(msim_sim_load(sim, c->s.bytes, c->s.length, &why) == MSIM_OK);
      EXPECT(msim_sim_step(sim, c->s.r.steps - c->s.half, &why) == MSIM_OK);
      EXPECT(msim_sim_state(sim, &s) == MSIM_OK && s.step == c->s.r.steps);
      if (k + again == 0 && comm->rank == 0)
        c->first = s, c->first.x = copy_numbers(s.x, s.n), c->first.v = copy_numbers(s.v, s.n);
      EXPECT(comm->broadcast(comm->self, 0, 0, NULL) == MSIM_OK);
      double unused = 0;
      EXPECT(comm->sum(comm->self, 1, &unused) == MSIM_OK);
      EXPECT(has_same_bits(s.x, c->first.x, s.n) && has_same_bits(s.v, c->first.v, s.n));
      double most = 0, off = 0;
      for (int32_t i = 0; i < 3 * s.n; i++) {
        most = fmax(most, fabs(c->s.r.expected.v[i]));
        off = fmax(off, fabs(s.v[i] - c->s.r.expected.v[i]));
      }
      EXPECT(off <= c->tolerance * (double)s.step * most);
    }
    msim_sim_destroy(sim);
  }
  return NULL;
}

static void check_continuations(const msim_scene *scene, msim_options opt, double tolerance) {
  enum { STEPS = 7, HALF = 4 };
  saved_run alone = save_alone(scene, opt, STEPS, HALF);
  for (int32_t n = 1; n <= 3; n++) {
    saved_run s = alone;
    s.r.expected.x = NULL;
    const char *wrong = n > 1 ? run_ranks(n, save_ranks, &s) : NULL;
    if (wrong) fail_msg("saved by %d ranks: %s", n, wrong);
    assert_true(s.size >= alone.size);
    for (int32_t m = 1; m <= 3; m++) {
      if (!is_long() && (n + m) % 2) continue;
      continued_run c = {.s = s, .tolerance = tolerance};
      c.s.r.expected = alone.r.expected;
      wrong = run_ranks(m, continue_implicit, &c);
      if (wrong) fail_msg("%s, %s, %d to %d ranks: %s", opt.integrator, opt.solver, n, m, wrong);
      free((void *)(uintptr_t)c.first.x), free((void *)(uintptr_t)c.first.v);
    }
    if (n > 1) free(s.bytes);
  }
  free(alone.bytes);
  free_run(&alone.r);
}

static void check_implicit(const msim_scene *scene, double h, const char *solver) {
  const double RTOL = 1e-8;
  msim_options opt = options("linearly-implicit-euler", h);
  opt.solver = solver, opt.solver_rtol = RTOL;
  check_continuations(scene, opt, 10 * RTOL);
}

/* Newton's method and error control, whose sums are those of all ranks */
static void nonlinear_and_controlled_steps(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(15, 2e3, 0.01), *undamped = hanging_cloth(15, 2e3, 0);
  const char *const implicit[] = {"implicit-midpoint", "bdf2", "tr-bdf2"};
  for (int i = 0; i < 3; i++) check_continuations(cloth, options(implicit[i], 5e-3), 1e-7);
  const char *const controlled[] = {"dop853", "rk4", "bdf2"};
  for (int i = 0; i < 3; i++) {
    msim_options opt = options(controlled[i], 1e-3);
    opt.tol = 1e-5, opt.steps = -1, opt.t_end = 0.5;
    check_continuations(undamped, opt, 1e-7);
  }
  msim_scene_destroy(cloth);
  msim_scene_destroy(undamped);
}

/* 1: coarse factors of the preconditioner serve several steps. */
static int lags_factors(const msim_scene *scene, double h) {
  msim_options opt = options("linearly-implicit-euler", h);
  opt.solver = "pcg";
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 4, err));
  const msim_stats stats = stats_of(sim);
  msim_sim_destroy(sim);
  return stats.coarse_factors > 0 && stats.coarse_factors < 4;
}

/* Also where one process has factored the matrix, or lags a coarse factor */
static void implicit_steps(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(30, 2e4, 0.01), *block = pinned_block(11, 1, 5e3, 0),
             *blocks = three_blocks();
  assert_true(lags_factors(block, 5e-3));
  check_implicit(cloth, 5e-3, "auto");
  check_implicit(cloth, 5e-3, "pcg");
  check_implicit(block, 5e-3, "pcg");
  check_implicit(blocks, 5e-3, "pcg");
  msim_scene_destroy(cloth);
  msim_scene_destroy(block);
  msim_scene_destroy(blocks);
}

/* A stiff rope lands on a capsule after the checkpoint; checkpoints of one process list the
 * constraints of a coarse factor, as of a block with a particle on a sphere, which ranks skip. */
static void stiff_contact(void **state) {
  (void)state;
  const double at[3] = {0}, along[3] = {0, 0.6, 0}, RTOL = 1e-8;
  const msim_rope rope = {.size = sizeof rope,
                          .n = 30,
                          .from = {-0.8, 0.1, 0.222},
                          .to = {0.6, 0, 0.222},
                          .mass = 0.2,
                          .k = 3000};
  msim_scene *scene = new_scene();
  msim_options opt = options("linearly-implicit-euler", 1. / 60);
  opt.solver = "pcg", opt.solver_rtol = RTOL;
  assert_ok(msim_scene_add_rope(scene, &rope, err));
  add(scene, round_bar(MSIM_COLLIDER_CAPSULE, at, along, 0.2, 0.3, 0.3), 0);
  check_continuations(scene, opt, 10 * RTOL);
  msim_scene_destroy(scene);
  scene = pinned_block(11, 1, 5e3, 0);
  add(scene, sphere(1, 1, -0.2, 0.2, 0, 0), 0);
  assert_true(lags_factors(scene, 5e-3));
  opt.h = 5e-3;
  check_continuations(scene, opt, 10 * RTOL);
  msim_scene_destroy(scene);
}

/*------------------------------------- refusals -------------------------------------------------*/

typedef struct refused_bytes {
  const msim_scene *scene;
  msim_options opt;
  const char *bytes[2]; /* rank 1 loads the second */
  size_t length[2];
  const char *word;
} refused_bytes;

static const char *check_refused(msim_comm *comm, void *data) {
  const refused_bytes *c = data;
  const int which = comm->rank == 1;
  msim_options opt = c->opt;
  msim_sim *sim;
  msim_error why = {0};
  msim_state s = {.size = sizeof s};
  opt.comm = comm;
  EXPECT(msim_sim_create(c->scene, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_step(sim, 3, &why) == MSIM_OK);
  const msim_status status = msim_sim_load(sim, c->bytes[which], c->length[which], &why);
  EXPECT(status < 0 && strstr(why.text, c->word));
  EXPECT(msim_sim_step(sim, 1, &why) == MSIM_OK);
  EXPECT(msim_sim_state(sim, &s) == MSIM_OK && s.step == 4);
  msim_sim_destroy(sim);
  return NULL;
}

/* The number `from`, which the checkpoint has in one place, becomes `to`, with a right hash. */
static void forge(char *bytes, size_t length, double from, double to) {
  enum { HASH = 24, HEADER = 40 };
  uint64_t hash = 0;
  size_t at = HEADER;
  while (at + sizeof from < length && memcmp(bytes + at, &from, sizeof from) != 0) at++;
  assert_true(at + sizeof from < length);
  memcpy(bytes + at, &to, sizeof to);
  memcpy(bytes + HASH, &hash, sizeof hash);
  hash = ms_archive_hash(ms_archive_hash(0, bytes, HEADER), bytes + HEADER, length - HEADER);
  memcpy(bytes + HASH, &hash, sizeof hash);
}

static void expect_refused(refused_bytes c, const char *word) {
  c.word = word;
  const char *wrong = run_ranks(3, check_refused, &c);
  if (wrong) fail_msg("%s: %s", word, wrong);
}

static void what_ranks_refuse(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(9, 800, 0);
  const msim_options opt = options("velocity-verlet", 1e-4);
  const double g[3] = {0, 0, -1};
  saved_run one = save_alone(cloth, opt, 5, 5), two = save_alone(cloth, opt, 6, 6);
  char *damaged = malloc(one.length);
  assert_non_null(damaged);
  memcpy(damaged, one.bytes, one.length);
  damaged[one.length / 2] ^= 1;
  const refused_bytes c = {.scene = cloth,
                           .opt = opt,
                           .bytes = {one.bytes, one.bytes},
                           .length = {one.length, one.length}};
  refused_bytes d = c;
  d.bytes[1] = two.bytes, d.length[1] = two.length;
  expect_refused(d, "the 3 ranks load different checkpoints");
  d = c, d.bytes[1] = damaged;
  expect_refused(d, "damaged");
  memcpy(damaged, one.bytes, one.length);
  forge(damaged, one.length, one.r.expected.x[3 * 40 + 2],
        NAN); /* only one rank has the particle */
  d = c, d.bytes[0] = d.bytes[1] = damaged;
  expect_refused(d, "");
  d = c, d.opt.h = 2e-4;
  expect_refused(d, "h is 0.0002 here and 0.0001 in the checkpoint");
  msim_sim *sim = make_sim(cloth, &opt);
  assert_ok(msim_sim_set_gravity(sim, g, err));
  void *changed = malloc(msim_sim_save_size(sim));
  assert_non_null(changed);
  d = c;
  assert_ok(msim_sim_save(sim, changed, msim_sim_save_size(sim), &d.length[0], err));
  d.bytes[0] = d.bytes[1] = changed, d.length[1] = d.length[0];
  expect_refused(d, "the checkpoint of a scene that was changed is not supported where 3 ranks");
  msim_sim_destroy(sim);
  free(one.bytes), free(two.bytes), free(damaged), free(changed);
  free_run(&one.r), free_run(&two.r);
  msim_scene_destroy(cloth);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(explicit_methods),
      cmocka_unit_test(islands_of_one_process),
      cmocka_unit_test(some_islands_at_rest),
      cmocka_unit_test(more_ranks_than_particles),
      cmocka_unit_test(planar_scenes_and_moving_pins),
      cmocka_unit_test(last_good_state),
      cmocka_unit_test(implicit_steps),
      cmocka_unit_test(stiff_contact),
      cmocka_unit_test(nonlinear_and_controlled_steps),
      cmocka_unit_test(what_ranks_refuse),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
