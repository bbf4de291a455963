/* Tests of linearly implicit Euler on several ranks: the velocities of one process to the tolerance
 * of the solver, and the same bits in each run. */
#include "angle_scenes.h"
#include "base/ranks.h"
#include "laws.h"
#include "linear/rank_modes.h"
#include "rank_implicit.h"

static void check_linear(const char *name, const msim_scene *scene, double h) {
  check_implicit(name, scene, options("linearly-implicit-euler", h), 4, 1.25);
}

static void regular_and_shuffled_meshes(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(24, 800, 0.01), *jelly = pinned_block(9, 1, 3000, 0),
             *mesh = random_mesh(400, 1, 0.02);
  check_linear("cloth", cloth, 5e-3);
  check_linear("jelly", jelly, 5e-3);
  check_linear("mesh", mesh, 2e-3);
  plane(cloth, 0, 0, 1, -1e-3, 0.5, 0.3);
  check_linear("cloth on a plane", cloth, 5e-3);
  msim_scene_destroy(cloth);
  msim_scene_destroy(jelly);
  msim_scene_destroy(mesh);
}

static void laws_and_angles(void **state) {
  (void)state;
  msim_scene *laws = law_net(90, 600, 0, 0.1, 3), *cloth = bending_cloth(16, 400, 0.01, 0.001);
  check_linear("laws", laws, 1e-3);
  check_linear("bending cloth", cloth, 5e-3);
  msim_scene_destroy(laws);
  msim_scene_destroy(cloth);
}

/* Damped springs, and pins that move, of some ranks only */
static void moving_pins(void **state) {
  (void)state;
  msim_scene *cloth = bending_cloth(10, 400, 0.01, 0.001);
  move_corners(cloth, 10);
  check_linear("moving pins", cloth, 2e-3);
  msim_scene_destroy(cloth);
}

/* The modes of ranks make up for coarse spaces that end at their borders. The flat cloth hangs on
 * its corners alone: with one patch a rank, 3 ranks take 1.3 times the iterations of one. */
static void coarse_spaces(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(48, 20000, 0.01), *jelly = pinned_block(12, 1, 1e5, 0),
             *flat = hanging_cloth(90, 1000, 0);
  const msim_options opt = options("linearly-implicit-euler", 5e-3);
  check_implicit("stiff cloth", cloth, opt, 4, 1.25);
  check_implicit("stiff jelly", jelly, opt, 4, 1.25);
  check_implicit("flat cloth", flat, options("linearly-implicit-euler", 1e-2), 3, 1.25);
  msim_scene_destroy(cloth);
  msim_scene_destroy(jelly);
  msim_scene_destroy(flat);
}

/* All particles fall as one: the velocity is in the space of the modes of ranks, and in no coarse
 * space of a rank. If these were added to it alone, each rank would have to undo its own part, in
 * dozens of iterations. */
static void free_fall(void **state) {
  (void)state;
  const double g[3] = {3, 1, -9};
  const msim_cloth sheet = {.size = sizeof sheet,
                            .rows = 60,
                            .columns = 50,
                            .row = {0, 0.8, 0.6},
                            .column = {1, 0, 0},
                            .mass = 0.3,
                            .k_structural = 20000,
                            .k_shear = 20000};
  const msim_lattice block = {
      .size = sizeof block, .n = {14, 13, 12}, .extent = {1, 1, 1}, .mass = 1, .k = 1e5};
  for (int i = 0; i < 2; i++) {
    msim_scene *scene;
    assert_ok(msim_scene_create(NULL, &scene, err));
    assert_ok(i ? msim_scene_add_lattice(scene, &block, err)
                : msim_scene_add_cloth(scene, &sheet, err));
    assert_ok(msim_scene_set_gravity(scene, g, err));
    check_implicit(i ? "falling block" : "falling cloth", scene,
                   options("linearly-implicit-euler", 1e-2), 4, 1);
    msim_scene_destroy(scene);
  }
}

