/* Tests of linearly implicit Euler on several ranks: the velocities of one process to the tolerance
 * of the solver, and the same bits in each run. */
#include "angle_scenes.h"
#include "laws.h"
#include "rank_runs.h"

enum { STEPS = 4 };
static const double RTOL = 1e-8;

static double largest_of(const double *x, int32_t n) {
  double most = 0;
  for (int32_t i = 0; i < 3 * n; i++) most = fmax(most, fabs(x[i]));
  return most;
}

/* The two runs of each number of ranks */
typedef struct implicit_case {
  run r;
  double *v; /* of the first run on that many ranks; NULL: this is the first */
  double worst;
  int64_t alone, iterations; /* of one process, and of ranks */
} implicit_case;

static const char *check_rank(msim_comm *comm, void *data) {
  implicit_case *c = data;
  msim_options opt = c->r.opt;
  msim_sim *sim;
  static char text[MOST_RANKS][1100];
  msim_error why = {0};
  msim_state s = {.size = sizeof s};
  msim_stats stats = {.size = sizeof stats};
  opt.comm = comm;
  if (msim_sim_create(c->r.scene, &opt, &sim, &why) || msim_sim_step(sim, c->r.steps, &why)) {
    snprintf(text[comm->rank], sizeof text[0], "%s", why.text);
    return text[comm->rank];
  }
  if (msim_sim_state(sim, &s) || msim_sim_stats(sim, &stats)) return "no state";
  const double most = fmax(largest_of(c->r.expected.v, s.n), 9.81 * c->r.opt.h);
  double off = 0;
  for (int32_t i = 0; i < 3 * s.n; i++) off = fmax(off, fabs(s.v[i] - c->r.expected.v[i]));
  const char *wrong = NULL;
  if (!(off <= 10 * RTOL * c->r.steps * most)) wrong = "other velocities";
  if (c->v && !has_same_bits(s.v, c->v, s.n)) wrong = "other bits in the second run";
  double *v = comm->rank == 0 && !c->v ? copy_numbers(s.v, s.n) : NULL;
  double unused = 0;
  comm->sum(comm->self, 1, &unused); /* all have read c->v */
  if (v) c->v = v;
  if (comm->rank == 0) c->worst = off / most, c->iterations = stats.iterations;
  msim_sim_destroy(sim);
  return wrong;
}

static void check_implicit(const char *name, const msim_scene *scene, double h) {
  msim_options opt = options("linearly-implicit-euler", h);
  opt.solver = "pcg", opt.solver_rtol = RTOL;
  implicit_case c = {.r = run_alone(scene, opt, STEPS)};
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, STEPS, err));
  c.alone = stats_of(sim).iterations;
  msim_sim_destroy(sim);
  for (int32_t n = 2; n <= 4; n++) {
    for (int twice = 0; twice < 2; twice++) {
      const char *wrong = run_ranks(n, check_rank, &c);
      if (wrong) fail_msg("%s, %d ranks: %s", name, n, wrong);
    }
    print_message("%s, %d ranks: dv %.1e of max |v| or g h, %d iterations, %d alone\n", name, n,
                  c.worst, (int)c.iterations, (int)c.alone);
    assert_true(2 * c.iterations <= 3 * c.alone);
    free(c.v);
    c.v = NULL;
  }
  free_run(&c.r);
}

static void regular_and_shuffled_meshes(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(24, 800, 0.01), *jelly = pinned_block(9, 1, 3000, 0),
             *mesh = random_mesh(400, 1, 0.02);
  check_implicit("cloth", cloth, 5e-3);
  check_implicit("jelly", jelly, 5e-3);
  check_implicit("mesh", mesh, 2e-3);
  plane(cloth, 0, 0, 1, -1e-3, 0.5, 0.3);
  check_implicit("cloth on a plane", cloth, 5e-3);
  msim_scene_destroy(cloth);
  msim_scene_destroy(jelly);
  msim_scene_destroy(mesh);
}

static void laws_and_angles(void **state) {
  (void)state;
  msim_scene *laws = law_net(90, 600, 0, 0.1, 3), *cloth = bending_cloth(16, 400, 0.01, 0.001);
  check_implicit("laws", laws, 1e-3);
  check_implicit("bending cloth", cloth, 5e-3);
  msim_scene_destroy(laws);
  msim_scene_destroy(cloth);
}

/* The modes of ranks make up for coarse spaces that end at their borders. */
static void coarse_spaces(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(48, 20000, 0.01), *jelly = pinned_block(12, 1, 1e5, 0);
  check_implicit("stiff cloth", cloth, 5e-3);
  check_implicit("stiff jelly", jelly, 5e-3);
  msim_scene_destroy(cloth);
  msim_scene_destroy(jelly);
}

/* A net in a plane that contains gravity, and a straight rope, oblique: two components move, and
 * affine motions of the rope's ranks depend on each other. */
static void dependent_modes(void **state) {
  (void)state;
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
  const msim_rope rope = {.size = sizeof rope,
                          .n = 1200,
                          .to = {0.8, 0, -0.6},
                          .mass = 0.3,
                          .k = 1e5,
                          .npinned = 1,
                          .pinned = (int32_t[]){0}};
  for (int i = 0; i < 2; i++) {
    msim_scene *scene;
    assert_ok(msim_scene_create(NULL, &scene, err));
    assert_ok(i ? msim_scene_add_rope(scene, &rope, err) : msim_scene_add_cloth(scene, &net, err));
    assert_ok(msim_scene_set_gravity(scene, g, err));
    check_implicit(i ? "oblique rope" : "planar net", scene, 5e-3);
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
  check_implicit("scalar matrix", scene, 5e-3);
  free(rest);
  msim_scene_destroy(like);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(regular_and_shuffled_meshes),
      cmocka_unit_test(laws_and_angles),
      cmocka_unit_test(coarse_spaces),
      cmocka_unit_test(dependent_modes),
      cmocka_unit_test(scalar_matrices),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
