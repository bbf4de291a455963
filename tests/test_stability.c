/* Tests of frequency bounds against matrices, and of stability limits of the methods against
 * runs. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../tools/bench_reference/theory.h"
#include "methods/rkc.h"
#include "stability.h"

enum { N = 30, NS = 80 };

/* Random masses, springs and positions; two particles pinned. */
static msim_scene *tangle(unsigned seed, double spread, double damping, double drag) {
  double x[3 * N], mass[N], k[NS], rest[NS], c[NS];
  int32_t ij[2 * NS];
  const int32_t held[2] = {0, 7};
  for (int i = 0; i < 3 * N; i++) x[i] = uniform(&seed);
  for (int i = 0; i < N; i++) mass[i] = exp(spread * (uniform(&seed) - 0.5));
  for (int e = 0; e < NS; e++) {
    ij[2 * e] = e % N, ij[2 * e + 1] = (e % N + 1 + (int)(uniform(&seed) * (N - 1))) % N;
    k[e] = exp(2 * spread * (uniform(&seed) - 0.5));
    rest[e] = uniform(&seed), c[e] = damping * uniform(&seed);
  }
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, N, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, NS, ij, k, rest, c, err));
  assert_ok(msim_scene_pin(scene, 2, held, err));
  assert_ok(msim_scene_set_drag(scene, drag, err));
  return scene;
}

/* A cloth with one spring that is `stiffer` times as stiff as the others. */
static msim_scene *cloth_with_stiff_spring(int32_t side, double stiffer) {
  msim_scene *even = hanging_cloth(side, 100, 0), *scene;
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(even, &view);
  double *k = malloc((size_t)view.nsprings * sizeof *k);
  memcpy(k, view.k, (size_t)view.nsprings * sizeof *k);
  k[view.nsprings / 5] *= stiffer;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, view.nparticles, view.x, NULL, view.mass, err));
  assert_ok(msim_scene_add_springs(scene, view.nsprings, view.ij, k, NULL, NULL, err));
  free(k);
  msim_scene_destroy(even);
  return scene;
}

/*------------------------------------- bounds ---------------------------------------------------*/

/* 1 if lambda M - Lap_w - g I on the free particles is positive definite, by dense Cholesky; Lap_w:
 * the graph Laplacian with these weights, g: ground. */
static int is_above(const ms_scene *s, const double *weight, double ground, double lambda) {
  const int32_t n = s->nparticles;
  double *A = calloc((size_t)(n * n), sizeof *A);
  for (int32_t p = 0; p < n; p++) A[p * n + p] = s->pinned[p] ? 1 : lambda * s->mass[p] - ground;
  for (int32_t e = 0; e < s->nsprings; e++) {
    const int32_t i = s->ij[2 * e], j = s->ij[2 * e + 1];
    if (!s->pinned[i]) A[i * n + i] -= weight[e];
    if (!s->pinned[j]) A[j * n + j] -= weight[e];
    if (!s->pinned[i] && !s->pinned[j]) A[i * n + j] += weight[e], A[j * n + i] += weight[e];
  }
  int positive = 1;
  for (int32_t j = 0; j < n && positive; j++) {
    for (int32_t k = 0; k < j; k++) A[j * n + j] -= A[j * n + k] * A[j * n + k];
    positive = A[j * n + j] > 0;
    A[j * n + j] = sqrt(A[j * n + j]);
    for (int32_t i = j + 1; i < n && positive; i++) {
      for (int32_t k = 0; k < j; k++) A[i * n + j] -= A[i * n + k] * A[j * n + k];
      A[i * n + j] /= A[j * n + j];
    }
  }
  free(A);
  return positive;
}

/* Bounds are above the eigenvalues; the tight ones by at most a tenth, and never above the
 * Gershgorin bounds. */
