/* Tests of structs that begin with their size: a program that does not set it gets MSIM_ERR_SIZE,
 * and programs built with an older or a newer msim are served as far as both know the members. */
#include <stdio.h>
#include <string.h>

#include "base/sized.h"
#include "counting_allocator.h"
#include "scene/scene.h"
#include "scenes.h"

enum { LATER = 16 }; /* bytes of members that only a newer msim has */

static msim_sim *swinging_sim(msim_scene **scene, const char *integrator) {
  const msim_options opt = options(integrator, 1e-3);
  *scene = hanging_cloth(4, 100, 0.01);
  return make_sim(*scene, &opt);
}

static void assert_says(const msim_error *why, const char *sentence) {
  if (!strstr(why->text, sentence)) fail_msg("\"%s\" lacks \"%s\"", why->text, sentence);
}

static void structs_without_size_are_refused(void **state) {
  (void)state;
  msim_scene *scene;
  msim_error why;
  msim_sim *sim = swinging_sim(&scene, "linearly-implicit-euler");
  msim_scene_view view = {.nparticles = -7};
  msim_state s = {.n = -7};
  msim_energy energy = {.total = -7};
  msim_stats stats = {.steps = -7};
  msim_plan p = {.h = -7};
  msim_csr A = {.n = -7};
  assert_int_equal(msim_scene_get(scene, &view), MSIM_ERR_SIZE);
  assert_int_equal(msim_sim_state(sim, &s), MSIM_ERR_SIZE);
  assert_int_equal(msim_sim_energy(sim, &energy), MSIM_ERR_SIZE);
  assert_int_equal(msim_sim_stats(sim, &stats), MSIM_ERR_SIZE);
  assert_int_equal(msim_sim_plan(sim, &p), MSIM_ERR_SIZE);
  assert_int_equal(msim_sim_matrix(sim, &A, &why), MSIM_ERR_SIZE);
  assert_says(&why, "A.size is 0; it must be sizeof(msim_csr)");
  assert_true(view.nparticles == -7 && s.n == -7 && energy.total == -7 && stats.steps == -7 &&
              p.h == -7 && A.n == -7);
  s = state_of(sim);
  s.size = 0;
  assert_int_equal(msim_sim_set_state(sim, &s, &why), MSIM_ERR_SIZE);
  assert_says(&why, "state.size is 0; it must be sizeof(msim_state)");
  s.size = offsetof(msim_state, v); /* without what must be given */
  assert_int_equal(msim_sim_set_state(sim, &s, &why), MSIM_ERR_SIZE);
  energy.size = stats.size = sizeof(size_t); /* no member but the size */
  assert_int_equal(msim_sim_energy(sim, &energy), MSIM_ERR_SIZE);
  assert_int_equal(msim_sim_stats(sim, &stats), MSIM_ERR_SIZE);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void getters_refuse_null(void **state) {
  (void)state;
  msim_scene *scene;
  msim_sim *sim = swinging_sim(&scene, "verlet");
  assert_int_equal(msim_scene_get(scene, NULL), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_state(sim, NULL), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_energy(NULL, NULL), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_stats(sim, NULL), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_plan(NULL, NULL), MSIM_ERR_ARG);
  assert_int_equal(msim_options_init(NULL, sizeof(msim_options)), MSIM_ERR_ARG);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* An older program: members beyond its size are neither written nor read. */
static void smaller_structs_are_served(void **state) {
  (void)state;
  const double nowhere = 0;
  msim_scene *scene;
  msim_sim *sim = swinging_sim(&scene, "verlet");
  msim_state s = {.size = offsetof(msim_state, v_half), .v_half = &nowhere, .h = -7};
  assert_ok(msim_sim_step(sim, 3, err));
  assert_int_equal(msim_sim_state(sim, &s), MSIM_OK);
  assert_true(s.step == 3 && s.v && s.v_half == &nowhere && s.h == -7);
  s.h = 1e-3;
  assert_ok(msim_sim_set_state(sim, &s, err));
  msim_state full;
  memset(&full, 0x55, sizeof full);
  ms_sized_read(&full, sizeof full, &s);
  assert_true(full.step == 3 && !full.v_half && full.h == 0);
  msim_sim *other;
  msim_options opt = options("verlet", 1e-3);
  opt.size = offsetof(msim_options, backends);
  opt.backends = (const msim_backend *const *)&nowhere, opt.watch = opt.sync = 77;
  assert_ok(msim_sim_create(scene, &opt, &other, err));
  msim_sim_destroy(other);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Structs of a newer program: this msim knows the first part. */
typedef struct newer_state {
  msim_state known;
  unsigned char later[LATER];
} newer_state;
typedef struct newer_options {
  msim_options known;
  unsigned char later[LATER];
} newer_options;
typedef struct newer_rope {
  msim_rope known;
  unsigned char later[LATER];
} newer_rope;

static void assert_newer(msim_status status, const msim_error *why) {
  assert_int_equal(status, MSIM_ERR_SIZE);
  assert_says(why, "the program was built with a newer msim");
}

static void members_that_are_not_known_must_be_0(void **state) {
  (void)state;
  msim_scene *scene;
  msim_error why;
  msim_sim *sim = swinging_sim(&scene, "verlet"), *other = sim;
  newer_state s = {.known = {.size = sizeof s}};
  assert_int_equal(msim_sim_state(sim, &s.known), MSIM_OK);
  assert_ok(msim_sim_set_state(sim, &s.known, err));
  s.later[LATER - 1] = 1;
  assert_newer(msim_sim_set_state(sim, &s.known, &why), &why);
  newer_rope rope = {.known = {.size = sizeof rope, .n = 3, .to = {1}, .mass = 1}};
  assert_ok(msim_scene_add_rope(scene, &rope.known, err));
  rope.later[0] = 1;
  assert_newer(msim_scene_add_rope(scene, &rope.known, &why), &why);
  newer_options opt;
  memset(&opt, 0x55, sizeof opt);
  assert_int_equal(msim_options_init(&opt.known, sizeof opt), MSIM_OK);
  opt.known.integrator = "verlet";
  assert_ok(msim_sim_create(scene, &opt.known, &other, err));
  msim_sim_destroy(other);
  opt.later[0] = 1;
  assert_newer(msim_sim_create(scene, &opt.known, &other, &why), &why);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A size that was never set is not read that far. */
static void sizes_that_cannot_be_are_refused(void **state) {
  (void)state;
  msim_scene *scene;
  msim_error why;
  msim_sim *sim = swinging_sim(&scene, "verlet");
  msim_state s = state_of(sim);
  static const size_t sizes[] = {1, 7, SIZE_MAX, (size_t)1 << 40, sizeof s + 5000};
  for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
    s.size = sizes[i];
    assert_int_equal(msim_sim_set_state(sim, &s, &why), MSIM_ERR_SIZE);
    assert_says(&why, "it must be sizeof(msim_state)");
  }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void allocators_are_checked(void **state) {
  (void)state;
  static const char text[] = "{\"msim\": 1}";
  counting_allocator b = {.fail_at = -1};
  msim_allocator alloc = {
      .alloc = counting_allocator_alloc, .free = counting_allocator_free, .user = &b};
  msim_scene *scene;
  msim_error why;
  assert_int_equal(msim_scene_create(&alloc, &scene, &why), MSIM_ERR_SIZE);
  assert_says(&why, "alloc.size is 0; it must be sizeof(msim_allocator)");
  assert_int_equal(msim_scene_parse(&alloc, "text", text, sizeof text - 1, &scene, &why),
                   MSIM_ERR_SIZE);
  assert_int_equal(msim_scene_load(&alloc, "none.json", &scene, &why), MSIM_ERR_SIZE);
  assert_null(scene);
  alloc.size = offsetof(msim_allocator, user);
  assert_int_equal(msim_scene_create(&alloc, &scene, &why), MSIM_ERR_SIZE);
  alloc.size = sizeof alloc, alloc.free = NULL;
  assert_int_equal(msim_scene_create(&alloc, &scene, &why), MSIM_ERR_ARG);
  assert_says(&why, "alloc.alloc or alloc.free is NULL");
  assert_int_equal(b.calls, 0);
}

static void options_without_size_stay_as_they_are(void **state) {
  (void)state;
  msim_options opt;
  unsigned char before[sizeof opt];
  memset(&opt, 0x55, sizeof opt);
  memcpy(before, &opt, sizeof opt);
  assert_int_equal(msim_options_init(&opt, 0), MSIM_ERR_SIZE);
  assert_memory_equal(&opt, before, sizeof opt);
}

/* A wrong option leaves those before it unset. It is added here, as scene files with one are
 * refused. */
static void options_of_a_scene_are_set_all_or_none(void **state) {
  (void)state;
  static const char text[] =
      "{\"msim\": 1, \"particles\": {\"x\": [[0, 0, 0]], \"mass\": 1},"
      " \"run\": {\"integrator\": \"verlet\", \"h\": 0.5, \"threads\": 3}}";
  msim_options opt, before;
  msim_scene *scene;
  assert_ok(msim_scene_parse(NULL, "text", text, sizeof text - 1, &scene, err));
  msim_options_init(&opt, sizeof opt);
  opt.size = offsetof(msim_options, warn);
  before = opt;
  assert_ok(msim_options_from_scene(&opt, scene, err));
  assert_true(opt.h == 0.5 && opt.threads == 3 && opt.size == before.size);
  newer_options newer;
  assert_int_equal(msim_options_init(&newer.known, sizeof newer), MSIM_OK);
  assert_ok(msim_options_from_scene(&newer.known, scene, err));
  assert_true(newer.known.h == 0.5 && newer.known.size == sizeof newer);
  opt = before;
  assert_ok(ms_scene_add_run_option(scene, "tol", "-1", err));
  assert_int_equal(msim_options_from_scene(&opt, scene, NULL), MSIM_ERR_ARG);
  assert_memory_equal(&opt, &before, sizeof opt);
  msim_scene_destroy(scene);
}

/* The last 32 bytes of msim_error are kept for later members: 0 after each call. */
static void the_reserved_part_of_an_error_is_0(void **state) {
  (void)state;
  static const unsigned char zeros[32];
  char label[2000];
  msim_error why;
  msim_scene *scene;
  memset(label, 'a', sizeof label);
  label[sizeof label - 1] = 0;
  for (int fails = 0; fails < 2; fails++) {
    memset(&why, 0x55, sizeof why);
    if (fails) assert_int_equal(msim_scene_load(NULL, label, &scene, &why), MSIM_ERR_IO);
    else assert_int_equal(msim_scene_create(NULL, &scene, &why), MSIM_OK);
    assert_int_equal(strlen(why.text), fails ? 987 : 0);
    assert_memory_equal(why.text + sizeof why.text - sizeof zeros, zeros, sizeof zeros);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(structs_without_size_are_refused),
                                     cmocka_unit_test(getters_refuse_null),
                                     cmocka_unit_test(smaller_structs_are_served),
                                     cmocka_unit_test(members_that_are_not_known_must_be_0),
                                     cmocka_unit_test(sizes_that_cannot_be_are_refused),
                                     cmocka_unit_test(allocators_are_checked),
                                     cmocka_unit_test(options_without_size_stay_as_they_are),
                                     cmocka_unit_test(options_of_a_scene_are_set_all_or_none),
                                     cmocka_unit_test(the_reserved_part_of_an_error_is_0)};
  return cmocka_run_group_tests_name("struct sizes", tests, NULL, NULL);
}
