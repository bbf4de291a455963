/* Tests of respa (multirate: stiff springs take shorter steps): cost, order 2 also with damping,
 * bit reproducibility, and plain velocity Verlet where a split saves nothing. */
#include <math.h>
#include <string.h>

#include "choose/rejection_reasons.h"
#include "counting_allocator.h"
#include "integrate/multirate.h"
#include "scenes.h"
#include "sim/sim.h"

enum { SIDE = 12, N = SIDE * SIDE, CORD = 5 };
#define T_END 0.2

/* A hanging net of k = 100; the springs along one of its rows form a cord of k = 1e6. The ends of
 * row 0 are pinned. */
static msim_scene *net(const msim_allocator *alloc, int row, double ratio) {
  msim_scene *cloth = hanging_cloth(SIDE, 100, 0), *scene;
  msim_scene_view view = {.size = sizeof view};
  static double k[8 * N], c[8 * N];
  const int32_t pins[2] = {0, SIDE - 1};
  msim_scene_get(cloth, &view);
  for (int32_t e = 0; e < view.nsprings; e++) {
    const int32_t i = view.ij[2 * e], j = view.ij[2 * e + 1];
    k[e] = i / SIDE == row && j == i + 1 ? 1e6 : 100;
    c[e] = ratio * k[e];
  }
  assert_ok(msim_scene_create(alloc, &scene, err));
  assert_ok(msim_scene_add_particles(scene, N, view.x, NULL, view.mass, err));
  assert_ok(msim_scene_add_springs(scene, view.nsprings, view.ij, k, view.rest, c, err));
  assert_ok(msim_scene_pin(scene, 2, pins, err));
  assert_ok(msim_scene_set_gravity(scene, view.gravity, err));
  msim_scene_destroy(cloth);
  return scene;
}

static msim_sim *sim_of(const msim_scene *scene, const char *method, double h) {
  const msim_options opt = options(method, h);
  return make_sim(scene, &opt);
}

/* x: positions at T_END; returns the number of spring evaluations */
static int64_t run(const msim_scene *scene, const char *method, double h, double *x) {
  msim_sim *sim = sim_of(scene, method, h);
  assert_ok(msim_sim_step(sim, (int64_t)round(T_END / h), err));
  memcpy(x, state_of(sim).x, 3 * N * sizeof *x);
  const int64_t springs = stats_of(sim).spring_evaluations;
  msim_sim_destroy(sim);
  return springs;
}

static double distance(const double *a, const double *b) {
  double sum = 0;
  for (int q = 0; q < 3 * N; q++) sum += (a[q] - b[q]) * (a[q] - b[q]);
  return sqrt(sum);
}

/* Velocity Verlet at its stability limit is accurate enough, too, but evaluates ten times as many
 * springs. */
static void a_stiff_cord_costs_a_tenth(void **state) {
  (void)state;
  static double exact[3 * N], x[3 * N], y[3 * N];
  msim_scene *scene = net(NULL, CORD, 0);
  run(scene, "velocity-verlet", 1e-5, exact);
  const int64_t verlet = run(scene, "velocity-verlet", 3.2e-5, x);
  const int64_t respa = run(scene, "respa", 8e-4, y);
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(scene, &view);
  const double moved = distance(exact, view.x);
  assert_true(moved > 0.1);
  assert_true(distance(y, exact) < 0.01 * moved);
  assert_true(10 * respa < verlet);
  msim_scene_destroy(scene);
}

