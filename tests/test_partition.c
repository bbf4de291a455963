/* Tests of the partition into islands: connected particles stay together, everything occurs once,
 * small components are merged, and no array grows with the number of islands. */
#include <stdlib.h>

#include "counting_allocator.h"
#include "layout/islands.h"
#include "scenes.h"
#include "sim/sim.h"

enum { MOST = 6000 };

/* For each free particle the first one that springs connect it with, by propagation of the lowest
 * number; -1 where pinned. Particles without springs count as connected. */
static void label(const ms_scene *s, int32_t *of) {
  static uint8_t touched[MOST];
  int32_t loose = -1;
  memset(touched, 0, sizeof touched);
  for (int32_t e = 0; e < 2 * s->nsprings; e++) touched[s->ij[e]] = 1;
  for (int32_t p = 0; p < s->nparticles; p++) {
    of[p] = s->pinned[p] ? -1 : p;
    if (s->pinned[p] || touched[p]) continue;
    if (loose < 0) loose = p;
    of[p] = loose;
  }
  for (int changed = 1; changed;) {
    changed = 0;
    for (int32_t e = 0; e < s->nsprings; e++) {
      int32_t *a = &of[s->ij[2 * e]], *b = &of[s->ij[2 * e + 1]];
      if (*a < 0 || *b < 0 || *a == *b) continue;
      *a = *b = *a < *b ? *a : *b;
      changed = 1;
    }
  }
}

/* Every particle and spring is in the right island; island[p]: that of a free particle p. */
static void check_members(const ms_scene *s, const ms_islands *islands, int32_t *island) {
  static int32_t pinned_in[MOST];
  static uint8_t has[MOST];
  int32_t springs = 0, free = 0, pulling = 0;
  for (int32_t p = 0; p < MOST; p++) pinned_in[p] = -1;
  for (int32_t i = 0; i < islands->n; i++) {
    const ms_island m = ms_islands_get(islands, i);
    free += m.nfree, springs += m.nsprings;
    memset(has, 0, sizeof has);
    for (int32_t k = 0; k < m.nfree; k++) {
      assert_false(s->pinned[m.free[k]]);
      assert_true(k == 0 || m.free[k - 1] < m.free[k]);
      island[m.free[k]] = i;
    }
    for (int32_t k = 0; k < m.npinned; k++) {
      assert_true(s->pinned[m.pinned[k]]);
      assert_true(k == 0 || m.pinned[k - 1] < m.pinned[k]);
      pinned_in[m.pinned[k]] = i;
    }
    for (int32_t k = 0; k < m.nsprings; k++) {
      const int32_t *ends = s->ij + 2 * m.spring[k];
      assert_true(k == 0 || m.spring[k - 1] < m.spring[k]);
      assert_false(s->pinned[ends[0]] && s->pinned[ends[1]]);
      for (int end = 0; end < 2; end++) {
        const int32_t p = ends[end];
        assert_int_equal(s->pinned[p] ? pinned_in[p] : island[p], i);
        has[p] = 1;
      }
    }
    for (int32_t k = 0; k < m.npinned; k++) assert_true(has[m.pinned[k]]);
  }
  for (int32_t p = 0; p < s->nparticles; p++) free -= !s->pinned[p];
  for (int32_t e = 0; e < s->nsprings; e++)
    pulling += !s->pinned[s->ij[2 * e]] || !s->pinned[s->ij[2 * e + 1]];
  assert_int_equal(free, 0);
  assert_int_equal(springs, pulling);
}

/* Large components are islands of their own, small ones are merged, none is divided; islands are in
 * the order of their first particles. */
static void check_sizes(const ms_scene *s, const ms_islands *islands, const int32_t *island) {
  static int32_t of[MOST], size[MOST];
  int32_t small = 0, begun = 0;
  label(s, of);
  memset(size, 0, sizeof size);
  for (int32_t p = 0; p < s->nparticles; p++)
    if (of[p] >= 0) size[of[p]]++;
  for (int32_t p = 0; p < s->nparticles; p++) {
    if (of[p] < 0) continue;
    assert_int_equal(island[p], island[of[p]]);
    assert_true(island[p] <= begun);
    begun += island[p] == begun;
    const int32_t held = ms_islands_get(islands, island[p]).nfree;
    if (size[of[p]] >= MS_MIN_ISLAND) assert_int_equal(held, size[of[p]]);
    else small++;
  }
  for (int32_t p = 0; p < s->nparticles; p++) {
    if (of[p] < 0 || size[of[p]] >= MS_MIN_ISLAND) continue;
    const int32_t held = ms_islands_get(islands, island[p]).nfree;
    const int32_t least = small < MS_MIN_ISLAND ? small : MS_MIN_ISLAND;
    assert_in_range(held, least, 3 * MS_MIN_ISLAND);
  }
  assert_int_equal(begun == 0 ? 1 : begun, islands->n);
}

