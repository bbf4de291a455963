/* Tests of out-of-memory handling: each allocation of each call fails in turn, alone or with all
 * later ones. The call returns MSIM_ERR_MEMORY or succeeds without the memory; nothing leaks or
 * changes, and the repeated call gives the same bits as if nothing had failed. test_conformance
 * does the same for backends, test_memory_cli.py for the program. MSIM_LONG_TESTS: all methods on
 * all scenes. */
#define _POSIX_C_SOURCE 200809L /* mkdtemp */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "state_hash.h"
#include "linear/sparse_matrix.h"
#include "sample_recording.h"
#include "failing_allocator.h"

/*------------------------------------- scenes ---------------------------------------------------*/

typedef struct scene_features {
  int32_t side;
  int flat, plane, drag;
  double k, damping, g;
} scene_features;

/* A cloth with two pinned corners; with all parts 0 a few particles. */
static msim_status build_scene(msim_scene *s, const scene_features *p, msim_error *err) {
  const int32_t n = p->side, corners[2] = {0, n - 1}, cut[] = {0, 1};
  const double gravity[3] = {0, p->flat ? p->g : 0, p->flat ? 0 : p->g}, k = p->k + 1;
  const double x[6] = {2, 0, 0, 2, 1, 0}, v[6] = {0, 0.1, 0, 0, 0, 0}, mass[2] = {0.1, 0.2};
  const msim_cloth cloth = {.size = sizeof cloth,
                            .rows = n,
                            .columns = n,
                            .row = {0, 1, 0},
                            .column = {1, 0, 0},
                            .mass = 0.3,
                            .k_structural = p->k,
                            .k_shear = p->k,
                            .k_bend = p->k,
                            .damping = p->damping,
                            .npinned = 2,
                            .pinned = corners};
  const msim_plane floor = {{0, p->flat, !p->flat}, -0.002, 0.5, 0.2};
  msim_status status = msim_scene_set_name(s, "scarce", err);
  if (!status) status = msim_scene_set_gravity(s, gravity, err);
  if (!status) status = msim_scene_set_drag(s, p->drag ? 0.1 : 0, err);
  if (!status) status = msim_scene_add_particles(s, 2, x, v, mass, err);
  if (!status && p->k > 0) status = msim_scene_add_springs(s, 1, cut, &k, NULL, NULL, err);
  if (!status) status = msim_scene_add_cloth(s, &cloth, err);
  if (!status && p->plane) status = msim_scene_add_plane(s, &floor, err);
  return status;
}

enum { ISLANDS = 5, SCENES }; /* all but the last are small */
static const struct {
  const char *label;
  scene_features parts;
} scenes[SCENES] = {{"cloth", {.side = 5, .k = 100, .g = -9.81}},
                    {"flat cloth", {.side = 4, .flat = 1, .k = 100, .g = -9.81}},
                    {"damped cloth over a plane",
                     {.side = 4, .plane = 1, .drag = 1, .k = 100, .damping = 0.01, .g = -9.81}},
                    {"particles over a plane", {.side = 3, .plane = 1, .g = -9.81}},
                    {"cloth at rest", {.side = 3, .k = 100}},
                    {"islands", {.side = 24, .k = 100, .g = -9.81}}};

/*------------------------------------- one run --------------------------------------------------*/

typedef struct scenario scenario;
typedef msim_status call(scenario *l, msim_error *err);

/* A scene, a sim, and the call under test. */
struct scenario {
  const char *scene_label, *name;
  const scene_features *parts;
  msim_options opt;
  call *call;
  int by; /* FAILING_BY_... */
  msim_scene *scene;
  msim_sim *sim;
  msim_recorder *recorder;
};

static msim_status create_scene(scenario *l, msim_error *err) {
  const msim_allocator *alloc = l->by == FAILING_BY_ALLOCATOR ? failing_allocator_get() : NULL;
  msim_status status = msim_scene_create(alloc, &l->scene, err);
  if (!status) status = build_scene(l->scene, l->parts, err);
  if (!status) return MSIM_OK;
  msim_scene_destroy(l->scene);
  l->scene = NULL;
  return status;
}

static msim_status create_sim(scenario *l, msim_error *err) {
  return msim_sim_create(l->scene, &l->opt, &l->sim, err);
}

static void end_scenario(scenario *l) {
  msim_recorder_close(l->recorder, NULL);
  msim_sim_destroy(l->sim);
  msim_scene_destroy(l->scene);
  l->recorder = NULL, l->sim = NULL, l->scene = NULL;
}

/* Everything before the call under test. Assertions come only after blocks are no longer
 * counted. */