static void check_bounds(msim_scene *scene) {
  const ms_scene *s = scene->data;
  const ms_bounds rough = bounds_of(scene, 0), sharp = bounds_of(scene, 1);
  const double omega2 = sharp.omega * sharp.omega * (1 + 1e-12), rate = sharp.rate * (1 + 1e-12);
  assert_true(sharp.omega <= rough.omega && sharp.rate <= rough.rate);
  assert_true(is_above(s, s->k, 0, omega2));
  assert_false(is_above(s, s->k, 0, omega2 / 1.1));
  if (rate > 0) assert_true(is_above(s, s->damping, s->external.drag, rate));
  assert_false(is_above(s, s->damping, s->external.drag, rate / 1.1));
  if (s->external.drag == 0) assert_true(sharp.least_rate == 0);
  msim_scene_destroy(scene);
}

static void bounds_are_above_and_close(void **state) {
  (void)state;
  const double stiffer[] = {1, 3, 4, 4.4, 4.8, 6, 1e3, 1e9};
  for (unsigned seed = 1; seed < 30; seed++)
    check_bounds(tangle(seed, seed % 7, seed % 2, 0.1 * (seed % 3)));
  for (size_t i = 0; i < sizeof stiffer / sizeof *stiffer; i++)
    check_bounds(cloth_with_stiff_spring(16, stiffer[i]));
  check_bounds(hanging_cloth(2, 1, 1));
  check_bounds(hanging_cloth(16, 1e5, 3));
  check_bounds(pinned_block(5, 1, 100, 0));
  check_bounds(ring(2, 0.5));
}

static void nothing_vibrates_without_springs(void **state) {
  (void)state;
  const double x[3] = {0};
  msim_scene *scene = make_single_particle(x, x, 9.81);
  ms_bounds b = bounds_of(scene, 1);
  assert_true(b.omega == 0 && b.rate == 0 && b.least_rate == 0);
  assert_ok(msim_scene_set_drag(scene, 0.5, err));
  b = bounds_of(scene, 1);
  assert_true(b.omega == 0 && b.rate == 0.5 && b.least_rate == 0.5);
  msim_scene_destroy(scene);
}

/* y = M^-1/2 (-J) M^-1/2 x from A = M - J */
static void apply(const msim_csr *A, const double *mass, const double *x, double *y) {
  for (int32_t r = 0; r < A->n; r++) {
    y[r] = -x[r];
    for (int32_t e = A->rowptr[r]; e < A->rowptr[r + 1]; e++)
      y[r] += A->val[e] * x[A->colind[e]] /
              sqrt(mass[A->particle[r / 3]] * mass[A->particle[A->colind[e] / 3]]);
  }
}

/* The largest eigenvalue of M^-1 (-J), from below, by power iteration. */
static double largest_eigenvalue(msim_sim *sim, const double *mass) {
  double x[3 * N], y[3 * N], quotient = 0;
  msim_csr A = {.size = sizeof A};
  unsigned seed = 5;
  assert_ok(msim_sim_matrix(sim, &A, err));
  for (int32_t r = 0; r < A.n; r++) x[r] = uniform(&seed) - 0.5;
  for (int round = 0; round < 300; round++) {
    double xx = 0, xy = 0, yy = 0;
    apply(&A, mass, x, y);
    for (int32_t r = 0; r < A.n; r++) xx += x[r] * x[r], xy += x[r] * y[r], yy += y[r] * y[r];
    for (int32_t r = 0; r < A.n; r++) x[r] = y[r] / sqrt(yy);
    quotient = xy / xx;
  }
  return quotient;
}

/* Stretched a thousand times, springs behave as if their rest length were 0, and the bound is
 * attained. */
