/* Tests of what makes springs that may break inexpensive: the bounds that spare their test never
 * hide one that the law itself breaks, and sweeps over half-edges have the bits of laws. */
#include "physics/law_breaking.h"

#include <float.h>

#include "laws.h"
#include "physics/force.h"

enum { KINDS = MSIM_LAW_CALLBACK + 1 };

static double within(unsigned *seed, double low, double high) {
  return low + (high - low) * uniform(seed);
}

static double log_uniform(unsigned *seed, double low, double high) {
  return pow(10, within(seed, low, high));
}

enum { MOST_POINTS = 12 };

typedef struct numbers {
  double a[MOST_POINTS], b[MOST_POINTS];
} numbers;

/* A law with one threshold or both; soft: polynomials and tables may fall */
static msim_law random_law(int kind, int soft, unsigned *seed, numbers *is) {
  msim_law law = {.size = sizeof law, .kind = kind};
  const int which = 1 + (int)within(seed, 0, 3);
  if (which & 1) law.break_strain = log_uniform(seed, -6, 1);
  if (which & 2) law.break_force = log_uniform(seed, -4, 4);
  if (kind == MSIM_LAW_DEAD_BAND) law.half_width = log_uniform(seed, -3, 0);
  if (kind == MSIM_LAW_POLYNOMIAL) {
    law.n = 1 + (int32_t)within(seed, 0, 5), law.limit = log_uniform(seed, -2, 1);
    for (int32_t i = 0; i < law.n; i++)
      is->a[i] = soft ? within(seed, -2, 2) : i % 2 ? 0 : within(seed, 0, 2);
    law.coefficients = is->a;
  }
  if (kind == MSIM_LAW_TABLE) {
    law.n = 2 + (int32_t)within(seed, 0, 10);
    is->a[0] = within(seed, -1, 0.2), is->b[0] = within(seed, -10, soft ? 10 : 0);
    for (int32_t i = 1; i < law.n; i++) {
      is->a[i] = is->a[i - 1] + log_uniform(seed, -3, -0.3);
      is->b[i] = is->b[i - 1] + within(seed, soft ? -5 : 0, 5);
    }
    law.stretch = is->a, law.force = is->b;
  }
  if (kind == MSIM_LAW_CALLBACK) law.function = sinh_law, law.largest_slope = 1000;
  return law;
}

/* The test written out: e > strain L, or f(e) > force */
static int breaks_at(const ms_law *law, double k, double rest, double l) {
  ms_law_batch at;
  at.only_force = 0;
  at.stretch[0] = l - rest;
  ms_law_evaluate(law, 1, &k, &rest, &at);
  const double strain = law->given.break_strain, force = law->given.break_force;
  return (strain > 0 && rest > 0 && l - rest > strain * rest) || (force > 0 && at.force[0] > force);
}

/* 1: the limit is that of the law, but for rounding errors. */
static int is_sharp(const ms_law *law, double stretch) {
  const int kind = law->given.kind,
            bent = kind == MSIM_LAW_POLYNOMIAL && stretch > law->given.limit;
  return law->given.break_force == 0 ||
         (kind != MSIM_LAW_CALLBACK && kind != MSIM_LAW_TABLE && !bent);
}

/* Springs at and around their limits, in units of the last place, and anywhere below */
static void no_limit_hides_a_break(void **state) {
  (void)state;
  const msim_allocator alloc = ms_memory_allocator(NULL);
  unsigned seed = 7;
  int64_t below = 0, sharp = 0;
  for (int i = 0; i < 40000; i++) {
    const int kind = i % KINDS, soft = i / KINDS % 2;
    numbers is;
    const msim_law given = random_law(kind, soft, &seed, &is);
    const double k = i % 50 == 49 ? 0 : log_uniform(&seed, -3, 6);
    const double rest = i % 20 == 19 ? 0 : log_uniform(&seed, -4, 3);
    ms_law law;
    assert_true(ms_laws_prepare(&alloc, &given, &law));
    const double limit = ms_law_breaking_limit(&law, k, rest);
    const double from = fmin(limit, 1e3 * (rest + 1));
    for (int j = 0; j < 60 && limit >= 0; j++) {
      const double part = j < 20 ? 1 - j * DBL_EPSILON : within(&seed, 0, 1);
      const double l = j < 40 ? from * part : fmax(0, rest + (from - rest) * part);
      below++;
      if (l <= limit && breaks_at(&law, k, rest, l))
        fail_msg("law %d of kind %d: a spring of k = %g, rest = %g breaks at %.17g, below %.17g", i,
                 kind, k, rest, l, limit);
    }
    if (!soft && limit < 1e300 && is_sharp(&law, limit - rest)) {
      sharp++;
      if (!breaks_at(&law, k, rest, limit * (1 + 1e-9) + 1e-9 * rest))
        fail_msg("law %d of kind %d: a spring of k = %g, rest = %g does not break beyond %.17g", i,
                 kind, k, rest, limit);
    }
    ms_laws_free_one(&alloc, &law);
  }
  assert_true(below > 1000000 && sharp > 10000);
}