/* Chains of random lengths in shuffled order, some particles pinned, some without a spring. */
static msim_scene *chains(unsigned seed, int32_t longest, double pins) {
  static double x[3 * MOST], ones[MOST];
  static int32_t order[MOST], ij[2 * MOST];
  const int32_t n = 1 + (int32_t)(uniform(&seed) * (MOST - 1));
  int32_t springs = 0, left = 0;
  for (int32_t p = 0; p < n; p++) order[p] = p, x[3 * p] = p, ones[p] = 1;
  for (int32_t p = n - 1; p > 0; p--) {
    const int32_t q = (int32_t)(uniform(&seed) * (p + 1)), other = order[q];
    order[q] = order[p], order[p] = other;
  }
  for (int32_t p = 1; p < n; p++) {
    if (left == 0) left = (int32_t)(uniform(&seed) * longest);
    else left--, ij[2 * springs] = order[p - 1], ij[2 * springs++ + 1] = order[p];
  }
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, n, x, NULL, ones, err));
  assert_ok(msim_scene_add_springs(scene, springs, ij, ones, NULL, NULL, err));
  for (int32_t p = 0; p < n; p++)
    if (uniform(&seed) < pins) assert_ok(msim_scene_pin(scene, 1, &p, err));
  return scene;
}

static void components_stay_whole(void **state) {
  (void)state;
  static const double pins[] = {0, 0.001, 0.1, 1};
  static const int32_t longest[] = {1, 10, 1000, 8000};
  static int32_t island[MOST];
  for (unsigned round = 0; round < 80; round++) {
    msim_scene *scene = chains(round, longest[round % 4], pins[round / 4 % 4]);
    for (int whole = 0; whole < 2; whole++) {
      ms_islands islands;
      assert_ok(ms_islands_create(scene->data, whole, &islands, err));
      check_members(scene->data, &islands, island);
      if (whole) assert_int_equal(islands.n, 1);
      else check_sizes(scene->data, &islands, island);
      ms_islands_destroy(scene->data, &islands);
    }
    msim_scene_destroy(scene);
  }
}

/* Bytes that a linearly implicit sim of n pairs allocates, and the number of its islands. */
static size_t bytes_of_pairs(int32_t n, int springs, int32_t *islands) {
  counting_allocator b = {.fail_at = -1};
  const msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free,
                                &b};
  double *x = calloc(6 * (size_t)n, sizeof *x), *ones = malloc(2 * (size_t)n * sizeof *ones);
  int32_t *ij = malloc(2 * (size_t)n * sizeof *ij);
  for (int32_t p = 0; p < 2 * n; p++) x[3 * p] = p, ones[p] = 1, ij[p] = p;
  msim_scene *scene;
  assert_ok(msim_scene_create(&alloc, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2 * n, x, NULL, ones, err));
  if (springs) assert_ok(msim_scene_add_springs(scene, n, ij, ones, NULL, NULL, err));
  const size_t before = b.bytes;
  msim_options opt = options("linearly-implicit-euler", 0.01);
  opt.solver = "pcg";
  msim_sim *sim = make_sim(scene, &opt);
  const size_t bytes = b.bytes - before;
  *islands = sim->nislands;
  assert_ok(msim_sim_step(sim, 2, err));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  free(x), free(ones), free(ij);
  return bytes;
}

static void memory_grows_with_the_scene_alone(void **state) {
  (void)state;
  int32_t few, many;
  const size_t less = bytes_of_pairs(4096, 1, &few), more = bytes_of_pairs(10 * 4096, 1, &many);
  assert_int_equal(few, 16);
  assert_int_equal(many, 160);
  assert_in_range(more, 9 * less, 11 * less);
  bytes_of_pairs(10 * 4096, 0, &many);
  assert_int_equal(many, 1);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(components_stay_whole),
                                     cmocka_unit_test(memory_grows_with_the_scene_alone)};
  return cmocka_run_group_tests_name("partition", tests, NULL, NULL);
}
