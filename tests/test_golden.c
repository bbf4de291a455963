/* Tests of reproducibility: hashes of the final states of runs, for each instruction set, as stored
 * in golden.txt. They depend neither on the compiler nor on static or shared linking. A change that
 * changes bits on purpose renews the file, on a machine with AVX2, and says so:
 *
 *     for isa in baseline avx2 avx512; do MSIM_ISA=$isa test_golden_emulated print; done
 *
 * Direct solvers are left out, as their BLAS chooses its own kernels. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/isa.h"
#include "state_hash.h"

enum { STEPS = 15, MOST_LINES = 1024 };

static msim_scene *cloth(void) { return hanging_cloth(20, 100, 0); }

static msim_scene *solid(void) {
  msim_scene *scene = pinned_block(7, 1, 300, 0);
  plane(scene, 0, 0, 1, -0.01, 0.5, 0.2);
  return scene;
}

static msim_scene *damped(void) {
  msim_scene *scene = hanging_cloth(12, 100, 0.01);
  assert_ok(msim_scene_set_drag(scene, 0.02, err));
  plane(scene, 0.1, 0.2, 1, -0.01, 0.3, 0.4);
  return scene;
}

/* In the plane x, y, and of rest length 0. */
static msim_scene *flat(void) {
  const double gravity[3] = {0, -9.81, 0};
  msim_scene *scene = hanging_cloth(9, 50, 0);
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  return scene;
}

static const struct {
  const char *name;
  msim_scene *(*make)(void);
} scenes[] = {{"cloth", cloth}, {"solid", solid}, {"damped", damped}, {"flat", flat}};

/* 1 if the method takes the scene; *hash: of its final state. */
static int end_of(msim_scene *scene, const char *method, double tol, int precision,
                  uint64_t *hash) {
  msim_options opt = options(method, 0.002);
  msim_sim *sim;
  msim_error err;
  opt.solver = "pcg";
  opt.watch = MSIM_WATCH_OFF; /* an unbounded end state is compared all the same */
  opt.tol = tol;
  opt.precision = precision;
  opt.steps = tol > 0 ? -1 : STEPS;
  opt.t_end = tol > 0 ? STEPS * 0.002 : -1;
  if (msim_sim_create(scene, &opt, &sim, &err) != MSIM_OK) return 0;
  const msim_status status = msim_sim_run(sim, NULL, NULL, &err);
  if (status) fail_msg("%s: %s", method, err.text);
  *hash = hash_sim(sim);
  msim_sim_destroy(sim);
  return 1;
}

/* Call a function for each run, such as "avx2 solid heun". */
static void each(const char *isa, void (*tell)(const char *run, uint64_t hash)) {
  static const struct {
    const char *name;
    double tol;
    int precision;
  } ways[] = {{"", 0, MSIM_PRECISION_DOUBLE},
              {"/tol", 1e-3, MSIM_PRECISION_DOUBLE},
              {"/single", 0, MSIM_PRECISION_SINGLE}};
  const char *method;
  for (size_t s = 0; s < sizeof scenes / sizeof *scenes; s++) {
    msim_scene *scene = scenes[s].make();
    for (int32_t m = 0; (method = method_at(m)) != NULL; m++)
      for (int w = 0; w < 3; w++) {
        char run[128];
        uint64_t hash;
        snprintf(run, sizeof run, "%s %s %s%s", isa, scenes[s].name, method, ways[w].name);
        if (end_of(scene, method, ways[w].tol, ways[w].precision, &hash)) tell(run, hash);
      }
    msim_scene_destroy(scene);
  }
}

static void print(const char *run, uint64_t hash) { printf("%s %016" PRIx64 "\n", run, hash); }

static struct {
  char run[64];
  uint64_t hash;
} golden[MOST_LINES];
static int lines, wrong, checked;

static void read_golden(void) {
  char isa[16], scene[16], method[32];
  FILE *file = fopen(TEST_SOURCE_DIR "/golden.txt", "r");
  while (file && lines < MOST_LINES &&
         fscanf(file, "%15s %15s %31s %" SCNx64, isa, scene, method, &golden[lines].hash) == 4)
    snprintf(golden[lines++].run, sizeof golden->run, "%s %s %s", isa, scene, method);
  if (file) fclose(file);
}

static void check(const char *run, uint64_t hash) {
  int i = 0;
  while (i < lines && strcmp(golden[i].run, run) != 0) i++;
  checked++;
  if (i < lines && golden[i].hash == hash) return;
  wrong++;
  print_message("  %s ends in %016" PRIx64 "%s\n", run, hash,
                i < lines ? ", which is new" : ": not in the file");
}

static const char *isa_name(void) {
  static const char *const names[] = {"baseline", "avx2", "avx512"};
  return names[ms_isa_choose()];
}

static void runs_end_as_ever(void **state) {
  (void)state;
  int known = 0;
  for (int i = 0; i < lines; i++)
    known += strncmp(golden[i].run, isa_name(), strlen(isa_name())) == 0;
  each(isa_name(), check);
  assert_int_equal(wrong, 0);
  assert_int_equal(checked, known);
}

/* 1 if this machine supports MSIM_ISA, and the file has its hashes. */
static int is_there(void) {
  const char *asked = getenv("MSIM_ISA");
  int there = 0;
  for (int i = 0; i < lines; i++)
    there |= strncmp(golden[i].run, isa_name(), strlen(isa_name())) == 0;
  return there && (!asked || strcmp(asked, isa_name()) == 0);
}

int main(int argc, char **argv) {
  if (argc > 1 && strcmp(argv[1], "print") == 0) return each(isa_name(), print), 0;
  const struct CMUnitTest tests[] = {cmocka_unit_test(runs_end_as_ever)};
  read_golden();
  if (!is_there()) {
    print_message("no hashes for %s on this machine\n", getenv("MSIM_ISA"));
    return 77;
  }
  return cmocka_run_group_tests_name("golden", tests, NULL, NULL);
}