/* Only the cord takes short steps: 11 springs and 12 particles. */
static void only_stiff_springs_are_evaluated_often(void **state) {
  (void)state;
  msim_scene *scene = net(NULL, CORD, 0);
  msim_sim *sim = sim_of(scene, "respa", 5e-4);
  const ms_multirate *split = sim->islands->stepper.split;
  const int32_t n = sim->islands->model.springs.n;
  assert_non_null(split);
  assert_int_equal(split->stiff.springs.n, SIDE - 1);
  assert_int_equal(split->stiff.unknowns.nfree, SIDE);
  assert_int_equal(split->soft.springs.n, n - (SIDE - 1));
  assert_ok(msim_sim_step(sim, 10, err));
  const msim_stats s = stats_of(sim);
  assert_int_equal(s.force_evaluations, 11 + 10 * (split->inner + 1));
  assert_int_equal(s.spring_evaluations,
                   11 * split->soft.springs.n + 10 * (split->inner + 1) * (SIDE - 1));
  const char *text;
  assert_ok(msim_sim_explain(sim, &text, err));
  assert_non_null(strstr(text, "springs       the 11 stiffest of "));
  assert_non_null(strstr(text, " substeps in each step of the others"));
  assert_non_null(text = strstr(text, "a step costs "));
  assert_in_range(1000 * strtod(text + strlen("a step costs "), NULL), 50, 150);
  assert_null(strstr(text, "may become unstable"));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Soft, stiff and very stiff springs of a chain: the stiff ones are separated where the step is too
 * long for them, and only there. */
static void the_partition_depends_on_the_step(void **state) {
  (void)state;
  enum { LINKS = 300, STIFF = 10, STIFFEST = 2 };
  static double x[3 * LINKS + 3], mass[LINKS + 1], k[LINKS];
  static int32_t ij[2 * LINKS];
  for (int i = 0; i <= LINKS; i++) x[3 * i] = i, mass[i] = 1;
  for (int e = 0; e < LINKS; e++) ij[2 * e] = e, ij[2 * e + 1] = e + 1, k[e] = e < STIFF ? 1e4 : 1;
  for (int e = 0; e < STIFFEST; e++) k[LINKS / 2 + e] = 1e8;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, LINKS + 1, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, LINKS, ij, k, NULL, NULL, err));
  static const struct {
    double h;
    int stiff, inner;
  } cases[] = {{5e-3, STIFFEST, 100}, {0.05, STIFF + STIFFEST, 1000}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    msim_sim *sim = sim_of(scene, "respa", cases[i].h);
    const ms_multirate *split = sim->islands->stepper.split;
    assert_non_null(split);
    assert_int_equal(split->stiff.springs.n, cases[i].stiff);
    assert_int_equal(split->inner, cases[i].inner);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

/*------------------------------------- order ----------------------------------------------------*/

/* With the same partition for every step length. */
static void run_partitioned(const msim_scene *scene, double h, int halvings, double *x, double *v) {
  msim_sim *sim = sim_of(scene, "respa", h);
  assert_non_null(sim->islands->stepper.split);
  sim->run.h = ldexp(h, -halvings);
  assert_ok(msim_sim_step(sim, (int64_t)round(0.05 / sim->run.h), err));
  const msim_state now = state_of(sim);
  memcpy(x, now.x, 3 * N * sizeof *x);
  memcpy(v, now.v, 3 * N * sizeof *v);
  msim_sim_destroy(sim);
}

/* Damped springs on both sides of the partition, and drag. */
static void damping_and_drag_keep_order_2(void **state) {
  (void)state;
  static double x[4][3 * N], v[4][3 * N];
  for (int damped = 0; damped < 2; damped++) {
    msim_scene *scene = net(NULL, CORD, damped ? 1e-6 : 0);
    assert_ok(msim_scene_set_drag(scene, damped ? 1e-3 : 0, err));
    for (int i = 0; i < 4; i++) run_partitioned(scene, 1e-4, i == 3 ? 5 : i, x[i], v[i]);
    const double in_x = log2(distance(x[1], x[3]) / distance(x[2], x[3]));
    const double in_v = log2(distance(v[1], v[3]) / distance(v[2], v[3]));
    print_message("  x: %.3f  v: %.3f\n", in_x, in_v);
    assert_close(in_x, 2, 0.15);
    assert_close(in_v, 2, 0.15);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- bits -----------------------------------------------------*/

static void same_bits(msim_sim *a, msim_sim *b) {
  const msim_state s = state_of(a), t = state_of(b);
  assert_memory_equal(s.x, t.x, 3 * N * sizeof *s.x);
  assert_memory_equal(s.v, t.v, 3 * N * sizeof *s.v);
}

static void threads_pieces_and_states_change_no_bit(void **state) {
  (void)state;
  for (int damped = 0; damped < 2; damped++) {
    msim_scene *scene = net(NULL, damped ? 0 : CORD, damped ? 1e-6 : 0);
    plane(scene, 0, 0, 1, -0.1, 0.5, 0.3);
    msim_options opt = options("respa", 5e-4);
    opt.threads = 1;
    msim_sim *whole = make_sim(scene, &opt), *first = make_sim(scene, &opt);
    opt.threads = 3;
    msim_sim *second = make_sim(scene, &opt);
    assert_ok(msim_sim_step(whole, 600, err));
    assert_ok(msim_sim_step(first, 200, err));
    const msim_state s = state_of(first);
    assert_ok(msim_sim_set_state(second, &s, err));
    assert_ok(msim_sim_step(second, 400, err));
    for (int i = 0; i < 40; i++) {
      const msim_state now = state_of(first);
      assert_ok(msim_sim_set_state(first, &now, err));
      assert_ok(msim_sim_step(first, 10, err));
    }
    assert_true(stats_of(whole).contacts > 0);
    same_bits(whole, first);
    same_bits(whole, second);
    msim_sim_destroy(whole), msim_sim_destroy(first), msim_sim_destroy(second);
    msim_scene_destroy(scene);
  }
}

/* A cord between pinned ends in a planar net: two components give the same results as three. */
static void planar_nets_are_partitioned_too(void **state) {
  (void)state;
  const double down[3] = {0, 9.81, 0};
  msim_scene *scene = net(NULL, 0, 0);
  assert_ok(msim_scene_set_gravity(scene, down, err));
  msim_options opt = options("respa", 5e-4);
  msim_sim *flat = make_sim(scene, &opt);
  assert_ok(msim_options_set(&opt, "skip.two_d", "off", err));
  msim_sim *full = make_sim(scene, &opt);
  assert_int_equal(flat->islands->stepper.split->stiff.unknowns.dims, 2);
  assert_int_equal(flat->islands->stepper.split->stiff.unknowns.nfree, SIDE - 2);
  assert_int_equal(full->islands->stepper.split->stiff.unknowns.dims, 3);
  assert_ok(msim_sim_step(flat, 100, err));
  assert_ok(msim_sim_step(full, 100, err));
  assert_close(distance(state_of(flat).x, state_of(full).x), 0, 1e-11);
  msim_sim_destroy(flat), msim_sim_destroy(full);
  msim_scene_destroy(scene);
}

/* A horizontal chain that falls on a plane is reflected at the end of the step, its stiff spring
 * too. */
static void planes_reflect_at_the_end_of_the_step(void **state) {
  (void)state;
  enum { LINKS = 6 };
  double x[3 * LINKS] = {0}, v[3 * LINKS] = {0}, mass[LINKS], k[LINKS - 1];
  int32_t ij[2 * (LINKS - 1)];
  for (int i = 0; i < LINKS; i++)
    x[3 * i] = i, x[3 * i + 2] = 0.0005, v[3 * i + 2] = -1, mass[i] = 1;
  for (int e = 0; e < LINKS - 1; e++) ij[2 * e] = e, ij[2 * e + 1] = e + 1, k[e] = e ? 10 : 1e6;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, LINKS, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, LINKS - 1, ij, k, NULL, NULL, err));
  plane(scene, 0, 0, 1, 0, 0.5, 0);
  msim_sim *sim = sim_of(scene, "respa", 0.01);
  assert_non_null(sim->islands->stepper.split);
  assert_ok(msim_sim_step(sim, 1, err));
  const msim_state s = state_of(sim);
  for (int i = 0; i < LINKS; i++) {
    assert_close(s.x[3 * i + 2], 0.5 * 0.0095, 1e-15);
    assert_close(s.v[3 * i + 2], 0.5, 1e-15);
  }
  assert_int_equal(stats_of(sim).contacts, LINKS);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* With another step or other springs the partition is that of a new sim with them. */
static void the_partition_depends_on_h_and_springs(void **state) {
  (void)state;
  msim_scene *scene = net(NULL, CORD, 0), *stiffer = net(NULL, CORD, 0);
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(scene, &view);
  double *k = calloc((size_t)view.nsprings, sizeof *k);
  for (int32_t e = 0; e < view.nsprings; e++) k[e] = e == 3 ? 1e5 : 100;
  msim_sim *sim = sim_of(scene, "respa", 5e-4), *fresh = sim_of(stiffer, "respa", 2.5e-4);
  assert_ok(msim_sim_step(sim, 50, err));
  msim_state s = state_of(sim);
  assert_ok(msim_sim_set_state(fresh, &s, err));
  const int32_t before = sim->islands->stepper.split->inner;
  assert_ok(msim_sim_set_step(sim, 2.5e-4, err));
  assert_true(sim->islands->stepper.split->inner < before);
  assert_ok(msim_sim_step(sim, 50, err));
  assert_ok(msim_sim_step(fresh, 50, err));
  same_bits(sim, fresh);
  assert_ok(msim_sim_set_springs(sim, k, NULL, NULL, err));
  assert_int_equal(sim->islands->stepper.split->stiff.springs.n, 1);
  assert_int_equal(state_of(sim).step, 100);
  same_bits(sim, fresh);
  for (int32_t e = 0; e < view.nsprings; e++) k[e] = 100;
  assert_ok(msim_sim_set_springs(sim, k, NULL, NULL, err));
  assert_null(sim->islands->stepper.split);
  assert_ok(msim_sim_step(sim, 10, err));
  free(k);
  msim_sim_destroy(sim), msim_sim_destroy(fresh);
  msim_scene_destroy(scene), msim_scene_destroy(stiffer);
}

/*------------------------------------- without stiff springs ------------------------------------*/

/* All springs of equal stiffness, or a step short enough for the stiffest: velocity Verlet, bit by
 * bit. */
static void without_stiff_springs_respa_is_velocity_verlet(void **state) {
  (void)state;
  static const struct {
    double h;
    int cord;
    const char *why;
  } cases[] = {{2e-5, 1, "h is short enough for all"},
               {1e-4, 0, "h is short enough for all"},
               {3e-3, 0, "there is no small group"}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    msim_scene *scene = cases[i].cord ? net(NULL, CORD, 0) : hanging_cloth(SIDE, 100, 0);
    msim_sim *sim = sim_of(scene, "respa", cases[i].h);
    msim_sim *verlet = sim_of(scene, "velocity-verlet", cases[i].h);
    const char *text;
    assert_null(sim->islands->stepper.split);
    assert_ok(msim_sim_step(sim, 20, err));
    assert_ok(msim_sim_step(verlet, 20, err));
    same_bits(sim, verlet);
    assert_ok(msim_sim_explain(sim, &text, err));
    assert_non_null(strstr(text, cases[i].why));
    msim_sim_destroy(sim), msim_sim_destroy(verlet);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- integrator = auto ----------------------------------------*/

/* If a few springs limit the step, `auto` chooses respa, which keeps tol at a quarter of the work.
 * It needs no pilot run, whose evaluations are an eighth of those of velocity Verlet in the whole
 * run, unless a plane could be met there. */
static void auto_chooses_respa_for_a_stiff_cord(void **state) {
  (void)state;
  static double exact[3 * N];
  msim_scene *scene = net(NULL, CORD, 0);
  const int64_t verlet = run(scene, "velocity-verlet", 3.2e-5, exact);
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(scene, &view);
  msim_options opt = options("auto", 1e-3);
  opt.tol = 1e-2, opt.t_end = T_END;
  msim_sim *sim = make_sim(scene, &opt);
  assert_string_equal(sim->config.integrator->entry.name, "respa");
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  assert_true(distance(state_of(sim).x, exact) < opt.tol * distance(exact, view.x));
  assert_true(4 * stats_of(sim).spring_evaluations < verlet);
  const double pilot = (double)verlet / view.nsprings / 8, cost = sim->config.choice.total_cost;
  print_message("  the choice: %.0f evaluations, pilot run %.0f\n", cost, pilot);
  assert_true(cost < pilot / 4);
  msim_sim_destroy(sim);
  plane(scene, 0, 0, 1, -100, 0, 0);
  sim = make_sim(scene, &opt);
  assert_string_equal(sim->config.integrator->entry.name, "respa");
  assert_true(sim->config.choice.total_cost > pilot / 2);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static msim_sim *choose(const msim_scene *scene, double tol, const ms_candidate **respa) {
  msim_options opt = options("auto", 1e-3);
  opt.tol = tol, opt.t_end = T_END;
  msim_sim *sim = make_sim(scene, &opt);
  for (int i = 0; i < MS_CANDIDATES; i++)
    if (sim->config.choice.candidates[i].method->is_multirate)
      *respa = &sim->config.choice.candidates[i];
  return sim;
}

/* Steps are halved until they keep tol, while they save three quarters. */
static void auto_halves_the_steps_of_respa(void **state) {
  (void)state;
  static double exact[3 * N];
  msim_scene *scene = net(NULL, CORD, 1e-5);
  const ms_candidate *respa, *halved, *rejected;
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(scene, &view);
  run(scene, "velocity-verlet", 1e-5, exact);
  msim_sim *at_2 = choose(scene, 1e-2, &respa), *at_4 = choose(scene, 1e-4, &halved),
           *at_9 = choose(scene, 1e-9, &rejected);
  assert_ptr_equal(at_2->config.integrator, respa->method);
  assert_ptr_equal(at_4->config.integrator, halved->method);
  assert_true(halved->h == respa->h / 4 && halved->error < 1e-4 && respa->error > 1e-4);
  assert_int_equal(rejected->rejection, MS_REASON_ERROR_TOO_LARGE);
  assert_ok(msim_sim_run(at_4, NULL, NULL, err));
  assert_true(distance(state_of(at_4).x, exact) < 1e-4 * distance(exact, view.x));
  msim_sim_destroy(at_2), msim_sim_destroy(at_4), msim_sim_destroy(at_9);
  msim_scene_destroy(scene);
}

/*------------------------------------- memory ---------------------------------------------------*/

static msim_status run_with_allocator(const msim_scene *scene, msim_error *why) {
  const msim_options opt = options("respa", 5e-4);
  msim_options chosen = options("auto", 1e-3);
  static double k[8 * N];
  msim_sim *sim = NULL;
  for (int e = 0; e < 8 * N; e++) k[e] = e == 3 ? 1e5 : 100;
  chosen.tol = 1e-2, chosen.t_end = T_END;
  msim_status status = msim_sim_create(scene, &chosen, &sim, why);
  msim_sim_destroy(sim), sim = NULL;
  if (!status) status = msim_sim_create(scene, &opt, &sim, why);
  if (!status) status = msim_sim_step(sim, 2, why);
  if (!status) status = msim_sim_set_step(sim, 4e-4, why);
  if (!status) status = msim_sim_step(sim, 2, why);
  if (!status) status = msim_sim_set_springs(sim, k, NULL, NULL, why);
  /* after a failed call the sim can go on */
  msim_error after;
  if (sim && msim_sim_step(sim, 2, &after)) fail_msg("%s", after.text);
  msim_sim_destroy(sim);
  return status;
}

static void every_allocation_may_fail(void **state) {
  (void)state;
  counting_allocator b = {.fail_at = -1};
  const msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free,
                                &b};
  msim_scene *scene = net(&alloc, CORD, 0);
  const int64_t kept = b.live;
  msim_error why;
  b.calls = 0;
  assert_int_equal(run_with_allocator(scene, &why), MSIM_OK);
  const int64_t total = b.calls;
  for (int64_t at = 0; at < total; at++) {
    b.calls = 0, b.fail_at = at;
    assert_int_equal(run_with_allocator(scene, &why), MSIM_ERR_MEMORY);
    assert_int_equal(b.live, kept);
  }
  b.fail_at = -1;
  msim_scene_destroy(scene);
  assert_int_equal(b.live, 0);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_stiff_cord_costs_a_tenth),
      cmocka_unit_test(only_stiff_springs_are_evaluated_often),
      cmocka_unit_test(the_partition_depends_on_the_step),
      cmocka_unit_test(damping_and_drag_keep_order_2),
      cmocka_unit_test(threads_pieces_and_states_change_no_bit),
      cmocka_unit_test(planar_nets_are_partitioned_too),
      cmocka_unit_test(planes_reflect_at_the_end_of_the_step),
      cmocka_unit_test(the_partition_depends_on_h_and_springs),
      cmocka_unit_test(without_stiff_springs_respa_is_velocity_verlet),
      cmocka_unit_test(auto_chooses_respa_for_a_stiff_cord),
      cmocka_unit_test(auto_halves_the_steps_of_respa),
      cmocka_unit_test(every_allocation_may_fail)};
  return cmocka_run_group_tests_name("respa", tests, NULL, NULL);
}
