/* Tests of msim_sim_islands in random scenes: components found by spreading the least number along
 * springs, energies by formulas written out, and their sums, those of msim_sim_energy. */
#include <math.h>

#include "breaking.h"
#include "checkpoints.h"
#include "failing_allocator.h"
#include "force_functions.h"

enum { N = 60, SPRINGS = 45, ANGLES = 12 };

static msim_islands islands_of(msim_sim *sim) {
  msim_islands all = {.size = sizeof all};
  assert_int_equal(msim_sim_islands(sim, &all), MSIM_OK);
  return all;
}

static int32_t pick(unsigned *seed, int32_t n) { return (int32_t)(uniform(seed) * n); }

static void add_random_links(msim_scene *scene, unsigned *seed, int32_t law) {
  for (int32_t e = 0; e < SPRINGS; e++) {
    const int32_t i = pick(seed, N), j = (i + 1 + pick(seed, N - 1)) % N, ij[2] = {i, j};
    const double k = 20 * uniform(seed);
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, NULL, NULL, err));
    if (e % 2) assert_ok(msim_scene_set_law(scene, 1, &e, law, err));
  }
  for (int32_t e = 0; e < ANGLES; e++) {
    const int32_t i = pick(seed, N), ijk[3] = {i, (i + 7) % N, (i + 19) % N};
    const double k = uniform(seed);
    assert_ok(msim_scene_add_angles(scene, 1, ijk, &k, (double[]){2}, NULL, err));
  }
}

/* Particles at random, every sixth pinned, with springs at random, angular ones and forces */
static msim_scene *random_scene(unsigned seed, field *trap) {
  double x[3 * N], v[3 * N], mass[N], force[3 * N];
  int32_t pin[N], npins = 0;
  msim_scene *scene;
  for (int32_t p = 0; p < N; p++) {
    mass[p] = 0.5 + uniform(&seed);
    for (int c = 0; c < 3; c++) {
      x[3 * p + c] = uniform(&seed), force[3 * p + c] = uniform(&seed) - 0.5;
      v[3 * p + c] = p % 6 ? uniform(&seed) - 0.5 : 0;
    }
    if (p % 6 == 0) pin[npins++] = p;
  }
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, N, x, v, mass, err));
  add_random_links(scene, &seed, add_linear(scene, 0.1, never));
  if (seed % 3) assert_ok(msim_scene_pin(scene, npins, pin, err));
  assert_ok(msim_scene_set_gravity(scene, (double[]){0.3, -0.2, -9.81}, err));
  assert_ok(msim_scene_set_forces(scene, force, err));
  if (seed % 2) {
    msim_force_function is = field_function(trap, MSIM_FORCE_JACOBIAN);
    is.potential = field_potential;
    assert_ok(msim_scene_set_force_function(scene, &is, err));
  }
  return scene;
}

typedef struct energies {
  double kinetic, elastic, gravitational;
} energies;

static int connect(const msim_scene_view *s, int32_t p, int32_t q, int32_t *least) {
  if (s->pinned[p] || s->pinned[q] || least[p] == least[q]) return 0;
  least[p] = least[q] = least[p] < least[q] ? least[p] : least[q];
  return 1;
}

/* least[p]: the least particle of p's component; N: p is pinned */
static void spread(const msim_scene_view *s, const uint8_t *broken, int32_t *least) {
  for (int32_t p = 0; p < N; p++) least[p] = s->pinned[p] ? N : p;
  for (int changed = 1; changed;) {
    changed = 0;
    for (int32_t e = 0; e < s->nsprings; e++)
      if (!broken[e]) changed |= connect(s, s->ij[2 * e], s->ij[2 * e + 1], least);
    for (int32_t e = 0; e < s->nangles; e++) {
      const int32_t *a = s->ijk + 3 * e;
      changed |= connect(s, a[0], a[1], least) | connect(s, a[1], a[2], least) |
                 connect(s, a[0], a[2], least);
    }
  }
}

