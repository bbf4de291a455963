/* Tests of conjugate gradients with vectors of floats (with a coarse space, or precision = single)
 * against the textbook's in doubles, and in steps of both precisions: tolerances, number of
 * iterations, small motions, and bits of threads and resumed runs. */
#include <math.h>

#include "base/simd.h"
#include "checkpoints.h"
#include "linear/jacobi.h"
#include "linear/pcg.h"
#include "rank_scenes.h"
#include "two_level.h"

enum { SIZE = 64, SCENES = 5 };

static msim_options two_level_in(int32_t precision) {
  msim_options opt = two_level_options();
  opt.precision = precision;
  return opt;
}

/* A soft and a stiff cloth, each of two chunks of work; a solid; a mesh with a hub, whose row is
 * split; a cloth that moves in its plane */
static msim_scene *scene_of(int i) {
  const double g[3] = {0, -9.81, 0};
  if (i < 2) return hanging_cloth(40, i ? 1e5 : 1e3, 0.01);
  if (i < 4) return i == 2 ? hanging_cube(10, 1e3) : random_mesh(1500, 5, 0.01);
  msim_scene *scene = hanging_cloth(24, 1e3, 0);
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

/*------------------------------------- tolerances -----------------------------------------------*/

/* Iterations of some steps, each of which ends with a residual within rtol */
static int64_t count_iterations(const msim_scene *scene, int32_t precision, double rtol,
                                int32_t aggregate) {
  msim_options opt = two_level_in(precision);
  opt.solver_rtol = rtol;
  msim_sim *sim = make_two_level_sim(scene, &opt, aggregate);
  for (int i = 0; i < 6; i++) {
    assert_ok(msim_sim_step(sim, 1, err));
    const ms_solver *solver = sim->islands->stepper.solver;
    assert_true(solver->relative_residual > 0 && solver->relative_residual <= rtol);
  }
  const int64_t count = stats_of(sim).iterations;
  msim_sim_destroy(sim);
  return count;
}

static void every_tolerance_is_met(void **state) {
  (void)state;
  static const double rtol[] = {1e-3, 1e-6, 1e-8, 1e-12};
  for (int s = 0; s < SCENES; s++) {
    msim_scene *scene = scene_of(s);
    for (int at = 0; at < 16; at++)
      count_iterations(scene, at < 8 ? MSIM_PRECISION_SINGLE : MSIM_PRECISION_DOUBLE, rtol[at % 4],
                       at / 4 % 2 ? SIZE : 0);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- iterations -----------------------------------------------*/

/* Iterations of the textbook's conjugate gradients in doubles with the preconditioner of pcg, for
 * A x = b with the present matrix, until the norm of the residual is rtol times that of b */
static int64_t count_reference(msim_sim *sim, double rtol, const double *b) {
  const ms_solver *solver = sim->islands->stepper.solver;
  const ms_linear_system *system = &solver->system;
  const ms_model *m = system->model;
  double *r, *z, *p, *q, rho = 0;
  int64_t n = 0;
  assert_true(MS_NEW_VECTORS(m->scene, &m->unknowns, &r, &z, &p, &q));
  ms_vector_copy(m->shape, b, r);
  const double goal = rtol * ms_jacobi_norm(m, &system->a, b);
  for (; ms_jacobi_norm(m, &system->a, r) > goal; n++) {
    solver->linear->ops->precondition(solver->linear, r, z);
    const double before = rho;
    rho = ms_vector_dot(m->shape, r, z);
    ms_vector_add_scaled(m->shape, z, n ? rho / before : 0, p, p);
    ms_linear_system_apply(system, p, q);
    ms_vector_axpy(m->shape, -rho / ms_vector_dot(m->shape, p, q), q, r);
  }
  MS_FREE(&m->scene->alloc, r, z, p, q);
  return n;
}

/* Solves with the present matrix for a random b: meets rtol in at most `most` times the iterations
 * of doubles. */
static void expect_little_delay(msim_sim *sim, double rtol, double most) {
  ms_linear *linear = sim->islands->stepper.solver->linear;
  const ms_model *m = &sim->islands->model;
  double *b = ms_unknowns_new_vector(m->scene, &m->unknowns),
         *y = ms_unknowns_new_vector(m->scene, &m->unknowns);
  ms_vector_fill_random(m->shape, 1, b);
  const ms_linear_target target = {rtol, ms_jacobi_norm(m, &linear->system->a, b), 100000};
  int64_t count = 0;
  assert_ok(linear->ops->solve(linear, &target, b, y, &count, err));
  assert_true(linear->residual <= rtol * target.size);
  const int64_t wanted = count_reference(sim, rtol, b);
  if ((double)count > most * (double)wanted)
    fail_msg("%d particles, rtol %g: %d iterations, not %d", m->scene->nparticles, rtol, (int)count,
             (int)wanted);
  MS_FREE(&m->scene->alloc, b, y);
}

/* Rounding delays conjugate gradients (Greenbaum, Linear Algebra Appl. 113 (1989) 7), by less than
 * three quarters of the iterations, and with a coarse space, which leaves few slow modes, by less
 * than a fifth. */
static void floats_delay_it_little(void **state) {
  (void)state;
  static const double rtol[] = {1e-3, 1e-6, 1e-8, 1e-12};
  for (int s = 0; s < SCENES; s++)
    for (int at = 0; at < 8; at++) {
      msim_scene *scene = scene_of(s);
      const msim_options opt = two_level_in(MSIM_PRECISION_SINGLE);
      const int32_t aggregate = at < 4 ? SIZE : 0;
      msim_sim *sim = make_two_level_sim(scene, &opt, aggregate);
      assert_ok(msim_sim_step(sim, 6, err));
      expect_little_delay(sim, rtol[at % 4], aggregate ? 1.2 : 1.75);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

/* A cloth that has fallen on a plane of this normal, with the matrix of the last step */
static msim_sim *make_cloth_on_plane(double nx, double nz) {
  msim_scene *scene = hanging_cloth(24, 1e3, 0.01);
  plane(scene, nx, 0, nz, nx * 0.5 - 0.02, 0, 0.2);
  msim_options opt = two_level_in(MSIM_PRECISION_DOUBLE);
  opt.collision = MSIM_COLLISION_EVENT;
  msim_sim *sim = make_two_level_sim(scene, &opt, SIZE);
  assert_ok(msim_sim_step(sim, 20, err));
  assert_true(pcg_of(sim)->base.system->a.nconstraints > 8);
  msim_scene_destroy(scene);
  return sim;
}

/* The weights of constraints, 1e4 times the diagonal of their rows, do not keep vectors from being
 * floats on a floor. On a slope they do: floats were measured to take 1.4 to 1.8 times as many
 * iterations there. */
static void contacts_delay_it_little(void **state) {
  (void)state;
  static const double rtol[] = {1e-3, 1e-6, 1e-8, 1e-12};
  msim_sim *floor = make_cloth_on_plane(0, 1), *slope = make_cloth_on_plane(0.6, 0.8);
  const ms_jacobi *jacobi = &pcg_of(floor)->jacobi;
  assert_true(jacobi->scale > 1e3 * jacobi->coupling_scale);
  assert_true(pcg_of(floor)->rounds_vectors);
  assert_false(pcg_of(slope)->rounds_vectors);
  for (int i = 0; i < 4; i++) expect_little_delay(floor, rtol[i], 1.2);
  msim_sim_destroy(floor);
  msim_sim_destroy(slope);
}

/* They converge linearly at least: twice the digits take twice the iterations, although the
 * residual of the recursion drifts from the true one. With a restart at the drift it would be 2.4
 * to 2.8 times. */
static void twice_the_digits_take_twice_the_iterations(void **state) {
  (void)state;
  for (int s = 0; s < SCENES; s++) {
    msim_scene *scene = scene_of(s);
    for (int32_t aggregate = 0; aggregate <= SIZE; aggregate += SIZE) {
      const int64_t half = count_iterations(scene, MSIM_PRECISION_DOUBLE, 1e-6, aggregate),
                    whole = count_iterations(scene, MSIM_PRECISION_DOUBLE, 1e-12, aggregate);
      if ((double)whole > 2.3 * (double)half)
        fail_msg("scene %d: %d iterations, %d with twice the digits", s, (int)half, (int)whole);
    }
    msim_scene_destroy(scene);
  }
}

/* A stiff cube that swings about an edge: at rounding level, where the true residual no longer
 * follows that of the recursion, the iteration ends, or starts anew. */
static void the_rounding_level_is_reached(void **state) {
  (void)state;
  static const int32_t edge[] = {0, 1, 2, 3};
  const double g[3] = {0, 0, -9.81};
  const msim_lattice cube = {.size = sizeof cube,
                             .n = {8, 8, 8},
                             .extent = {1, 1, 1},
                             .mass = 1,
                             .k = 1e5,
                             .npinned = 4,
                             .pinned = edge};
  int64_t count[2];
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &cube, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  for (int i = 0; i < 2; i++) {
    msim_options opt = two_level_in(MSIM_PRECISION_DOUBLE);
    opt.solver_rtol = i ? 1e-14 : 1e-7;
    msim_sim *sim = make_two_level_sim(scene, &opt, SIZE);
    assert_ok(msim_sim_step(sim, 10, err));
    count[i] = stats_of(sim).iterations;
    msim_sim_destroy(sim);
  }
  assert_true(count[1] <= 3 * count[0]);
  msim_scene_destroy(scene);
}

/* A chain of springs of rest length 0 that hangs in one point: with gravity g its motion is g times
 * that with 1, to the bit if g is a power of 2, although squares of its numbers are no floats. */
static void motion_may_be_small(void **state) {
  (void)state;
  enum { N = 50 };
  static const double x[3 * N], rest[N];
  double mass[N], k[N], g[3] = {0, 0, 1};
  int32_t ij[2 * N];
  const int32_t pin = 0;
  msim_sim *sims[2];
  for (int i = 0; i < N; i++) mass[i] = 1 + i % 3, k[i] = 1e4, ij[2 * i] = i, ij[2 * i + 1] = i + 1;
  for (int small = 0; small < 2; small++) {
    msim_scene *scene;
    assert_ok(msim_scene_create(NULL, &scene, err));
    assert_ok(msim_scene_add_particles(scene, N, x, NULL, mass, err));
    assert_ok(msim_scene_add_springs(scene, N - 1, ij, k, rest, NULL, err));
    assert_ok(msim_scene_pin(scene, 1, &pin, err));
    if (small) g[2] = 0x1p-80;
    assert_ok(msim_scene_set_gravity(scene, g, err));
    const msim_options opt = two_level_in(MSIM_PRECISION_SINGLE);
    sims[small] = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sims[small], 20, err));
    msim_scene_destroy(scene);
  }
  const msim_state large = state_of(sims[0]), small = state_of(sims[1]);
  assert_true(large.x[3 * N - 1] > 0.05);
  for (int i = 0; i < 3 * N; i++) assert_true(small.x[i] == 0x1p-80 * large.x[i]);
  for (int i = 0; i < 2; i++) msim_sim_destroy(sims[i]);
}

/*------------------------------------- bits -----------------------------------------------------*/

static void threads_change_no_bit(void **state) {
  (void)state;
  for (int s = 0; s < 2 * SCENES; s++) {
    msim_scene *scene = scene_of(s / 2);
    msim_options opt = two_level_in(s % 2);
    msim_sim *sims[2];
    for (int i = 0; i < 2; i++) {
      opt.threads = i + 1;
      sims[i] = make_two_level_sim(scene, &opt, SIZE);
      assert_ok(msim_sim_step(sims[i], 8, err));
    }
    expect_same(sims[0], sims[1], "threads");
    for (int i = 0; i < 2; i++) msim_sim_destroy(sims[i]);
    msim_scene_destroy(scene);
  }
}

static void runs_resume_to_the_bit(void **state) {
  (void)state;
  static const int64_t at[] = {1, 5};
  for (int s = 0; s < 2 * SCENES; s++) {
    msim_scene *scene = scene_of(s / 2);
    const msim_options opt = two_level_in(s % 2);
    expect_resumable(scene, &opt, 9, 2, at, "single");
    msim_scene_destroy(scene);
  }
}

/* Any solver of the systems, which have doubles, makes the steps that pcg makes. */
static void any_solver_serves(void **state) {
  (void)state;
  static const char *const solvers[] = {"pcg", "cholmod", "klu"};
  msim_scene *scene = hanging_cloth(12, 1e3, 0.01);
  double x[3 * 144];
  for (int i = 0; i < 3; i++) {
    msim_options opt = two_level_in(MSIM_PRECISION_SINGLE);
    opt.solver = solvers[i];
    opt.solver_rtol = 1e-10;
    if (!is_solver_available(solvers[i])) continue;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 30, err));
    for (int k = 0; k < 3 * 144 && i > 0; k++) assert_close(state_of(sim).x[k], x[k], 1e-6);
    memcpy(x, state_of(sim).x, sizeof x);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

/* The numbers of pinned particles and padding in v and v' are 0, before and after a step, whatever
 * the solver leaves in their memory. */
static void what_is_pinned_stays_at_rest(void **state) {
  (void)state;
  for (int s = 0; s < 2 * SCENES; s++) {
    msim_scene *scene = scene_of(s / 2);
    const msim_options opt = two_level_in(s % 2);
    msim_sim *sim = make_sim(scene, &opt);
    const ms_stepper *at = &sim->islands->stepper;
    const ms_unknowns *rows = &sim->islands->model.unknowns;
    assert_ok(msim_sim_step(sim, 3, err));
    assert_int_equal(sim->islands->model.single != NULL, opt.precision == MSIM_PRECISION_SINGLE);
    for (int32_t i = 0; i < rows->dims * rows->stride; i++) {
      if (i % rows->stride < rows->nfree) continue;
      const double *v[] = {at->v, at->v_next};
      for (int k = 0; k < 2; k++) {
        if (opt.precision == MSIM_PRECISION_SINGLE) assert_true(((const float *)v[k])[i] == 0);
        else assert_true(v[k][i] == 0);
      }
    }
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* Entries that a cache cannot hold are fetched from memory before they are used (simd.h). */
static void many_entries_have_the_same_product(void **state) {
  (void)state;
  for (int s = 0; s < 2 * SCENES; s++) {
    msim_scene *scene = scene_of(s / 2);
    msim_options opt = two_level_in(s % 2 ? MSIM_PRECISION_SINGLE : MSIM_PRECISION_DOUBLE);
    msim_sim *sim = make_two_level_sim(scene, &opt, 0);
    assert_ok(msim_sim_step(sim, 1, err));
    const ms_pcg *pcg = (const void *)sim->islands->stepper.solver->linear;
    ms_half_edges *half_edges = &sim->islands->model.half_edges;
    const int32_t n = half_edges->nentries;
    const size_t bytes = sizeof(float) * (size_t)sim->islands->model.unknowns.nfree;
    double few, many;
    pcg->kernels->apply(pcg, 0, half_edges->nslices, &few);
    void *q = memcpy(malloc(bytes), pcg->q, bytes);
    memset(pcg->q, 0, bytes);
    half_edges->nentries = MS_CACHE; /* a fiction */
    pcg->kernels->apply(pcg, 0, half_edges->nslices, &many);
    half_edges->nentries = n;
    assert_true(few > 0 && few == many);
    assert_memory_equal(q, pcg->q, bytes);
    free(q);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(every_tolerance_is_met),
                                     cmocka_unit_test(floats_delay_it_little),
                                     cmocka_unit_test(contacts_delay_it_little),
                                     cmocka_unit_test(twice_the_digits_take_twice_the_iterations),
                                     cmocka_unit_test(the_rounding_level_is_reached),
                                     cmocka_unit_test(motion_may_be_small),
                                     cmocka_unit_test(threads_change_no_bit),
                                     cmocka_unit_test(runs_resume_to_the_bit),
                                     cmocka_unit_test(any_solver_serves),
                                     cmocka_unit_test(what_is_pinned_stays_at_rest),
                                     cmocka_unit_test(many_entries_have_the_same_product)};
  return cmocka_run_group_tests_name("single_pcg", tests, NULL, NULL);
}
