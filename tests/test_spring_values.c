/* Tests of the values of half-edges: they are those of the scene's springs, are stored once where
 * springs are alike, and follow changes of the springs. */
#include <stdlib.h>

#include "breaking.h"
#include "checkpoints.h"
#include "layout/spring_values.h"
#include "peak_allocator.h"
#include "physics/bounds.h"
#include "sim/sim.h"

static double random_value(void *seed) { return uniform(seed); }

/* Let `value` choose k, rest length and damping of each spring. */
static void change_springs(ms_scene *s, double (*value)(void *), void *data) {
  for (int32_t e = 0; e < s->nsprings; e++) {
    s->k[e] = 1 + value(data);
    s->rest[e] = 1 + value(data);
    s->damping[e] = 1 + value(data);
  }
}

static ms_model make_model(const msim_scene *scene) {
  ms_model model;
  assert_ok(ms_model_create(scene->data, 0, &model, err));
  return model;
}

/* Each half-edge has the values of its spring, and padding has 0. */
static void check_values(const ms_model *m) {
  const ms_half_edges *h = &m->half_edges;
  const ms_scene *s = m->scene;
  assert_true(h->nvalues <= h->room && h->room <= MS_SLICE * (size_t)h->nentries);
  for (int32_t at = 0; at < MS_SLICE * h->nentries; at++) {
    const size_t value = ms_half_edges_value(h, at);
    const int32_t e = h->spring[at] < 0 ? -1 : ms_springs_number(&m->springs, h->spring[at]);
    assert_true(value < h->nvalues && value % MS_SLICE == (size_t)at % MS_SLICE);
    assert_true(h->k[value] == (e < 0 ? 0 : s->k[e]) && h->stiffness[value] == h->k[value]);
    assert_true(h->rest[value] == (e < 0 ? 0 : s->rest[e]));
    assert_true(h->damping[value] == (e < 0 ? 0 : s->damping[e]));
  }
}

/* The sums of k over the springs of each row, those between two unknowns twice */
static void check_sums(const ms_model *m) {
  const ms_scene *s = m->scene;
  double *sum = calloc((size_t)m->unknowns.stride, sizeof *sum);
  for (int32_t i = 0; i < m->springs.n; i++) {
    const int32_t end[2] = {m->springs.i[i], m->springs.j[i]}, first = m->unknowns.first_fixed;
    const double share = end[0] < first && end[1] < first ? 2 : 1;
    for (int side = 0; side < 2; side++)
      sum[end[side]] += share * s->k[ms_springs_number(&m->springs, i)];
  }
  for (int32_t r = 0; r < m->unknowns.nfree; r++)
    assert_true(fabs(ms_bounds_sum_stiffness(m, r) - sum[r]) <= 1e-13 * sum[r]);
  free(sum);
}

static void check_sim(const msim_sim *sim) {
  for (int32_t i = 0; i < sim->nislands; i++) check_values(&sim->islands[i].model);
}

/* Two entries are alike by chance where both have a single half-edge, of the same spring. */
static int are_most_distinct(const ms_half_edges *h) {
  return 10 * h->nvalues > 9 * MS_SLICE * (size_t)h->nentries;
}

/*------------------------------------- tests ----------------------------------------------------*/

/* With 129 particles a side all distances are multiples of 1/128 or sqrt(2)/128: there are 3 rest
 * lengths. An entry is one of 12 neighbours, in lanes of which a row's end leaves out some. */
static void springs_of_a_grid_are_stored_once(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(129, 1000, 0.5);
  ms_model model = make_model(scene);
  check_values(&model);
  assert_true(model.half_edges.nvalues <= MS_SLICE * (size_t)model.half_edges.nentries / 50);
  assert_int_equal(model.half_edges.nvalues, model.half_edges.room);
  ms_model_destroy(&model);
  msim_scene_destroy(scene);
}

static void distinct_springs_are_stored_each(void **state) {
  (void)state;
  unsigned seed = 5;
  msim_scene *scene = hanging_cloth(90, 1000, 0);
  change_springs(scene->data, random_value, &seed);
  ms_model model = make_model(scene);
  check_values(&model);
  check_sums(&model);
  assert_true(are_most_distinct(&model.half_edges));
  ms_model_destroy(&model);
  msim_scene_destroy(scene);
}

/* Springs that differ in a single value are distinct, also where their hashes collide. */
static void each_value_counts(void **state) {
  (void)state;
  unsigned seed = 7;
  for (int which = 0; which < 3; which++) {
    msim_scene *scene = hanging_cloth(129, 1000, 0.5);
    ms_scene *s = scene->data;
    double *value = which == 0 ? s->k : which == 1 ? s->rest : s->damping;
    for (int32_t e = 0; e < s->nsprings; e++) value[e] = 1 + uniform(&seed);
    ms_model model = make_model(scene);
    check_values(&model);
    assert_true(are_most_distinct(&model.half_edges));
    ms_model_destroy(&model);
    msim_scene_destroy(scene);
  }
}

