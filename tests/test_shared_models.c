/* Tests of models that share the layout of an island: the pilot runs of integrator = auto and the
 * sim they are for lay out a scene once. */
#include "auto_scenes.h"
#include "choose/pilot_run.h"
#include "laws.h"
#include "methods/methods.h"
#include "physics/fused_step.h"

static int shares(const ms_model *a, const ms_model *b) {
  return a->unknowns.particle == b->unknowns.particle && a->springs.i == b->springs.i &&
         a->half_edges.entry == b->half_edges.entry && a->mass == b->mass;
}

static int shares_islands(const msim_sim *a, const msim_sim *b) {
  int all = a->nislands == b->nislands;
  for (int32_t i = 0; all && i < a->nislands; i++)
    all = shares(&a->islands[i].model, &b->islands[i].model);
  return all;
}

/* a = F/m of a model in the state of its scene, 3n */
static void accelerate(const ms_model *m, double *out) {
  const ms_scene *s = m->scene;
  double *x, *v, *a;
  assert_true(MS_NEW_VECTORS(s, &m->unknowns, &x, &v, &a));
  ms_unknowns_gather(&m->unknowns, s->x, x);
  ms_unknowns_gather(&m->unknowns, s->v, v);
  ms_fused_step_run(m, &(ms_fused_step){.x = x, .v = v, .a = a});
  ms_unknowns_scatter(&m->unknowns, a, out);
  MS_FREE(&s->alloc, x, v, a);
}

/* A model has what it does not share, laws and forces, for itself, and outlives the first one. */
static void models_compute_the_same(void **state) {
  (void)state;
  enum { N = 40, M = 300 };
  msim_scene *scene = law_net(N, M, 0, 0.2, 7);
  double f[3 * N], before[3 * N] = {0}, after[3 * N] = {0};
  for (int i = 0; i < 3 * N; i++) f[i] = sin(i);
  assert_ok(msim_scene_set_forces(scene, f, err));
  ms_model first, second;
  assert_ok(ms_model_create(scene->data, 0, &first, err));
  assert_int_equal(*first.sharers, 1);
  accelerate(&first, before);
  assert_ok(ms_model_create_like(&first, 0, &second, err));
  assert_true(shares(&first, &second));
  assert_true(first.laws && second.laws && first.laws != second.laws);
  assert_true(first.force && second.force && first.force != second.force);
  assert_int_equal(first.features, second.features);
  assert_int_equal(*first.sharers, 2);
  ms_model_destroy(&first);
  assert_int_equal(*second.sharers, 1);
  accelerate(&second, after);
  assert_memory_equal(before, after, sizeof before);
  assert_true(after[3 * N - 1] != 0 || after[3 * N - 2] != 0);
  ms_model_destroy(&second);
  msim_scene_destroy(scene);
}

static void start_trial(ms_pilot_run *p, double tol, double h) {
  const ms_trial trial = {.method = &ms_dop853,
                          .collision = tol > 0 ? MSIM_COLLISION_EVENT : MSIM_COLLISION_REFLECT,
                          .tol = tol,
                          .h = h};
  msim_sim *sim;
  assert_ok(ms_pilot_run_start_late(p, &trial, &sim, err));
}

/* Islands of 600 and 700 particles, and a plane far below */
static msim_scene *two_ropes(void) {
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int i = 0; i < 2; i++) {
    const msim_rope rope = {.size = sizeof rope,
                            .n = 600 + 100 * i,
                            .from = {0, i, 0},
                            .to = {1, i, 0.1},
                            .mass = 1,
                            .k = 1000};
    assert_ok(msim_scene_add_rope(scene, &rope, err));
  }
  plane(scene, 0, 0, 1, -1000, 0.5, 0);
  return scene;
}

