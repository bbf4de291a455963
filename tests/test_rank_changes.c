/* Tests of changes of the scene while several ranks simulate it: the bits of one process with
 * explicit methods; ranks that disagree; each allocation of one rank that fails. */
#include <stdatomic.h>

#include "counting_allocator.h"
#include "rank_implicit.h"

enum { SIDE = 9, N = SIDE * SIDE };

/* A cloth above a ball, with 2 corners pinned */
static msim_scene *make_scene(const msim_allocator *alloc) {
  const int32_t corners[2] = {0, SIDE - 1};
  const double g[3] = {0, 0, -9.81};
  const msim_cloth cloth = {.size = sizeof cloth,
                            .rows = SIDE,
                            .columns = SIDE,
                            .row = {0, 1, 0},
                            .column = {1, 0, 0},
                            .mass = 0.3,
                            .k_structural = 400,
                            .k_shear = 400,
                            .npinned = 2,
                            .pinned = corners};
  const msim_collider ball = {.size = sizeof ball,
                              .type = MSIM_COLLIDER_SPHERE,
                              .center = {0.5, 0.5, -0.21},
                              .radius = 0.2,
                              .restitution = 0.3,
                              .friction = 0.2};
  msim_scene *scene;
  if (msim_scene_create(alloc, &scene, NULL) || msim_scene_add_cloth(scene, &cloth, NULL) ||
      msim_scene_set_gravity(scene, g, NULL) || msim_scene_add_collider(scene, &ball, NULL))
    return NULL;
  return scene;
}

enum { CHANGES = 7 };

/* Change i; by: its size, 1 */
static msim_status change(msim_sim *sim, int i, double by, msim_error *why) {
  static const int32_t corner = 0, inner[3] = {40, 41, 50};
  const double gravity[3] = {0.5 * by, 0, -5}, to[3] = {0.02 * by, 0.01, 0.01},
               ball[3] = {0.5, 0.5, -0.2 + 0.01 * by};
  double force[3 * N] = {0};
  for (int p = 0; p < N; p++) force[3 * p] = 1e-3 * (p % 5) * by;
  switch (i) {
    case 0:
      return msim_sim_set_gravity(sim, gravity, why);
    case 1:
      return msim_sim_set_drag(sim, 1e-3 * by, why);
    case 2:
      return msim_sim_set_forces(sim, force, why);
    case 3:
      return msim_sim_move_pinned(sim, 1, &corner, to, 2e-3 * by, why);
    case 4:
      return msim_sim_move_collider(sim, 0, ball, NULL, 5e-3 * by, why);
    case 5:
      return msim_sim_set_pinned(sim, by == 1 ? 3 : 2, inner, by > 0 ? 1 : 7, why);
    default:
      return msim_sim_set_pinned(sim, by == 1 ? 2 : 1, inner, by > 0 ? 0 : 7, why);
  }
}

enum { STEPS = 6 }; /* between changes */

static msim_status make_changes(msim_sim *sim, msim_error *why) {
  msim_status status = msim_sim_step(sim, STEPS, why);
  for (int i = 0; i < CHANGES && !status; i++) {
    status = change(sim, i, 1, why);
    if (!status) status = msim_sim_step(sim, STEPS, why);
  }
  return status;
}

static run change_alone(const msim_scene *scene, msim_options opt) {
  run r = {.scene = scene, .opt = opt, .energy.size = sizeof r.energy};
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(make_changes(sim, err));
  r.expected = state_of(sim);
  r.expected.x = copy_numbers(r.expected.x, N);
  r.expected.v = copy_numbers(r.expected.v, N);
  r.expected.v_half = copy_numbers(r.expected.v_half, N);
  assert_int_equal(msim_sim_energy(sim, &r.energy), MSIM_OK);
  msim_sim_destroy(sim);
  return r;
}

static const char *check_changes(msim_comm *comm, void *data) {
  const run *r = data;
  msim_options opt = r->opt;
  msim_sim *sim = NULL;
  msim_error why = {0};
  const char *wrong = NULL;
  opt.comm = comm;
  EXPECT(msim_sim_create(r->scene, &opt, &sim, &why) == MSIM_OK);
  EXPECT(make_changes(sim, &why) == MSIM_OK);
  if (!is_implicit(opt.integrator)) wrong = compare_with_run(sim, r);
  const msim_state s = state_of(sim);
  for (int i = 0; i < 3 * N; i++)
    if (!(fabs(s.v[i] - r->expected.v[i]) <= 1e-6)) wrong = "other velocities";
  msim_sim_destroy(sim);
  return wrong;
}