static msim_status prepare(scenario *l, msim_error *err) {
  msim_status status = l->call == create_scene ? MSIM_OK : create_scene(l, err);
  const int sim_too = l->call != create_scene && l->call != create_sim;
  if (!status && sim_too) status = create_sim(l, err);
  return !status && sim_too ? msim_sim_step(l->sim, 2, err) : status;
}

static msim_status run_to_end(scenario *l, msim_error *err) {
  msim_status status = l->sim ? MSIM_OK : create_sim(l, err);
  return status ? status : msim_sim_step(l->sim, 2, err);
}

typedef struct outcome {
  msim_status status, after; /* status: of the call; after: of what precedes and follows it */
  int reached;               /* 1: an allocation has failed */
  int changed;               /* 1: a call that failed has changed the state */
  uint64_t end;
  int64_t left;
  msim_error err;
} outcome;

/* One run in which allocation number `which` of the call fails. */
static outcome run_scenario(scenario *l, int64_t which, int all_later) {
  outcome o = {0};
  failing_allocator_count(l->by);
  failing_allocator_count_leaks();
  o.after = prepare(l, &o.err);
  const uint64_t before = l->sim ? hash_sim(l->sim) : 0;
  failing_allocator_arm(which, all_later);
  if (!o.after) o.status = l->call(l, &o.err);
  o.reached = failing_allocator_has_failed();
  failing_allocator_arm(-1, 0);
  o.changed = o.status && (l->sim ? hash_sim(l->sim) : 0) != before;
  if (o.status && o.reached) o.after = l->call(l, NULL);
  if (!o.after && (!o.status || o.reached)) o.after = run_to_end(l, NULL);
  o.end = l->sim ? hash_sim(l->sim) : 0;
  end_scenario(l);
  o.left = failing_allocator_count_leaks();
  failing_allocator_count(FAILING_NONE);
  return o;
}

static int64_t points;

static void sweep(scenario *l, int all_later) {
  char label[256];
  run_scenario(l, -1, 0); /* libraries allocate some memory only once */
  const outcome whole = run_scenario(l, -1, 0);
  snprintf(label, sizeof label, "%s, %s, %s, solver %s", l->scene_label, l->opt.integrator, l->name,
           l->opt.solver);
  if (whole.status == MSIM_ERR_ARG || whole.after == MSIM_ERR_ARG) return; /* not for this method */
  if (whole.status || whole.after || whole.left)
    fail_msg("%s: status %d and %d, %lld blocks left: %s", label, (int)whole.status,
             (int)whole.after, (long long)whole.left, whole.err.text);
  for (int64_t which = 0;; which++, points++) {
    const outcome o = run_scenario(l, which, all_later);
    const char *why = NULL;
    if (o.status && o.status != MSIM_ERR_MEMORY) why = "another status";
    else if (o.status && !o.err.text[0]) why = "no error message";
    else if (o.left) why = "blocks are not freed";
    else if (o.changed) why = "the state has changed";
    else if (o.after) why = "later calls fail";
    else if (o.end != whole.end) why = "another final state";
    if (why)
      fail_msg("%s, by %d, allocation %lld%s: %s: status %d, %lld blocks, after %d: %s", label,
               l->by, (long long)which, all_later ? " and later" : "", why, (int)o.status,
               (long long)o.left, (int)o.after, o.err.text);
    if (!o.reached) break;
  }
}

/* With malloc each allocation fails alone, with the allocator also all later ones; MSIM_LONG_TESTS:
 * both ways for both. */
static void sweep_all(scenario *l) {
  for (int by = FAILING_BY_MALLOC; by <= FAILING_BY_ALLOCATOR; by++)
    for (int all_later = 0; all_later < 2; all_later++) {
      l->by = by;
      if (by == FAILING_BY_MALLOC && !FAILING_MALLOC) continue;
      if (is_long() || all_later == (by == FAILING_BY_ALLOCATOR)) sweep(l, all_later);
    }
}

/*------------------------------------- calls ----------------------------------------------------*/

static msim_status step(scenario *l, msim_error *err) { return msim_sim_step(l->sim, 1, err); }

static msim_status set_springs(scenario *l, msim_error *err) {
  enum { MOST = 16384 };
  static double rest[MOST], damping[MOST];
  return msim_sim_set_springs(l->sim, NULL, rest, damping, err); /* rest = 0: other features */
}

static msim_status set_step(scenario *l, msim_error *err) {
  return msim_sim_set_step(l->sim, 0.0005, err);
}