static void bounds_hold_in_every_configuration(void **state) {
  (void)state;
  for (unsigned seed = 1; seed < 8; seed++) {
    msim_scene *scene = tangle(seed, 2, 0, 0);
    msim_scene_view view = {.size = sizeof view};
    msim_scene_get(scene, &view);
    msim_options opt = options("linearly-implicit-euler", 1);
    opt.solver = "pcg";
    msim_sim *sim = make_sim(scene, &opt);
    const double sharp = bounds_of(scene, 1).omega, bound = sharp * sharp;
    for (double scale = 0.01; scale < 2000; scale *= 10) {
      double x[3 * N];
      for (int i = 0; i < 3 * N; i++) {
        x[i] = view.x[i];
        if (!view.pinned[i / 3]) x[i] += scale * (uniform(&seed) - 0.5);
      }
      const msim_state there = {.size = sizeof there, .n = N, .x = x, .v = view.v};
      assert_ok(msim_sim_set_state(sim, &there, err));
      const double found = largest_eigenvalue(sim, view.mass);
      assert_true(found <= bound);
      if (scale > 500) assert_true(found > 0.9 * bound);
    }
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- limits ---------------------------------------------------*/

/* The bounds of a single mode, x'' = -g x' - w^2 x */
static ms_bounds mode(double w, double g) {
  return (ms_bounds){.omega = w, .rate = g, .least_rate = g, .ratio = w > 0 ? w * w / g : 0};
}

/* z = h omega of a single mode with damping zeta, from the closed forms of each method. */
static void limits_are_the_known_ones(void **state) {
  (void)state;
  const struct {
    const char *method;
    double zeta, z;
  } known[] = {{"explicit-euler", 0, 0},
               {"explicit-euler", 0.2, 0.4},
               {"heun", 0, 0},
               {"heun", 0.01, 0.444},
               {"heun", 0.05, 0.8},
               {"heun", 0.1, 1.04975},
               {"heun", 0.2, 1.39391},
               {"heun", 0.5, 2},
               {"symplectic-euler", 0, 2},
               {"symplectic-euler", 0.2, 1.63961},
               {"verlet", 0, 2},
               {"verlet", 2, 0.47214},
               {"velocity-verlet", 0, 2},
               {"velocity-verlet", 0.01, 1.98049},
               {"velocity-verlet", 0.2, 1.75734},
               {"velocity-verlet", 1, 1},
               {"velocity-verlet", 2, 0.5},
               {"rk4", 0, 2.82843},
               {"ssprk104", 0, 4.92145},
               {"rk6", 0, 2.48}};
  for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
    const double g = 2 * known[i].zeta * 50;
    assert_close(50 * limit_of(known[i].method, mode(50, g)), known[i].z, 6e-6);
  }
  for (int32_t i = 0; method_at(i); i++) {
    if (!has_limit(method_at(i))) continue;
    assert_true(isinf(limit_of(method_at(i), mode(0, 0))));
    if (takes_positions_only(method_at(i))) continue;
    if (strcmp(method_at(i), "ssprk102") == 0) assert_true(limit_of("ssprk102", mode(0, 3)) == 6);
    else assert_true(limit_of(method_at(i), mode(0, 3)) < 4.7); /* ssprk104: 13.92 / 3 */
  }
}

/* The benchmark has the theoretical limit of every method. The limit of msim never exceeds it, and
 * without damping it is at most 0.5 % lower. */
static void limits_are_within_theory(void **state) {
  (void)state;
  for (int32_t i = 0; method_at(i); i++) {
    const theory *t = theory_find(method_at(i));
    const ms_integrator *integrator;
    if (!t) fail_msg("the table of the benchmark has no theory of '%s'", method_at(i));
    assert_ok(ms_methods_find(method_at(i), &integrator, err));
    for (int z = 0; z < (t->undamped ? 1 : DAMPING_RATIOS) && integrator->limit; z++) {
      double peak;
      const double g = 2 * zetas[z], known = theory_limit(t, z, &peak);
      const ms_bounds bounds = mode(1, g);
      const double promised = integrator->limit(&bounds);
      assert_true(promised <= known * (1 + 1e-4));
      if (g == 0) assert_true(promised >= 0.995 * known);
    }
  }
}

/* The largest energy of the ring in so many steps, over its initial energy. */
static double growth(const msim_scene *scene, const char *method, double h, int steps) {
  msim_options opt = options(method, h);
  msim_sim *sim = make_sim(scene, &opt);
  msim_energy e = {.size = sizeof e};
  msim_error why;
  msim_sim_energy(sim, &e);
  const double start = e.total;
  double most = start;
  for (int i = 0; i < 50 && most < 1e100; i++) {
    if (msim_sim_step(sim, steps / 50, &why)) most = INFINITY;
    else msim_sim_energy(sim, &e);
    most = fmax(most, e.total);
  }
  msim_sim_destroy(sim);
  return most / start;
}

/* Motion stays bounded just below the limit and grows just above it, in scenes with a mode at both
 * bounds or with the pair of values that determines the limit. */
static void limits_are_where_motion_blows_up(void **state) {
  (void)state;
  const struct {
    const char *method;
    double damping, drag; /* as rate / omega */
    double beyond;
    int steps;
  } cases[] = {{"symplectic-euler", 0, 0, 1.05, 1000},
               {"symplectic-euler", 0.3, 0, 1.05, 1000},
               {"symplectic-euler", 0, 0.3, 1.05, 1000},
               {"symplectic-euler", 4, 0, 1.05, 1000},
               {"verlet", 0, 0, 1.05, 1000},
               {"verlet", 0.3, 0, 1.05, 1000},
               {"verlet", 0, 4, 1.05, 1000},
               {"velocity-verlet", 0, 0, 1.05, 1000},
               {"velocity-verlet", 0.3, 0, 1.05, 1000},
               {"velocity-verlet", 0, 0.3, 1.05, 1000},
               {"velocity-verlet", 0, 0.8, 1.05, 1000},
               {"velocity-verlet", 4, 0, 1.05, 1000},
               {"rk4", 0, 0, 1.05, 1000},
               {"rk4", 0.5, 0, 1.05, 1000},
               {"rk4", 1.08, 0, 1.05, 1000},
               {"rk4", 0, 4, 1.05, 1000},
               {"ssprk102", 0.5, 0.1, 1.05, 4000},
               {"ssprk102", 0, 4, 1.05, 1000},
               {"ssprk104", 0, 0, 1.05, 1000},
               {"ssprk104", 0.5, 0, 1.05, 1000},
               {"ssprk104", 0, 4, 1.05, 1000},
               {"rk6", 0, 0, 1.25, 3000},
               {"rk6", 0, 8, 1.05, 1000},
               {"explicit-euler", 0, 0.5, 1.05, 4000},
               {"explicit-euler", 0, 4, 1.05, 1000},
               {"heun", 0, 0.1, 1.05, 4000},
               {"heun", 0, 0.5, 1.05, 4000},
               {"heun", 0, 4, 1.05, 1000},
               {"rkn6", 0, 0, 1.00016, 30000}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    const double c = cases[i].damping * RING_OMEGA / 4, b = cases[i].drag * RING_OMEGA;
    msim_scene *scene = ring(c, b);
    const double limit = limit_of(cases[i].method, bounds_of(scene, 1));
    const double below = growth(scene, cases[i].method, 0.99 * limit, cases[i].steps);
    const double above = growth(scene, cases[i].method, cases[i].beyond * limit, cases[i].steps);
    print_message("  %-17s %4g %4g: limit %.4g, %.3g below, %.3g above\n", cases[i].method,
                  cases[i].damping, cases[i].drag, limit * RING_OMEGA, below, above);
    assert_true(below < 200);
    assert_true(above > 1e4);
    msim_scene_destroy(scene);
  }
}

/* Springs damp no motion perpendicular to them. */
static void damped_springs_leave_euler_without_a_limit(void **state) {
  (void)state;
  msim_scene *scene = ring(10, 0);
  assert_true(limit_of("explicit-euler", bounds_of(scene, 1)) == 0);
  assert_true(limit_of("heun", bounds_of(scene, 1)) == 0);
  msim_scene_destroy(scene);
}

/* Particles along a line with springs of rest length 0, a linear system: masses, k and damping
 * differ by orders of magnitude, so that K and C have no modes in common. With drag some springs
 * have no damping. The first particle is pinned if the seed is odd. */
static msim_scene *line(unsigned seed, double drag) {
  enum { MOST = 3 * RING };
  double x[3 * RING] = {0}, v[3 * RING] = {0}, mass[RING], k[MOST], rest[MOST] = {0}, c[MOST];
  int32_t ij[2 * MOST], first = 0;
  const int springs = RING - 1 + (int)(seed % RING), pins = (int)(seed % 2);
  seed += 7919;
  for (int i = 0; i < RING; i++) {
    x[3 * i] = uniform(&seed), v[3 * i] = uniform(&seed) - 0.5;
    mass[i] = pow(10, 2 * uniform(&seed) - 1);
    if (pins && i == 0) v[0] = 0;
  }
  for (int e = 0; e < springs; e++) {
    const int i = e < RING - 1 ? e : (int)(uniform(&seed) * RING);
    const int apart = e < RING - 1 ? 1 : 2 + (int)(uniform(&seed) * (RING - 3));
    ij[2 * e] = i, ij[2 * e + 1] = (i + apart) % RING;
    k[e] = pow(10, 3 * uniform(&seed)), c[e] = pow(10, 3 * uniform(&seed) - 1);
    if (drag > 0 && uniform(&seed) < 0.4) c[e] = 0;
  }
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, RING, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, springs, ij, k, rest, c, err));
  assert_ok(msim_scene_set_drag(scene, drag, err));
  if (pins) assert_ok(msim_scene_pin(scene, 1, &first, err));
  return scene;
}

