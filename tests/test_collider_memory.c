/* Tests of colliders that move or have samples, and of contacts, as memory runs out: each
 * allocation of a session fails in turn; errors are reported, nothing leaks, and a sim that could
 * not be changed goes on as before. */
#include "checkpoints.h"
#include "counting_allocator.h"
#include "limited_allocator.h"
#include "moving_colliders.h"

static const char text[] =
    "{\"msim\": 1, \"gravity\": [0, 0, -9.81], \"objects\": [{\"type\": \"rope\", \"n\": 5,\n"
    "  \"from\": [0, 0, 0.1], \"to\": [1, 0, 0.1], \"mass\": 1, \"k\": 100}], \"colliders\": [\n"
    "{\"type\": \"heightfield\", \"origin\": [0, 0, 0], \"spacing\": [0.5, 0.25], \"n\": [2, 2],\n"
    " \"heights\": [0, 0.1, 0, 0.1]},\n"
    "{\"type\": \"sdf\", \"origin\": [0, 0, 5], \"spacing\": [1, 1, 1], \"n\": [2, 2, 2],\n"
    " \"values\": [1, 1, 1, 1, 1, 1, 1, 1]},\n"
    "{\"type\": \"sphere\", \"center\": [0, 0, 0], \"radius\": 0.2, \"motion\": {\"t\": [0, 1],\n"
    "  \"x\": [[0, 0, -0.3], [0, 0, 0.3]], \"rotation\": [[0, 0, 0], [0, 0, 1]]}}]}";

/* Each call follows if all before have succeeded. */
static msim_status use(msim_sim *sim, msim_sim **copy, msim_error *err) {
  const double x[3] = {0, 0, 0.4};
  const msim_contact *all;
  int32_t n;
  size_t length;
  msim_status status = msim_sim_step(sim, 20, err);
  if (!status) status = msim_sim_contacts(sim, &n, &all);
  if (!status) status = msim_sim_move_collider(sim, 1, x, x, 0.1, err);
  if (!status) status = msim_sim_step(sim, 20, err);
  if (!status) status = msim_sim_clone(sim, copy, err);
  if (status) return status;
  void *bytes = malloc(msim_sim_save_size(sim));
  status = msim_sim_save(sim, bytes, msim_sim_save_size(sim), &length, err);
  if (!status) status = msim_sim_move_collider(sim, 2, x, NULL, 0.1, err);
  if (!status) status = msim_sim_load(sim, bytes, length, err);
  free(bytes);
  return status;
}

static msim_status hold_session(const msim_allocator *alloc, void *data) {
  (void)data;
  msim_scene *scene = NULL;
  msim_sim *sim = NULL, *copy = NULL;
  msim_error err;
  msim_options opt = options("velocity-verlet", 1e-3);
  opt.contacts = MSIM_CONTACTS_ON;
  msim_status status = msim_scene_parse(alloc, "text", text, strlen(text), &scene, &err);
  if (!status) status = msim_sim_create(scene, &opt, &sim, &err);
  if (!status) status = use(sim, &copy, &err);
  msim_sim_destroy(sim), msim_sim_destroy(copy);
  msim_scene_destroy(scene);
  return status;
}

static void sessions_end_without_leaks(void **state) {
  (void)state;
  assert_true(expect_memory_errors(hold_session, NULL) > 50);
}

static void moves_that_fail_change_nothing(void **state) {
  (void)state;
  const double x[3] = {0, 0, 0.4};
  counting_allocator b = {.fail_at = -1};
  const msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free,
                                &b};
  msim_scene *scene;
  assert_ok(msim_scene_parse(&alloc, "text", text, strlen(text), &scene, err));
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt), *twin = make_sim(scene, &opt);
  msim_status status = MSIM_ERR_MEMORY;
  int64_t failure = 0;
  for (; status == MSIM_ERR_MEMORY; failure++) {
    msim_error why;
    assert_ok(msim_sim_step(sim, 3, err));
    assert_ok(msim_sim_step(twin, 3, err));
    expect_same(sim, twin, "after a failure");
    b.fail_at = b.calls + failure;
    status = msim_sim_move_collider(sim, 2, x, x, 0.1, &why);
    b.fail_at = -1;
  }
  assert_int_equal(status, MSIM_OK);
  assert_true(failure > 10);
  msim_sim_destroy(sim), msim_sim_destroy(twin);
  msim_scene_destroy(scene);
  assert_int_equal(b.live, 0);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(sessions_end_without_leaks),
                                     cmocka_unit_test(moves_that_fail_change_nothing)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