/* One block swings from a corner, and the other one hangs from two. */
static msim_scene *two_blocks(double k) {
  const double g[3] = {0, 0, -9.81};
  const int32_t pinned[] = {0, 99};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int i = 0; i < 2; i++) {
    const msim_lattice block = {.size = sizeof block,
                                .n = {10, 10, 10},
                                .origin = {2. * i, 0, 0},
                                .extent = {1, 1, 1},
                                .mass = 1,
                                .k = k,
                                .npinned = i + 1,
                                .pinned = pinned};
    assert_ok(msim_scene_add_lattice(scene, &block, err));
  }
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

/* The system of two bodies takes about as many iterations as that of the harder one; in one process
 * there are two systems, of whose iterations the sum is counted. If the parts of both bodies on the
 * middle one of three ranks had modes in common, it would take 2.5 times as many. */
static void several_bodies(void **state) {
  (void)state;
  msim_scene *scene = two_blocks(1e5);
  check_implicit("two blocks", scene, options("linearly-implicit-euler", 5e-3), 4, 0.8);
  msim_scene_destroy(scene);
}

/* A net in a plane that contains gravity, where two components move; a straight rope and a beam,
 * oblique, where affine motions of a rank depend on each other. Without the modes of ranks, 4 ranks
 * take 1.4 times the iterations of one process for the rope, and 1.44 times for the beam. */
static void dependent_modes(void **state) {
  (void)state;
  static const char *const names[] = {"planar net", "oblique rope", "oblique beam"};
  const double g[3] = {3, 0, -9};
  const msim_cloth net = {.size = sizeof net,
                          .rows = 40,
                          .columns = 40,
                          .row = {0.6, 0, 0.8},
                          .column = {0.8, 0, -0.6},
                          .mass = 0.3,
                          .k_structural = 20000,
                          .k_shear = 20000,
                          .npinned = 1,
                          .pinned = (int32_t[]){0}};
  msim_rope rope = {.size = sizeof rope,
                    .n = 1200,
                    .to = {0.8, 0, -0.6},
                    .mass = 0.3,
                    .k = 1e5,
                    .npinned = 1,
                    .pinned = (int32_t[]){0}};
  for (int i = 0; i < 3; i++) {
    msim_scene *scene;
    if (i == 2) rope.to[1] = 0.4, rope.bending = 1;
    assert_ok(msim_scene_create(NULL, &scene, err));
    assert_ok(i ? msim_scene_add_rope(scene, &rope, err) : msim_scene_add_cloth(scene, &net, err));
    assert_ok(msim_scene_set_gravity(scene, g, err));
    check_implicit(names[i], scene, options("linearly-implicit-euler", 5e-3), 4, 1.25);
    msim_scene_destroy(scene);
  }
}