/* Tables: where the force rises through the threshold, the limit is there, to 1e-6. */
static void limits_of_tables_are_sharp(void **state) {
  (void)state;
  const msim_allocator alloc = ms_memory_allocator(NULL);
  unsigned seed = 11;
  int sharp = 0;
  for (int i = 0; i < 2000; i++) {
    numbers is;
    msim_law given = random_law(MSIM_LAW_TABLE, 0, &seed, &is);
    given.break_strain = 0, given.break_force = within(&seed, 0.1, 30);
    ms_law law;
    assert_true(ms_laws_prepare(&alloc, &given, &law));
    const double limit = ms_law_breaking_limit(&law, 1, 2);
    if (limit >= 0 && limit < 100) {
      const double slope = fabs(law.slope) + 1;
      int at = 0; /* the force may be nearly constant just beyond the limit */
      for (double d = 1e-7; d < 3 && !at; d *= 2) at = breaks_at(&law, 1, 2, limit + d) ? 1 : 0;
      assert_true(at);
      msim_law nearly = given;
      nearly.break_force -= 1e-4 * slope;
      if (nearly.break_force > 0) {
        law.given.break_force = nearly.break_force;
        sharp += breaks_at(&law, 1, 2, limit + 1e-9);
      }
    }
    ms_laws_free_one(&alloc, &law);
  }
  assert_true(sharp > 500);
}

/*------------------------------------- all springs of a model -----------------------------------*/

enum { N = 60, M = 200 };

/* kind -1: of all kinds; share: of springs with a law */
static msim_scene *random_net(int planar, int kind, double share, unsigned *seed) {
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int32_t p = 0; p < N; p++) {
    const double x[3] = {within(seed, 0, 1), within(seed, 0, 1), planar ? 0 : within(seed, 0, 1)};
    const double mass = 1;
    assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
  }
  int32_t index[4];
  numbers is;
  for (int i = 0; i < 4; i++) {
    msim_law law = random_law(kind < 0 ? (int)within(seed, 0, KINDS) : kind, 0, seed, &is);
    law.break_strain = i % 2 ? 0 : 0.1, law.break_force = i % 2 ? 50 : 0;
    assert_ok(msim_scene_add_law(scene, &law, &index[i], err));
  }
  const ms_scene *s = scene->data;
  for (int32_t e = 0; e < M; e++) {
    const int32_t ij[2] = {e % N, (e % N + 1 + (int32_t)within(seed, 0, N - 1)) % N};
    const double *a = s->x + 3 * ij[0], *b = s->x + 3 * ij[1], k = within(seed, 0, 1000);
    const double rest = hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]) * within(seed, 0.91, 1);
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
    if (within(seed, 0, 1) < share) assert_ok(msim_scene_set_law(scene, 1, &e, index[e % 4], err));
  }
  const int32_t pinned[2] = {0, 1};
  assert_ok(msim_scene_pin(scene, 2, pinned, err));
  assert_ok(ms_scene_prepare_breaking(scene->data, err));
  return scene;
}

static int32_t count_by_test(const ms_scene *s, const double *x) {
  int32_t n = 0;
  for (int32_t e = 0; e < s->nsprings; e++) {
    const int32_t i = s->ij[2 * e], j = s->ij[2 * e + 1];
    const ms_law *law = ms_scene_law(s, e);
    double l2 = 0;
    if (!law || s->broken[e] || (i < 2 && j < 2)) continue;
    for (int c = 0; c < 3; c++) l2 += (x[3 * j + c] - x[3 * i + c]) * (x[3 * j + c] - x[3 * i + c]);
    n += breaks_at(law, s->k[e], s->rest[e], sqrt(l2));
  }
  return n;
}