/* A state out of the plane of the planar scenes. */
static msim_status set_state(scenario *l, msim_error *err) {
  enum { MOST = 3 * 4096 };
  static double v[MOST];
  msim_state state = state_of(l->sim);
  memcpy(v, state.v, 3 * (size_t)state.n * sizeof *v);
  v[2] += 0.125;
  state.v = v, state.v_half = NULL;
  return msim_sim_set_state(l->sim, &state, err);
}

static msim_status matrix(scenario *l, msim_error *err) {
  msim_csr A = {.size = sizeof A};
  return msim_sim_matrix(l->sim, &A, err);
}

static msim_status explain(scenario *l, msim_error *err) {
  const char *text;
  return msim_sim_explain(l->sim, &text, err);
}

static msim_status record_one(scenario *l, const char *path, msim_error *err) {
  msim_status status = msim_recorder_open(l->sim, path, &l->recorder, err);
  if (!status) status = msim_recorder_write(l->recorder, err);
  if (!status) status = msim_recorder_close(l->recorder, err);
  else msim_recorder_close(l->recorder, NULL);
  l->recorder = NULL;
  return status;
}

static msim_status record_csv(scenario *l, msim_error *err) { return record_one(l, "a.csv", err); }

static msim_status record_html(scenario *l, msim_error *err) {
  return record_one(l, "a.html", err);
}
static msim_status record_pvd(scenario *l, msim_error *err) { return record_one(l, "a.pvd", err); }

static msim_status record_hdf5(scenario *l, msim_error *err) {
  return record_one(l, "a.vtkhdf", err);
}

static msim_status save(scenario *l, msim_error *err) {
  return msim_scene_save(l->scene, "a.json", err);
}

/* A scene with every key, in strings of less than 16 characters: where the buffer for a longer one
 * cannot grow, jansson 2.14 loses characters or aborts, which msim cannot prevent. */
static msim_status load(scenario *l, msim_error *err) {
  static const char text[] =
      "{\"msim\": 1, \"name\": \"all of it\", \"gravity\": [0, 0, -9.81], \"drag\": 0.5,"
      " \"particles\": {\"x\": [[0, 0, 1], [1, 0, 1]], \"v\": [[0, 0, 0], [0.5, 0, 0]],"
      "                 \"mass\": [1, 2.5], \"pinned\": [0]},"
      " \"springs\": {\"ij\": [[0, 1]], \"k\": 10, \"rest\": [0.5], \"damping\": 0.1},"
      " \"objects\": [{\"type\": \"rope\", \"n\": 4, \"from\": [0, 1, 0], \"to\": [1, 1, 0],"
      "                \"mass\": 1, \"k\": 5},"
      "               {\"type\": \"lattice\", \"n\": [2, 2, 2], \"size\": [1, 1, 1],"
      "                \"origin\": [0, 0, 2], \"mass\": 1, \"k\": 5, \"pinned\": [0, 7]}],"
      " \"planes\": [{\"normal\": [0, 0, 1], \"offset\": -1, \"friction\": 0.25}],"
      " \"run\": {\"integrator\": \"heun\", \"h\": 0.001, \"solver.rtol\": 1e-9}}";
  const msim_allocator *alloc = l->by == FAILING_BY_ALLOCATOR ? failing_allocator_get() : NULL;
  msim_scene *scene = NULL;
  msim_status status = msim_scene_parse(alloc, "text", text, sizeof text - 1, &scene, err);
  msim_scene_destroy(scene);
  return status;
}

static int has_hdf5(void) {
  msim_plugin_entry entry = {.size = sizeof entry};
  for (int32_t i = 0; msim_recorder_info(i, NULL, &entry, NULL); i++)
    if (strcmp(entry.name, "hdf5") == 0) return entry.available;
  return 0;
}

/*------------------------------------- methods --------------------------------------------------*/

static scenario make_scenario(int scene, const char *method) {
  const int chooses = strcmp(method, "auto") == 0;
  scenario l = {.scene_label = scenes[scene].label, .parts = &scenes[scene].parts};
  l.opt = options(method, 0.001);
  l.opt.solver = "pcg";
  l.opt.threads = 1;
  if (chooses) l.opt.t_end = 0.02;
  else l.opt.steps = 100;
  return l;
}