/* Rest lengths 0: the matrix is scalar, and constant. */
static void scalar_matrices(void **state) {
  (void)state;
  msim_scene *like = hanging_cloth(16, 100, 0), *scene;
  msim_scene_view w = {.size = sizeof w};
  const double g[3] = {0.1, 0, -9.81};
  msim_scene_get(like, &w);
  double *rest = calloc((size_t)w.nsprings, sizeof *rest);
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, w.nparticles, w.x, w.v, w.mass, err));
  assert_ok(msim_scene_add_springs(scene, w.nsprings, w.ij, w.k, rest, NULL, err));
  assert_ok(msim_scene_pin(scene, 2, (int32_t[]){0, 15}, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  check_linear("scalar matrix", scene, 5e-3);
  free(rest);
  msim_scene_destroy(like);
  msim_scene_destroy(scene);
}

/*------------------------------------- communication --------------------------------------------*/

/* A communicator that counts calls */
typedef struct counting_comm {
  msim_comm table;
  const msim_comm *of;
  int64_t sums, maxima, gathers, parts, exchanges;
  int32_t most; /* numbers in a sum */
} counting_comm;

static msim_status count_sum(void *self, int32_t n, double *values) {
  counting_comm *c = self;
  c->sums++;
  if (n > c->most) c->most = n;
  return c->of->sum(c->of->self, n, values);
}

static msim_status count_maximum(void *self, int32_t n, double *values) {
  counting_comm *c = self;
  c->maxima++;
  return c->of->maximum(c->of->self, n, values);
}

static msim_status count_gather(void *self, int64_t bytes, const void *mine, void *all) {
  counting_comm *c = self;
  c->gathers++;
  return c->of->gather(c->of->self, bytes, mine, all);
}

static msim_status count_exchange(void *self, int32_t n, const msim_comm_message *messages) {
  counting_comm *c = self;
  c->exchanges++;
  return c->of->exchange_begin(c->of->self, n, messages);
}

static msim_status count_gather_parts(void *self, const int64_t *bytes, const void *mine,
                                      void *all) {
  counting_comm *c = self;
  c->parts++;
  return c->of->gather_parts(c->of->self, bytes, mine, all);
}

static msim_status pass_broadcast(void *self, int32_t root, int64_t bytes, void *data) {
  const msim_comm *of = ((counting_comm *)self)->of;
  return of->broadcast(of->self, root, bytes, data);
}

static msim_status pass_all_to_all(void *self, const int64_t *send_bytes, const void *send,
                                   const int64_t *receive_bytes, void *receive) {
  const msim_comm *of = ((counting_comm *)self)->of;
  return of->all_to_all(of->self, send_bytes, send, receive_bytes, receive);
}

static msim_status pass_exchange_end(void *self) {
  const msim_comm *of = ((counting_comm *)self)->of;
  return of->exchange_end(of->self);
}

static const char *pass_reason(void *self) {
  const msim_comm *of = ((counting_comm *)self)->of;
  return of->reason(of->self);
}

static counting_comm count_calls(const msim_comm *of) {
  return (counting_comm){.table = {.abi = MSIM_COMM_ABI,
                                   .size = sizeof(msim_comm),
                                   .name = "counting",
                                   .nranks = of->nranks,
                                   .rank = of->rank,
                                   .sum = count_sum,
                                   .maximum = count_maximum,
                                   .gather = count_gather,
                                   .gather_parts = count_gather_parts,
                                   .broadcast = pass_broadcast,
                                   .all_to_all = pass_all_to_all,
                                   .exchange_begin = count_exchange,
                                   .exchange_end = pass_exchange_end,
                                   .reason = pass_reason},
                         .of = of};
}

/* The calls of the second step at this tolerance, and its iterations */
static const char *count_step(const msim_comm *comm, const msim_scene *scene, double rtol,
                              counting_comm *c, int64_t *iterations) {
  msim_options opt = options("linearly-implicit-euler", 5e-3);
  msim_sim *sim = NULL;
  msim_error why = {0};
  msim_stats before = {.size = sizeof before}, after = before;
  *c = count_calls(comm);
  c->table.self = c;
  opt.comm = &c->table, opt.solver_rtol = rtol;
  EXPECT(msim_sim_create(scene, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_step(sim, 1, &why) == MSIM_OK && msim_sim_stats(sim, &before) == MSIM_OK);
  c->sums = c->maxima = c->gathers = c->exchanges = 0;
  EXPECT(msim_sim_step(sim, 1, &why) == MSIM_OK && msim_sim_stats(sim, &after) == MSIM_OK);
  *iterations = after.iterations - before.iterations;
  msim_sim_destroy(sim);
  return NULL;
}

static const char *check_calls(msim_comm *comm, void *data) {
  counting_comm rough, fine;
  int64_t few, many;
  msim_error why = {0};
  const char *wrong = count_step(comm, data, 1e-3, &rough, &few);
  if (!wrong) wrong = count_step(comm, data, 1e-6, &fine, &many);
  if (wrong) return wrong;
  const int64_t more = many - few, sums = comm->nranks > MS_RANK_MODES_FACTOR ? 2 : 1;
  EXPECT(more > 10);
  EXPECT(fine.sums - rough.sums == sums * more && fine.gathers - rough.gathers == more);
  EXPECT(fine.exchanges - rough.exchanges == more && fine.maxima == rough.maxima);
  return NULL;
}

/* An iteration exchanges the ghosts of a direction, gathers two products and the right-hand side of
 * the modes, and sums the curvature; with rows of the inverse also the product with the modes. */
static void three_calls_an_iteration(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(48, 20000, 0.01);
  for (int32_t n = 2; n <= 3; n++) {
    const char *wrong = run_ranks(n, check_calls, cloth);
    if (wrong) fail_msg("%d ranks: %s", n, wrong);
  }
  msim_scene_destroy(cloth);
}

/* The coarse factor of a rank is new where that of another rank is, and the matrix of the modes of
 * ranks, for which parts are gathered, with them. */
static const char *check_kept_factors(msim_comm *comm, void *data) {
  enum { STEPS = 30 };
  counting_comm c = count_calls(comm);
  msim_options opt = options("linearly-implicit-euler", 2e-2);
  msim_sim *sim = NULL;
  msim_error why = {0};
  msim_stats stats = {.size = sizeof stats};
  c.table.self = &c;
  opt.comm = &c.table, opt.solver = "pcg";
  EXPECT(msim_sim_create(data, &opt, &sim, &why) == MSIM_OK);
  for (int i = 0; i < STEPS; i++) {
    const int64_t before = stats.coarse_factors;
    c.parts = 0;
    EXPECT(msim_sim_step(sim, 1, &why) == MSIM_OK && msim_sim_stats(sim, &stats) == MSIM_OK);
    double made[] = {(double)(stats.coarse_factors - before),
                     (double)(before - stats.coarse_factors)};
    EXPECT(c.parts == (int64_t)made[0]);
    EXPECT(comm->maximum(comm->self, 2, made) == MSIM_OK && made[0] == -made[1]);
  }
  EXPECT(stats.coarse_factors > 1 && stats.kept_factors > 1);
  EXPECT(stats.coarse_factors + stats.kept_factors == STEPS);
  msim_sim_destroy(sim);
  return NULL;
}

static void coarse_factors_are_kept_together(void **state) {
  (void)state;
  msim_scene *scene = two_blocks(1e4);
  const char *wrong = run_ranks(2, check_kept_factors, scene);
  if (wrong) fail_msg("%s", wrong);
  msim_scene_destroy(scene);
}

static const char *check_long_sum(msim_comm *comm, void *data) {
  counting_comm c = count_calls(comm);
  msim_error why = {0};
  double values[200];
  const msim_allocator alloc = ms_memory_allocator(NULL);
  (void)data;
  c.table.self = &c;
  ms_ranks *ranks = ms_ranks_create(&c.table, &alloc);
  EXPECT(ranks);
  for (int i = 0; i < 200; i++) values[i] = i * (1 + comm->rank);
  ms_ranks_sum(ranks, 200, values);
  for (int i = 0; i < 200; i++) EXPECT(values[i] == 6 * i);
  EXPECT(c.sums == 4 && c.most == 64);
  ms_ranks_destroy(&alloc, ranks);
  return NULL;
}

/* No call of a communicator sums more than 64 numbers. */
static void long_sums_are_made_in_pieces(void **state) {
  (void)state;
  const char *wrong = run_ranks(3, check_long_sum, NULL);
  if (wrong) fail_msg("%s", wrong);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(regular_and_shuffled_meshes),
      cmocka_unit_test(laws_and_angles),
      cmocka_unit_test(moving_pins),
      cmocka_unit_test(coarse_spaces),
      cmocka_unit_test(free_fall),
      cmocka_unit_test(several_bodies),
      cmocka_unit_test(dependent_modes),
      cmocka_unit_test(scalar_matrices),
      cmocka_unit_test(three_calls_an_iteration),
      cmocka_unit_test(coarse_factors_are_kept_together),
      cmocka_unit_test(long_sums_are_made_in_pieces),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
