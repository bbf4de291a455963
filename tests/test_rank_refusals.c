/* Tests of what several ranks refuse: options, scenes that differ between ranks, functions. */
#include "colliders.h"
#include "rank_runs.h"

typedef struct refused {
  const msim_scene *scene;
  msim_options opt;
  const char *word;
} refused;

static const char *check_refused(msim_comm *comm, void *data) {
  const refused *r = data;
  msim_options opt = r->opt;
  msim_sim *sim = NULL;
  msim_error why = {0};
  opt.comm = comm;
  EXPECT(msim_sim_create(r->scene, &opt, &sim, &why) == MSIM_ERR_UNSUPPORTED);
  EXPECT(!sim && strstr(why.text, r->word) && strstr(why.text, "2 ranks do not support"));
  return NULL;
}

static void check_refusal(const msim_scene *scene, msim_options opt, const char *word) {
  refused r = {scene, opt, word};
  const char *wrong = run_ranks(2, check_refused, &r);
  if (wrong) fail_msg("%s: %s", word, wrong);
}

static void options_are_refused_on_all_ranks(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(9, 100, 0);
  msim_options opt = options("auto", 1e-3);
  opt.t_end = 1;
  check_refusal(cloth, opt, "auto");
  check_refusal(cloth, options("respa", 1e-3), "respa");
  opt = options("rk4", 1e-3), opt.contacts = MSIM_CONTACTS_ON;
  check_refusal(cloth, opt, "contacts");
  opt = options("linearly-implicit-euler", 1e-3), opt.solver = "cholmod";
  if (is_solver_available("cholmod")) check_refusal(cloth, opt, "that solver");
  opt = options("linearly-implicit-euler", 1e-3), opt.indefinite = MSIM_INDEFINITE_SOLVE;
  check_refusal(cloth, opt, "indefinite = solve");
  plane(cloth, 0, 0, 1, -1, 0.5, 0);
  opt = options("rk4", 1e-3), opt.tol = 1e-4;
  check_refusal(cloth, opt, "tol");
  opt = options("rk4", 1e-3), opt.collision = MSIM_COLLISION_EVENT;
  check_refusal(cloth, opt, "collision = event");
  msim_scene_destroy(cloth);
}

/* Rank 1 has other springs, another collider, planes that constrain, or another h. */
static const char *check_differences(msim_comm *comm, void *data) {
  const msim_scene *const *scenes = data;
  msim_sim *sim = NULL;
  msim_error why = {0};
  for (int kind = 0; kind < 4; kind++) {
    const int is_other = comm->rank == 1;
    msim_options opt = options("velocity-verlet", kind == 3 && is_other ? 1e-3 : 1e-4);
    opt.comm = comm;
    EXPECT(msim_sim_create(scenes[is_other && kind < 3 ? kind + 1 : 0], &opt, &sim, &why) ==
           MSIM_ERR_ARG);
    EXPECT(!sim && strstr(why.text, "the 3 ranks have different scenes or options"));
  }
  return NULL;
}

static void different_scenes_are_refused(void **state) {
  (void)state;
  msim_scene *scenes[4];
  for (int i = 0; i < 4; i++) {
    scenes[i] = hanging_cloth(9, i == 1 ? 100.001 : 100, 0);
    add(scenes[i], sphere(0, 0, -1, i == 2 ? 0.51 : 0.5, 0, 0), 0);
  }
  assert_ok(msim_scene_set_planes_constrain(scenes[3], 1, err));
  const char *wrong = run_ranks(3, check_differences, scenes);
  if (wrong) fail_msg("%s", wrong);
  for (int i = 0; i < 4; i++) msim_scene_destroy(scenes[i]);
}

static const char *check_functions(msim_comm *comm, void *data) {
  msim_options opt = options("velocity-verlet", 1e-4);
  msim_sim *sim, *copy;
  msim_error why = {0};
  const char *text;
  msim_edit edit = {.size = sizeof edit};
  msim_estimate estimate = {.size = sizeof estimate};
  opt.comm = comm;
  EXPECT(msim_sim_create(data, &opt, &sim, &why) == MSIM_OK);
  const msim_status statuses[] = {
      msim_sim_set_springs(sim, NULL, NULL, NULL, &why),
      msim_sim_edit(sim, &edit, &why),
      msim_sim_break(sim, 0, NULL, &why),
      msim_sim_clone(sim, &copy, &why),
      msim_sim_estimate(sim, &estimate, &why),
      msim_sim_explain(sim, &text, &why),
  };
  for (size_t i = 0; i < sizeof statuses / sizeof *statuses; i++)
    if (statuses[i] != MSIM_ERR_UNSUPPORTED) return fail_rank(comm, "a function", why.text);
  EXPECT(strstr(why.text, "msim_sim_explain is not supported where 2 ranks share the scene"));
  EXPECT(msim_sim_set_step(sim, 5e-5, &why) == MSIM_OK && msim_sim_step(sim, 3, &why) == MSIM_OK);
  msim_sim_destroy(sim);
  return NULL;
}

static void functions_are_refused(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(9, 100, 0);
  const char *wrong = run_ranks(2, check_functions, cloth);
  if (wrong) fail_msg("%s", wrong);
  msim_scene_destroy(cloth);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(options_are_refused_on_all_ranks),
      cmocka_unit_test(different_scenes_are_refused),
      cmocka_unit_test(functions_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