#define SWEEP(life, function) \
  ((life).call = (function), (life).name = #function, sweep_all(&(life)))

static void scenes_are_made(void **state) {
  (void)state;
  for (int i = 0; i < ISLANDS; i++) {
    scenario l = make_scenario(i, "heun");
    SWEEP(l, create_scene);
    SWEEP(l, save);
    SWEEP(l, load);
  }
}

/* Each method on one scene, or on all. */
static void sims_are_made(void **state) {
  (void)state;
  const msim_integrator_entry *entry;
  for (int32_t m = 0; (entry = msim_integrator_info(m)) != NULL; m++)
    for (int i = 0; i < ISLANDS; i++) {
      scenario l = make_scenario(i, entry->name);
      if (!is_long() && i != m % ISLANDS) continue;
      SWEEP(l, create_sim);
      SWEEP(l, step);
      l.opt.collision = MSIM_COLLISION_EVENT;
      SWEEP(l, create_sim);
      SWEEP(l, step);
      l.opt.collision = MSIM_COLLISION_REFLECT;
      l.opt.steps = -1, l.opt.t_end = 1, l.opt.tol = 1e-4;
      SWEEP(l, create_sim);
      SWEEP(l, step);
      l.opt.tol = 0, l.opt.newton_retries = 2;
      SWEEP(l, create_sim);
    }
}

static void sims_are_changed(void **state) {
  (void)state;
  static const char *const methods[] = {
      "velocity-verlet",         "verlet", "respa", "dop853", "implicit-euler", "bdf2",
      "linearly-implicit-euler", "auto"};
  for (size_t m = 0; m < sizeof methods / sizeof *methods; m++)
    for (int i = 0; i < ISLANDS; i++) {
      scenario l = make_scenario(i, methods[m]);
      if (!is_long() && i != (int)m % 2) continue; /* planar or not */
      SWEEP(l, set_springs);
      SWEEP(l, set_step);
      SWEEP(l, set_state);
      SWEEP(l, matrix);
      SWEEP(l, explain);
    }
}

static void sims_are_recorded(void **state) {
  (void)state;
  for (int i = 0; i < ISLANDS; i++) {
    scenario l = make_scenario(i, "velocity-verlet");
    SWEEP(l, record_csv);
    SWEEP(l, record_html);
    SWEEP(l, record_pvd);
    l.call = record_hdf5, l.name = "record_hdf5";
    l.by = FAILING_BY_ALLOCATOR; /* libhdf5 crashes if malloc fails */
    for (int all_later = 0; all_later < 2 && has_hdf5(); all_later++) sweep(&l, all_later);
  }
  remove("a.csv"), remove("a.html"), remove("a.vtkhdf"), remove("a.json");
  remove("a.pvd"), remove("a_frames/000000.vtp"), rmdir("a_frames");
}

/* Systems large enough for islands, threads, a coarse space, a factorization. */
static void solvers_are_made(void **state) {
  (void)state;
  static const char *const solvers[] = {"pcg", "auto",         "cholmod",
                                        "klu", "sundials-pcg", "sundials-spgmr"};
  for (size_t k = 0; k < sizeof solvers / sizeof *solvers; k++) {
    scenario l = make_scenario(ISLANDS, "linearly-implicit-euler");
    if (strcmp(solvers[k], "auto") != 0 && !is_solver_available(solvers[k])) continue;
    l.opt.solver = solvers[k];
    l.opt.threads = k > 0 || !is_long() ? 1 : 2; /* two threads on a busy machine take long */
    l.by = FAILING_BY_ALLOCATOR;
    for (int all_later = 0; all_later < 2; all_later++)
      l.call = create_sim, l.name = "create_sim", sweep(&l, all_later);
  }
}

/* 2^31 / 9 blocks: the number of scalar entries would exceed the range of int32_t. */
static void matrices_too_large_are_refused(void **state) {
  (void)state;
  int32_t ptr[] = {0, 0, 500000000};
  const ms_sparse_graph graph = {.n = 2, .ptr = ptr};
  const ms_model model = {0};
  ms_sparse_matrix matrix;
  const ms_sparse_layout layout = {MSIM_FORMAT_UPPER, 3, NULL};
  msim_error why;
  assert_int_equal(ms_sparse_matrix_create(&model, &graph, layout, &matrix, &why), MSIM_ERR_ARG);
  assert_string_equal(why.text,
                      "the matrix has 250000002 blocks of 3 x 3 scalars, more than the limit of "
                      "238609294; use solver = pcg");
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(scenes_are_made),  cmocka_unit_test(sims_are_made),
      cmocka_unit_test(sims_are_changed), cmocka_unit_test(sims_are_recorded),
      cmocka_unit_test(solvers_are_made), cmocka_unit_test(matrices_too_large_are_refused)};
  const int failed = cmocka_run_group_tests_name("memory", tests, enter_folder, leave_folder);
  print_message("%lld allocations failed in turn\n", (long long)points);
  return failed;
}
