/* What the host promises to backends, kept in whole simulations: a checking backend stands between
 * msim and the solver that the argument names, and finds nothing to say. */
#include <stdio.h>
#include <string.h>

#include "checking_backend.h"
#include "scene_check.h"
#include "scenes.h"

enum { SIDE = 7, N = SIDE * SIDE, STEPS = 25 };

static const msim_backend *bare;

/* Blocks of the matrix: 3; 2 where gravity leaves the cloth in its plane; 1 where all rest lengths
 * and dampings are 0. */
static int block = 3;

static const char cloth[] =
    "{\"msim\": 1, \"gravity\": [0, 0, -9.81], \"objects\": [{\"type\": \"cloth\", \"n\": [7, 7],"
    " \"origin\": [0, 0, 0], \"row\": [0, 1, 0], \"column\": [1, 0, 0], \"mass\": 0.3,"
    " \"k\": {\"structural\": 300, \"shear\": 300, \"bend\": 300}, \"damping\": 0.01,"
    " \"pinned\": [\"first_corners\"]}]}";

typedef struct run {
  msim_status status;
  msim_stats stats;
  double x[3 * N];
  char text[1020]; /* what the user reads */
} run;

/* A cloth that starts crushed along one edge, so that the exact matrix is indefinite. */
static run simulate(const msim_allocator *alloc, const msim_backend *table, int32_t indefinite) {
  const msim_backend *const backends[] = {table, NULL};
  run r = {0};
  msim_error why = {0, ""};
  msim_scene *scene = NULL;
  msim_sim *sim = NULL;
  msim_options opt = options("linearly-implicit-euler", 0.02);
  opt.solver = table->name, opt.backends = backends, opt.indefinite = indefinite;
  r.status = msim_scene_parse(alloc, "cloth", cloth, sizeof cloth - 1, &scene, &why);
  static const double in_plane[3] = {0, -9.81, 0}, zeros[6 * N];
  if (!r.status && block == 2) r.status = msim_scene_set_gravity(scene, in_plane, &why);
  if (!r.status) r.status = msim_sim_create(scene, &opt, &sim, &why);
  if (!r.status && block == 1) r.status = msim_sim_set_springs(sim, NULL, zeros, zeros, &why);
  if (!r.status) {
    const msim_scene_view view = view_of(scene);
    for (int i = 0; i < 3 * N; i++) r.x[i] = view.x[i] * (i % 3 == 1 ? 0.7 : 1);
    const msim_state start = {.size = sizeof start, .n = N, .x = r.x, .v = view.v};
    r.status = msim_sim_set_state(sim, &start, &why);
  }
  if (!r.status) r.status = msim_sim_step(sim, STEPS, &why);
  if (sim) memcpy(r.x, state_of(sim).x, sizeof r.x), r.stats = stats_of(sim);
  memcpy(r.text, why.text, sizeof r.text);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return r;
}

static void assert_no_breach(void) {
  const char *report = checking_report();
  if (report[0]) fail_msg("promises were broken:\n%s", report);
}

/* Watched and alone: the same end, to the bit. */
static run simulate_watched(int32_t indefinite) {
  run alone = simulate(NULL, bare, indefinite);
  run watched = simulate(NULL, checking_backend(bare), indefinite);
  assert_no_breach();
  assert_int_equal(watched.status, alone.status);
  assert_string_equal(watched.text, alone.text);
  assert_memory_equal(watched.x, alone.x, sizeof alone.x);
  return watched;
}

static void clamped_where_it_is_indefinite(void **state) {
  (void)state;
  const run r = simulate_watched(MSIM_INDEFINITE_CLAMP);
  if (r.status) fail_msg("status %d, \"%s\"", (int)r.status, r.text);
  assert_int_equal(r.stats.steps, STEPS);
  if (!(bare->flags & MSIM_BACKEND_ITERATIVE)) assert_in_range(r.stats.indefinite_steps, 1, STEPS);
}

static void solved_where_it_is_indefinite(void **state) {
  (void)state;
  const run r = simulate_watched(MSIM_INDEFINITE_SOLVE);
  if (!(bare->flags & MSIM_BACKEND_SYMMETRIC)) {
    assert_int_equal(r.status, MSIM_ERR_ARG);
    assert_non_null(strstr(r.text, "cannot solve systems that are not positive definite"));
    return;
  }
  if (r.status) fail_msg("status %d, \"%s\"", (int)r.status, r.text);
  assert_in_range(r.stats.indefinite_steps, 1, STEPS);
}

static void stopped_where_it_is_indefinite(void **state) {
  (void)state;
  const run r = simulate_watched(MSIM_INDEFINITE_STOP);
  if (bare->flags & MSIM_BACKEND_ITERATIVE) return; /* it may not have seen it */
  assert_int_equal(r.status, MSIM_NOT_SPD);
  assert_int_equal(r.stats.steps, 0);
}

static void smaller_blocks(void **state) {
  (void)state;
  for (block = 2; block > 0; block--) {
    const run r = simulate_watched(MSIM_INDEFINITE_CLAMP);
    if (r.status) fail_msg("status %d, \"%s\"", (int)r.status, r.text);
    assert_int_equal(r.stats.steps, STEPS);
    if (block == 1) assert_int_equal(r.stats.assemblies, 1);
  }
  block = 3;
}

/* Memory ends after ever more allocations: an instance is still treated as promised. */
static void promises_hold_where_memory_ends(void **state) {
  (void)state;
  const msim_backend *watched = checking_backend(bare);
  for (int meals = 0, status = MSIM_ERR_MEMORY; status; meals++) {
    starving memory;
    const msim_allocator alloc = starving_allocator(&memory);
    memory.meals = meals;
    const run r = simulate(&alloc, watched, MSIM_INDEFINITE_CLAMP);
    status = r.status;
    if (status && status != MSIM_ERR_MEMORY)
      fail_msg("after %d allocations: status %d, \"%s\"", meals, status, r.text);
    assert_int_equal(memory.live, 0);
    assert_no_breach();
  }
}

int main(int argc, char **argv) {
  msim_error why;
  if (argc != 2) return 2;
  const msim_status status = msim_solver_backend(argv[1], NULL, &bare, &why);
  if (status) fprintf(stderr, "%s\n", why.text);
  if (status) return status == MSIM_ERR_NAME ? missing_status(argv[1]) : 1;
  const struct CMUnitTest tests[] = {cmocka_unit_test(clamped_where_it_is_indefinite),
                                     cmocka_unit_test(solved_where_it_is_indefinite),
                                     cmocka_unit_test(stopped_where_it_is_indefinite),
                                     cmocka_unit_test(smaller_blocks),
                                     cmocka_unit_test(promises_hold_where_memory_ends)};
  return cmocka_run_group_tests_name("promises", tests, NULL, NULL);
}