/* Particles that move by small steps, in which springs come near their thresholds and back, pass
 * them or not, and break where they do: the count is that of the test, at all positions. */
static void walks_break_as_the_test_says(void **state) {
  (void)state;
  static double x[3 * N];
  unsigned seed = 3;
  int breaking = 0, spared = 0, steps = 0;
  for (int run = 0; run < 40; run++) {
    const int planar = run % 2;
    msim_scene *scene = random_net(planar, run % 4 < 2 ? MSIM_LAW_LINEAR : -1, 0.9, &seed);
    ms_scene *s = scene->data;
    ms_model model;
    assert_ok(ms_model_create(s, 0, &model, err));
    assert_int_equal(model.unknowns.dims, planar ? 2 : 3);
    double *at = ms_unknowns_new_vector(s, &model.unknowns);
    memcpy(x, s->x, sizeof x);
    const double size = log_uniform(&seed, -5, -2);
    for (int i = 0; i < 400; i++, steps++) {
      for (int32_t c = 0; c < 3 * N; c++)
        if (!planar || c % 3 < 2) x[c] += within(&seed, -size, size);
      ms_unknowns_gather(&model.unknowns, x, at);
      const int32_t expected = count_by_test(s, x);
      assert_int_equal(ms_law_breaking_count(&model, at), expected);
      spared += model.laws->slack > 0;
      if (expected == 0) continue;
      breaking++;
      ms_law_breaking_mark(&model, at, s->broken);
      ms_model_update_springs(&model, 0);
      assert_int_equal(count_by_test(s, x), 0);
      assert_int_equal(ms_law_breaking_count(&model, at), 0);
    }
    ms_memory_free(&s->alloc, at);
    ms_model_destroy(&model);
    msim_scene_destroy(scene);
  }
  assert_in_range(breaking, 200, steps / 2);
  assert_true(spared > steps / 4);
}

/*------------------------------------- forces ---------------------------------------------------*/

/* Where the sweep over half-edges computes linear laws, it does with the bits of the loop over
 * springs with laws, also of broken ones and beside other forces. */
static void sweeps_have_the_bits_of_laws(void **state) {
  (void)state;
  unsigned seed = 5;
  for (int run = 0; run < 40; run++) {
    const int planar = run % 2, in_sweep = run % 8 < 6;
    msim_scene *scene = random_net(planar, MSIM_LAW_LINEAR, in_sweep ? 1.1 : 0.9, &seed);
    ms_scene *s = scene->data;
    const double gravity[3] = {0.1, run % 3 ? -9.81 : 0, 0};
    double force[3 * N];
    for (int i = 0; i < 3 * N; i++) force[i] = planar && i % 3 == 2 ? 0 : within(&seed, -1, 1);
    if (run % 4 < 2) assert_ok(msim_scene_set_forces(scene, force, err));
    assert_ok(msim_scene_set_gravity(scene, gravity, err));
    for (int32_t e = 0; e < M; e++)
      s->broken[e] = within(&seed, 0, 1) < 0.2 ? MS_BROKEN : MS_INTACT;
    ms_model model;
    assert_ok(ms_model_create(s, 0, &model, err));
    assert_int_equal(model.unknowns.dims, planar ? 2 : 3);
    assert_int_equal(model.laws->in_sweep, in_sweep && model.half_edges.nparts == 0);
    double *x, *got, *expected;
    assert_true(MS_NEW_VECTORS(s, &model.unknowns, &x, &got, &expected));
    ms_unknowns_gather(&model.unknowns, s->x, x);
    ms_force_compute(&model, x, NULL, got);
    model.laws->in_sweep = 0;
    ms_force_compute(&model, x, NULL, expected);
    double size = 0;
    for (int32_t c = 0; c < model.unknowns.dims; c++)
      for (int32_t r = 0; r < model.unknowns.nfree; r++) {
        const int32_t at = c * model.unknowns.stride + r;
        assert_true(got[at] == expected[at]);
        size = fmax(size, fabs(got[at]));
      }
    assert_true(size > 1);
    MS_FREE(&s->alloc, x, got, expected);
    ms_model_destroy(&model);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(no_limit_hides_a_break),
                                     cmocka_unit_test(limits_of_tables_are_sharp),
                                     cmocka_unit_test(walks_break_as_the_test_says),
                                     cmocka_unit_test(sweeps_have_the_bits_of_laws)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