static double distance_of(const double *x, int32_t p, int32_t q, double d[3]) {
  for (int c = 0; c < 3; c++) d[c] = x[3 * q + c] - x[3 * p + c];
  return sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
}

/* k (l - L)^2/2 and k (theta - rest)^2/2 to the least component of the particles */
static void add_elastic(const msim_scene_view *s, const uint8_t *broken, const double *x,
                        const int32_t *least, energies *sum) {
  double d[3], b[3];
  for (int32_t e = 0; e < s->nsprings; e++) {
    const int32_t i = s->ij[2 * e], j = s->ij[2 * e + 1];
    const double off = distance_of(x, i, j, d) - s->rest[e];
    if (!broken[e]) sum[s->pinned[i] ? least[j] : least[i]].elastic += s->k[e] * off * off / 2;
  }
  for (int32_t e = 0; e < s->nangles; e++) {
    const int32_t *a = s->ijk + 3 * e;
    const double la = distance_of(x, a[1], a[0], d), lb = distance_of(x, a[1], a[2], b);
    const double off =
        acos((d[0] * b[0] + d[1] * b[1] + d[2] * b[2]) / (la * lb)) - s->angle_rest[e];
    int32_t to = N;
    for (int c = 0; c < 3; c++)
      if (least[a[c]] < to) to = least[a[c]];
    sum[to].elastic += s->angle_k[e] * off * off / 2;
  }
}

static void add_others(const msim_scene_view *s, const msim_state *now, double trap,
                       const int32_t *least, energies *sum) {
  for (int32_t p = 0; p < N; p++)
    for (int c = 0; c < 3; c++) {
      const double x = now->x[3 * p + c], v = now->v[3 * p + c];
      sum[least[p]].kinetic += s->mass[p] * v * v / 2;
      sum[least[p]].gravitational -= (s->mass[p] * s->gravity[c] + s->force[3 * p + c]) * x;
      if (s->force_function && !s->pinned[p]) sum[least[p]].gravitational += trap * x * x / 2;
    }
}

static void expect_islands(const msim_scene *scene, msim_sim *sim, double trap) {
  const msim_scene_view s = view_of(scene);
  uint8_t broken[MOST];
  int32_t least[N], number[N + 1], n = 0;
  energies sum[N + 1] = {{0}}, total = {0};
  assert_int_equal(msim_sim_broken(sim, broken), MSIM_OK);
  const msim_islands got = islands_of(sim);
  const msim_state now = state_of(sim);
  spread(&s, broken, least);
  add_elastic(&s, broken, now.x, least, sum);
  add_others(&s, &now, trap, least, sum);
  for (int32_t p = 0; p < N; p++)
    if (least[p] == p) number[p] = n++;
  number[N] = n;
  for (int32_t p = 0; p < N; p++) assert_int_equal(got.of[p], number[least[p]]);
  for (int32_t p = 0; p < N; p++) n += s.pinned[p] && n == number[N];
  assert_int_equal(got.n, n);
  for (int32_t p = 0; p <= N; p++) {
    if (p < N ? least[p] != p : n == number[N]) continue;
    assert_close(got.kinetic[number[p]], sum[p].kinetic, 1e-13);
    assert_close(got.elastic[number[p]], sum[p].elastic, 1e-12);
    assert_close(got.gravitational[number[p]], sum[p].gravitational, 1e-12);
  }
  for (int32_t i = 0; i < got.n; i++)
    total.kinetic += got.kinetic[i], total.elastic += got.elastic[i],
        total.gravitational += got.gravitational[i];
  const msim_energy e = energy_of(sim);
  assert_close(total.kinetic, e.kinetic, 1e-12);
  assert_close(total.elastic, e.elastic, 1e-12);
  assert_close(total.gravitational, e.gravitational, 1e-11);
}