/* A spring that breaks may then differ from all others: an update in a step has the memory. */
static void springs_that_break_have_room(void **state) {
  (void)state;
  for (int breaks = 0; breaks < 2; breaks++) {
    msim_scene *scene = hanging_cloth(33, 1000, 0);
    add_linear(scene, breaks ? 0.5 : 0, breaks ? 0 : never);
    ms_model model = make_model(scene);
    assert_int_equal(model.half_edges.room, MS_SLICE * model.half_edges.nentries);
    ms_model_destroy(&model);
    msim_scene_destroy(scene);
  }
}

static void room_lets_springs_change(void **state) {
  (void)state;
  unsigned seed = 9;
  msim_scene *scene = hanging_cloth(33, 1000, 0);
  ms_model model = make_model(scene);
  const size_t before = model.half_edges.nvalues;
  assert_ok(ms_spring_values_reserve(scene->data, &model.springs, &model.half_edges, err));
  check_values(&model);
  assert_int_equal(model.half_edges.nvalues, before);
  change_springs(scene->data, random_value, &seed);
  ms_model_update_springs(&model, 0);
  check_values(&model);
  assert_true(are_most_distinct(&model.half_edges));
  for (int32_t e = 0; e < scene->data->nsprings; e++) scene->data->k[e] = e % 2 ? 3 : 4;
  ms_model_update_springs(&model, 0);
  check_values(&model);
  ms_model_destroy(&model);
  msim_scene_destroy(scene);
}

static msim_scene *two_cloths(void) {
  msim_scene *scene = hanging_cloth(20, 100, 0);
  const msim_cloth other = {.size = sizeof other,
                            .rows = 24,
                            .columns = 24,
                            .origin = {0, 0, 5},
                            .row = {0, 1, 0},
                            .column = {1, 0, 0},
                            .mass = 0.3,
                            .k_structural = 50,
                            .k_shear = 50,
                            .k_bend = 50};
  assert_ok(msim_scene_add_cloth(scene, &other, err));
  return scene;
}

/* A sim whose springs change moves as one that is created with these, and as one that goes on from
 * its checkpoint. */
static void sims_follow_changes(void **state) {
  (void)state;
  static const char *const methods[] = {"symplectic-euler", "symplectic-euler",
                                        "linearly-implicit-euler"};
  for (int i = 0; i < 3; i++) {
    unsigned seed = 3;
    msim_options opt = options(methods[i], 1e-5);
    if (i == 1) opt.precision = MSIM_PRECISION_SINGLE;
    msim_scene *scene = two_cloths(), *other = two_cloths();
    ms_scene *s = other->data;
    change_springs(s, random_value, &seed);
    msim_sim *changed = make_sim(scene, &opt), *created = make_sim(other, &opt);
    assert_true(changed->nislands == 2);
    assert_ok(msim_sim_set_springs(changed, s->k, s->rest, s->damping, err));
    check_sim(changed);
    assert_ok(msim_sim_step(changed, 20, err));
    if (i < 2) {
      assert_ok(msim_sim_step(created, 20, err));
      expect_same_motion(changed, created);
    }
    checkpoint c = save(changed);
    msim_sim *resumed = resume(other, &opt, &c);
    check_sim(resumed);
    assert_ok(msim_sim_step(changed, 5, err));
    assert_ok(msim_sim_step(resumed, 5, err));
    expect_same_motion(resumed, changed);
    free(c.bytes);
    msim_sim_destroy(changed), msim_sim_destroy(created), msim_sim_destroy(resumed);
    msim_scene_destroy(scene), msim_scene_destroy(other);
  }
}

/* Creation and an implicit step of a cloth that is large enough for a V-cycle, with its scene */
static void large_cloths_take_little_memory(void **state) {
  (void)state;
  enum { SIDE = 256, BYTES = 1500 };
  peak_allocator m = {0};
  const msim_allocator alloc = {sizeof alloc, peak_allocator_alloc, peak_allocator_free, &m};
  const msim_cloth cloth = {.size = sizeof cloth,
                            .rows = SIDE,
                            .columns = SIDE,
                            .row = {0, 1, 0},
                            .column = {1, 0, 0},
                            .mass = 0.3,
                            .k_structural = 1000,
                            .k_shear = 1000,
                            .k_bend = 1000};
  const msim_options opt = options("linearly-implicit-euler", 1.0 / 240);
  msim_scene *scene;
  msim_sim *sim;
  assert_ok(msim_scene_create(&alloc, &scene, err));
  assert_ok(msim_scene_add_cloth(scene, &cloth, err));
  assert_ok(msim_sim_create(scene, &opt, &sim, err));
  assert_ok(msim_sim_step(sim, 1, err));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  assert_int_equal(m.live, 0);
  assert_in_range(m.peak, 1, BYTES * SIDE * SIDE);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(springs_of_a_grid_are_stored_once),
                                     cmocka_unit_test(distinct_springs_are_stored_each),
                                     cmocka_unit_test(each_value_counts),
                                     cmocka_unit_test(springs_that_break_have_room),
                                     cmocka_unit_test(room_lets_springs_change),
                                     cmocka_unit_test(sims_follow_changes),
                                     cmocka_unit_test(large_cloths_take_little_memory)};
  return cmocka_run_group_tests_name("spring_values", tests, NULL, NULL);
}
