/* Tests that no call reads or writes beyond a block of memory. Each block ends at an inaccessible
 * page, and a freed block is inaccessible as a whole. Sanitizers and valgrind detect more, but do
 * not run with every build. */
#define _DEFAULT_SOURCE /* MAP_ANONYMOUS */
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "base/memory.h"
#include "checkpoints.h"
#include "sample_recording.h"

/*------------------------------------- memory ---------------------------------------------------*/

/* Stored before a block: its pages. */
typedef struct pages {
  void *first;
  size_t bytes;
} pages;

/* ms_memory_allocate allocates sizeof(void *) + MS_ALIGNMENT bytes more than are used, and aligns
 * the address after the pointer. The block begins one pointer below an aligned address, so that
 * nothing is shifted, and the used bytes end less than MS_ALIGNMENT bytes before the inaccessible
 * page. */
static void *guarded_alloc(size_t bytes, void *user) {
  const size_t page = (size_t)sysconf(_SC_PAGESIZE);
  const size_t used = (bytes - sizeof(void *) - 1) / MS_ALIGNMENT * MS_ALIGNMENT;
  const size_t room = (used + MS_ALIGNMENT + page - 1) / page * page;
  char *first = mmap(NULL, room + page, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  (void)user;
  if (first == MAP_FAILED || mprotect(first, room, PROT_READ | PROT_WRITE)) return NULL;
  char *block = first + room - used - sizeof(void *);
  const pages all = {first, room + page};
  memcpy(block - sizeof all, &all, sizeof all);
  return block;
}

static void guarded_free(void *block, void *user) {
  pages all;
  (void)user;
  if (!block) return;
  memcpy(&all, (char *)block - sizeof all, sizeof all);
  munmap(all.first, all.bytes);
}

static const msim_allocator guarded = {sizeof guarded, guarded_alloc, guarded_free, NULL};

/*------------------------------------- scenes ---------------------------------------------------*/

/* Odd and even numbers of particles, none a multiple of 8; the second scene has several islands,
 * one of them at rest. */
static const char *const scenes[] = {
    "{\"msim\": 1, \"gravity\": [0, 0, -9.81], \"drag\": 0.1, \"objects\": [{\"type\": \"cloth\","
    " \"n\": [7, 9], \"origin\": [0, 0, 0], \"row\": [0, 1, 0], \"column\": [1, 0, 0], \"mass\": "
    "0.3, \"k\": 100,"
    " \"damping\": 0.01, \"pinned\": [0, 6]}],"
    " \"planes\": [{\"normal\": [0.1, 0, 1], \"offset\": -0.001, \"friction\": 0.2}]}",

    "{\"msim\": 1, \"objects\": ["
    "{\"type\": \"rope\", \"n\": 7, \"from\": [0, 0, 1], \"to\": [1, 0, 1], \"mass\": 1, \"k\": "
    "90},"
    "{\"type\": \"rope\", \"n\": 6, \"from\": [0, 1, 1], \"to\": [1, 1, 1], \"mass\": 1, \"k\": "
    "80}],"
    " \"particles\": {\"x\": [[0, 2, 1], [1, 2, 1], [3, 3, 3]], \"v\": [[0, 0, 1], [0, 0, 0],"
    " [1, 0, 0]], \"mass\": 1}, \"springs\": {\"ij\": [[0, 1], [2, 3]], \"k\": 9, \"rest\": 0.5}}",

    "{\"msim\": 1, \"gravity\": [0, 0, -9.81], \"objects\": [{\"type\": \"lattice\","
    " \"n\": [5, 5, 3], \"origin\": [0, 0, 0], \"size\": [1, 1, 1], \"mass\": 1, \"k\": 500, "
    "\"pinned\": [0, 1]}],"
    " \"planes\": [{\"normal\": [0, 0, 1], \"offset\": -0.002}]}"};
enum { SCENES = sizeof scenes / sizeof *scenes };

static msim_scene *make_scene(int i) {
  msim_scene *scene;
  assert_ok(msim_scene_parse(&guarded, "scene", scenes[i], strlen(scenes[i]), &scene, err));
  return scene;
}

/*------------------------------------- calls ----------------------------------------------------*/

/* Steps may end with a numerical event, but not with an error. */
static void step(msim_sim *sim) { assert_true(msim_sim_step(sim, 10, NULL) >= 0); }

static void change(msim_sim *sim) {
  enum { MOST = 3 * 80 };
  static double v[MOST], damping[1000];
  msim_state now = state_of(sim);
  msim_csr matrix = {.size = sizeof matrix};
  memcpy(v, now.v, 3 * (size_t)now.n * sizeof *v);
  v[3 * 2 + 2] += 0.125; /* particle 2 is pinned in no scene */
  now.v = v, now.v_half = NULL, now.t = 0;
  assert_ok(msim_sim_set_state(sim, &now, err));
  step(sim);
  if (!msim_sim_set_springs(sim, NULL, NULL, damping, NULL)) step(sim);
  if (!msim_sim_set_step(sim, 5e-4, NULL)) step(sim);
  assert_true(msim_sim_matrix(sim, &matrix, NULL) <= 0);
}

static void record_frame(msim_sim *sim, const char *path) {
  msim_recorder *recorder;
  if (msim_recorder_open(sim, path, &recorder, NULL)) return;
  assert_ok(msim_recorder_write(recorder, err));
  assert_ok(msim_recorder_close(recorder, err));
  remove(path);
}

/* All calls from creation to destruction; 0: the method refuses the scene or an option. */
static int run_all_calls(int i, const msim_options *opt) {
  msim_scene *scene = make_scene(i);
  const char *text;
  msim_sim *sim;
  const msim_status status = msim_sim_create(scene, opt, &sim, NULL);
  if (status) assert_int_equal(status, MSIM_ERR_ARG);
  if (!status) {
    assert_ok(msim_sim_explain(sim, &text, err));
    step(sim);
    const checkpoint c = save(sim);
    msim_sim *other = resume(scene, opt, &c);
    step(other);
    change(other);
    record_frame(other, "a.csv"), record_frame(other, "a.html");
    record_frame(other, "a.vtkhdf");
    msim_sim_destroy(other);
    free(c.bytes);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
  return !status;
}

/* With located impacts and without, with error control and without */
static int run_with_options(int i, const char *method) {
  const int chooses = strcmp(method, "auto") == 0;
  msim_options opt = options(method, chooses ? MSIM_H_AUTO : 1e-3);
  int lives = 0;
  opt.solver = "pcg", opt.steps = -1, opt.t_end = 0.05;
  opt.collision = MSIM_COLLISION_EVENT;
  lives += run_all_calls(i, &opt);
  opt.tol = 1e-4;
  lives += run_all_calls(i, &opt);
  opt.collision = MSIM_COLLISION_REFLECT, opt.tol = 0, opt.threads = 2;
  return lives + run_all_calls(i, &opt);
}

static void methods_keep_to_their_memory(void **state) {
  (void)state;
  const msim_integrator_entry *entry;
  for (int32_t m = 0; (entry = msim_integrator_info(m)) != NULL; m++) {
    int lives = 0;
    for (int i = 0; i < SCENES; i++) lives += run_with_options(i, entry->name);
    assert_true(lives >= 2);
  }
}

static void solvers_keep_to_their_memory(void **state) {
  (void)state;
  static const char *const solvers[] = {"auto", "cholmod", "klu", "sundials-pcg", "sundials-spgmr"};
  for (size_t k = 0; k < sizeof solvers / sizeof *solvers; k++)
    for (int i = 0; i < SCENES; i++) {
      msim_options opt = options("implicit-euler", 0.01);
      opt.solver = solvers[k];
      if (is_solver_available(solvers[k])) assert_true(run_all_calls(i, &opt));
    }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(methods_keep_to_their_memory),
                                     cmocka_unit_test(solvers_keep_to_their_memory)};
  return cmocka_run_group_tests_name("buffer_bounds", tests, enter_folder, leave_folder);
}