static void energies_of_random_scenes(void **state) {
  (void)state;
  static const char *const methods[] = {"velocity-verlet", "dop853", "implicit-midpoint", "rk4"};
  field trap = {.k = 3};
  int64_t broken = 0;
  for (unsigned seed = 1; seed <= 100; seed++) {
    msim_scene *scene = random_scene(seed, &trap);
    msim_options opt = options(methods[seed % 4], 1e-3);
    opt.threads = 1 + (int32_t)(seed % 2);
    msim_sim *sim = make_sim(scene, &opt), *other = make_sim(scene, &opt);
    expect_islands(scene, sim, trap.k);
    for (int i = 0; i < 3; i++) {
      assert_ok(msim_sim_step(sim, 40, err));
      expect_islands(scene, sim, trap.k);
    }
    broken += stats_of(sim).broken;
    const checkpoint saved = save(sim);
    assert_ok(msim_sim_load(other, saved.bytes, saved.length, err));
    const msim_islands a = islands_of(sim), b = islands_of(other);
    assert_int_equal(a.n, b.n);
    assert_memory_equal(a.of, b.of, N * sizeof *a.of);
    assert_memory_equal(a.elastic, b.elastic, (size_t)a.n * sizeof *a.elastic);
    free(saved.bytes);
    msim_sim_destroy(sim), msim_sim_destroy(other);
    msim_scene_destroy(scene);
  }
  assert_true(broken > 100);
}

/* Two pendulums at one pinned particle, and a loose particle: the pin connects nothing. A broken
 * spring does not either. */
static void pins_and_broken_springs_connect_nothing(void **state) {
  (void)state;
  const double x[12] = {0, 0, 0, 1, 0, 0, 0, 2, 0, 5, 0, 0}, mass[4] = {1, 2, 3, 4};
  const int32_t ij[6] = {0, 1, 2, 0, 1, 2}, pin = 0, third = 2;
  const double k[3] = {8, 8, 8}, rest[3] = {0.5, 2, 1};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 4, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 3, ij, k, rest, NULL, err));
  assert_ok(msim_scene_set_law(scene, 1, &third, add_linear(scene, never, 0), err));
  assert_ok(msim_scene_pin(scene, 1, &pin, err));
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_int_equal(islands_of(sim).n, 3);
  assert_int_equal(islands_of(sim).of[2], 0);
  assert_ok(msim_sim_break(sim, 1, &third, err));
  const msim_islands all = islands_of(sim);
  assert_int_equal(all.n, 4);
  for (int32_t p = 0; p < 4; p++) assert_int_equal(all.of[p], (p + 3) % 4);
  assert_true(all.elastic[0] == 1 && all.elastic[1] == 0 && all.elastic[3] == 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void bad_calls_and_failing_allocations(void **state) {
  (void)state;
  field trap = {.k = 3};
  msim_scene *scene = random_scene(1, &trap);
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_scene *own;
  msim_sim *sim = make_sim(scene, &opt);
  msim_islands all = {.size = sizeof all}, none = {0};
  assert_int_equal(msim_sim_islands(NULL, &all), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_islands(sim, NULL), MSIM_ERR_ARG);
  assert_int_equal(msim_sim_islands(sim, &none), MSIM_ERR_SIZE);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);

  assert_ok(msim_scene_create(failing_allocator_get(), &own, err));
  assert_ok(msim_scene_add_particles(own, 2, (double[6]){0}, NULL, (double[]){1, 1}, err));
  sim = make_sim(own, &opt);
  for (int which = 0; which < 2; which++) {
    failing_allocator_count(FAILING_BY_ALLOCATOR);
    failing_allocator_arm(which, 0);
    assert_int_equal(msim_sim_islands(sim, &all), MSIM_ERR_MEMORY);
    assert_int_equal(failing_allocator_count_leaks(), 0);
    failing_allocator_count(FAILING_NONE);
  }
  assert_int_equal(islands_of(sim).n, 2);
  msim_sim_destroy(sim);
  msim_scene_destroy(own);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(energies_of_random_scenes),
                                     cmocka_unit_test(pins_and_broken_springs_connect_nothing),
                                     cmocka_unit_test(bad_calls_and_failing_allocations)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