static void changes_are_those_of_one_process(void **state) {
  (void)state;
  const char *methods[] = {"velocity-verlet",        "rk4", "rkc", "verlet", "implicit-midpoint",
                           "linearly-implicit-euler"};
  msim_scene *scene = make_scene(NULL);
  for (size_t i = 0; i < sizeof methods / sizeof *methods; i++) {
    msim_options opt = options(methods[i], 5e-4);
    opt.newton_rtol = opt.solver_rtol = RTOL;
    if (is_implicit(methods[i])) opt.solver = "pcg";
    run r = change_alone(scene, opt);
    for (int32_t n = 2; n <= 4; n++) {
      const char *wrong = run_ranks(n, check_changes, &r);
      if (wrong) fail_msg("%s, %d ranks: %s", methods[i], n, wrong);
    }
    free_run(&r);
  }
  msim_scene_destroy(scene);
}

/*------------------------------------- ranks that disagree --------------------------------------*/

/* Rank 1 makes another change: nothing is changed on any, and the run goes on as without it. */
static const char *check_disagreement(msim_comm *comm, void *data) {
  const run *r = data;
  msim_options opt = r->opt;
  msim_sim *sim = NULL;
  msim_error why = {0};
  opt.comm = comm;
  EXPECT(msim_sim_create(r->scene, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_step(sim, STEPS, &why) == MSIM_OK);
  for (int i = 0; i < CHANGES; i++) {
    EXPECT(change(sim, i, comm->rank == 1 ? 2 : 1, &why) == MSIM_ERR_ARG);
    EXPECT(strstr(why.text, "different scenes"));
    EXPECT(change(sim, i, comm->rank == 1 ? NAN : 1, &why) == MSIM_ERR_ARG);
    EXPECT(has_same_text(comm, why.text));
    EXPECT(change(sim, i, 1, &why) == MSIM_OK);
    EXPECT(msim_sim_step(sim, STEPS, &why) == MSIM_OK);
  }
  const char *wrong = compare_with_run(sim, r);
  msim_sim_destroy(sim);
  return wrong;
}

static void ranks_that_disagree_change_nothing(void **state) {
  (void)state;
  msim_scene *scene = make_scene(NULL);
  run r = change_alone(scene, options("velocity-verlet", 5e-4));
  const char *wrong = run_ranks(3, check_disagreement, &r);
  if (wrong) fail_msg("%s", wrong);
  free_run(&r);
  msim_scene_destroy(scene);
}

/*------------------------------------- want of memory -------------------------------------------*/

/* Each rank has a scene of its own; allocation `fail_at` of rank 1 in change `change` fails. */
typedef struct memory_case {
  const char *method;
  int change;
  int64_t fail_at;
  atomic_int succeeded;
} memory_case;

static const char *check_memory(msim_comm *comm, void *data) {
  memory_case *c = data;
  counting_allocator count = {.fail_at = -1};
  msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free, &count};
  msim_scene *scene = make_scene(&alloc);
  msim_options opt = options(c->method, 5e-4);
  msim_sim *sim = NULL;
  msim_error why = {0};
  opt.comm = comm, opt.threads = 1;
  EXPECT(scene && msim_sim_create(scene, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_step(sim, 2, &why) == MSIM_OK);
  EXPECT(c->change != 6 || change(sim, 5, 1, &why) == MSIM_OK); /* pins to let go */
  if (comm->rank == 1) count.fail_at = count.calls + c->fail_at;
  const msim_status status = change(sim, c->change, 1, &why);
  count.fail_at = -1;
  EXPECT(status == MSIM_OK || (status == MSIM_ERR_MEMORY && strstr(why.text, "out of memory")));
  EXPECT(msim_sim_step(sim, 2, &why) == MSIM_OK);
  if (!status && comm->rank == 0) c->succeeded = 1;
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  EXPECT(count.live == 0);
  return NULL;
}

static void each_allocation_that_fails_changes_nothing(void **state) {
  (void)state;
  const char *methods[] = {"velocity-verlet", "bdf2"};
  for (int k = 0; k < 2; k++)
    for (int i = 0; i < CHANGES; i++) {
      memory_case c = {.method = methods[k], .change = i};
      for (; !c.succeeded; c.fail_at++) {
        const char *wrong = run_ranks(3, check_memory, &c);
        if (wrong) fail_msg("%s, change %d, allocation %d: %s", c.method, i, (int)c.fail_at, wrong);
      }
      assert_true(c.fail_at > 0);
    }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(changes_are_those_of_one_process),
      cmocka_unit_test(ranks_that_disagree_change_nothing),
      cmocka_unit_test(each_allocation_that_fails_changes_nothing),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