/* Damping takes energy from every mode except the rigid ones, which keep theirs. */
static void rkc_is_stable_up_to_its_limit(void **state) {
  (void)state;
  for (unsigned seed = 1; seed <= 120; seed++) {
    msim_scene *scene = line(seed, seed % 3 ? 0 : pow(10, seed % 5 - 2.0));
    const ms_bounds b = bounds_of(scene, 1);
    const double limit = limit_of("rkc", b), grown = growth(scene, "rkc", limit, 2000);
    assert_true(limit > 0 && isfinite(limit));
    if (!(grown < 1 + 1e-9)) fail_msg("seed %u: energy grows by %g", seed, grown);
    msim_scene_destroy(scene);
  }
}

/* A spring without damping among damped ones */
static void rkc_has_no_limit_where_a_spring_is_undamped(void **state) {
  (void)state;
  const double x[6] = {0, 0, 1, 0, 0, 2}, v[6] = {0}, mass[2] = {1, 1}, k = 100, rest = 1, c = 0;
  const int32_t ij[2] = {RING, RING + 1};
  msim_scene *scene = ring(10, 0);
  assert_close(limit_of("rkc", bounds_of(scene, 1)), MS_RKC_STRIP * 10 / 100, 1e-14);
  assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, &c, err));
  assert_true(limit_of("rkc", bounds_of(scene, 1)) == 0);
  assert_ok(msim_scene_set_drag(scene, 0.1, err));
  assert_close(limit_of("rkc", bounds_of(scene, 1)), MS_RKC_STRIP * 0.1 / 200, 1e-14);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(bounds_are_above_and_close),
                                     cmocka_unit_test(nothing_vibrates_without_springs),
                                     cmocka_unit_test(bounds_hold_in_every_configuration),
                                     cmocka_unit_test(limits_are_the_known_ones),
                                     cmocka_unit_test(limits_are_within_theory),
                                     cmocka_unit_test(limits_are_where_motion_blows_up),
                                     cmocka_unit_test(damped_springs_leave_euler_without_a_limit),
                                     cmocka_unit_test(rkc_is_stable_up_to_its_limit),
                                     cmocka_unit_test(rkc_has_no_limit_where_a_spring_is_undamped)};
  return cmocka_run_group_tests_name("stability", tests, NULL, NULL);
}