static void trials_share_a_layout(void **state) {
  (void)state;
  msim_scene *scene = two_ropes();
  const msim_options opt = options_of("auto", 1e-3, 0.1);
  msim_sim *sim = make_sim(scene, &opt), *other;
  const msim_state start = state_of(sim);
  ms_pilot_run p;
  assert_int_equal(sim->nislands, 2);
  assert_ok(ms_pilot_run_begin(sim, opt.tol, 0, &start, &p, err));
  assert_ok(ms_pilot_run_make(&p, err));
  start_trial(&p, 1e-3, 1e-4);
  assert_ok(ms_pilot_run_create_sim(&p, &ms_tr_bdf2, 1e-3, 1e-3, &other, err));
  const msim_sim *first = p.sims[MSIM_COLLISION_REFLECT];
  assert_true(shares_islands(first, p.sims[MS_CONTROLLED_SIM]));
  assert_true(shares_islands(first, other));
  assert_true(shares_islands(first, sim));
  assert_int_equal(*first->islands->model.sharers, 4);
  msim_sim_destroy(other);
  ms_pilot_run_end(&p);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* The islands of a sim with integrator = auto take over the layout of those before, if they have
 * the same components. */
static void a_sim_takes_over_models(void **state) {
  (void)state;
  msim_scene *scene = two_ropes();
  const msim_options fixed = options("velocity-verlet", 1e-4),
                     chosen = options_of("auto", 1e-3, 0.1);
  for (int32_t axis = -1; axis <= 0; axis++) {
    msim_sim *from = make_sim(scene, &fixed), *like = make_sim(scene, &chosen), *sim;
    const ms_half_edge_entry *entry = from->islands->model.half_edges.entry;
    assert_ok(ms_sim_create_empty_copy(like, &sim, err));
    ms_sim_take_models(sim, from);
    assert_int_equal(sim->nislands, 2);
    assert_ok(ms_sim_build_islands(sim, axis, err));
    assert_int_equal(sim->islands->model.half_edges.entry == entry, axis == -1);
    assert_int_equal(sim->islands->model.unknowns.dropped_axis, axis);
    assert_int_equal(*sim->islands->model.sharers, 1);
    msim_sim_destroy(from), msim_sim_destroy(like), msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

typedef struct size_counter {
  size_t size; /* of the allocations that count */
  int count;
} size_counter;

static void *count_size(size_t bytes, void *user) {
  size_counter *c = user;
  c->count += bytes == c->size;
  return malloc(bytes);
}

static void free_counted(void *ptr, void *user) {
  (void)user;
  free(ptr);
}

/* How many arrays ms_half_edges.entry there are until a sim of the scene is created and set */
static int count_layouts(const msim_scene *scene, const msim_options *opt, size_counter *c) {
  c->count = 0;
  msim_sim *sim = make_sim(scene, opt);
  assert_int_equal(*sim->islands->model.sharers, 1);
  const msim_state start = state_of(sim);
  assert_ok(msim_sim_set_state(sim, &start, err));
  assert_int_equal(*sim->islands->model.sharers, 1);
  c->size = sizeof(ms_half_edge_entry) * (size_t)sim->islands->model.half_edges.nentries +
            MS_ALIGNMENT + sizeof(void *);
  msim_sim_destroy(sim);
  return c->count;
}

/* Choices make trials, and islands are built anew after each one. */
static void a_scene_is_laid_out_once(void **state) {
  (void)state;
  size_counter counter = {0};
  const msim_allocator alloc = {
      .size = sizeof alloc, .alloc = count_size, .free = free_counted, .user = &counter};
  const msim_options fixed = options("velocity-verlet", 1e-4), chosen = options_of("auto", 1e-3, 1);
  const msim_rope rope = {
      .size = sizeof rope, .n = 700, .to = {1, 0, 0.1}, .mass = 1, .k = 1000, .damping = 1};
  msim_scene *scene;
  assert_ok(msim_scene_create(&alloc, &scene, err));
  assert_ok(msim_scene_add_rope(scene, &rope, err));
  count_layouts(scene, &fixed, &counter); /* finds the size */
  assert_int_equal(count_layouts(scene, &fixed, &counter), 1);
  assert_int_equal(count_layouts(scene, &chosen, &counter), 1);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(models_compute_the_same), cmocka_unit_test(trials_share_a_layout),
      cmocka_unit_test(a_sim_takes_over_models), cmocka_unit_test(a_scene_is_laid_out_once)};
  return cmocka_run_group_tests_name("shared_models", tests, NULL, NULL);
}
