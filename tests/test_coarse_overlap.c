/* Tests of what the coarse space of a rank leaves to the modes of ranks: the affine motions of its
 * patches, and no more; and of these patches. */
#include "linear/coarse_overlap.h"
#include "linear/modes.h"
#include "linear/rank_patches.h"
#include "rank_runs.h"
#include "two_level.h"

static size_t vector_size(const ms_pcg *s) {
  const ms_unknowns *rows = &s->base.system->model->unknowns;
  return (size_t)rows->dims * (size_t)rows->stride;
}

/* The coarse correction of r, a vector of floats. Returns r.z; with or without the motions that are
 * left to the modes of ranks. length: of z */
static double correct(ms_pcg *s, int leaves, const float *r, double *length) {
  const ms_model *model = s->base.system->model;
  const int32_t slices = model->half_edges.nslices, chunk = MS_RESTRICTION_SLICES;
  s->coarse.leaves_overlap = leaves;
  for (int32_t k = 0; k < slices; k += chunk)
    ms_coarse_restrict(&s->coarse, 1, r, k, k + chunk < slices ? k + chunk : slices);
  const double product = ms_coarse_solve(&s->coarse);
  *length = 0;
  for (int32_t i = 0; i < s->coarse.aggregates.n * MS_MODES * model->unknowns.dims; i++)
    *length += s->coarse.z[i] * s->coarse.z[i];
  *length = sqrt(*length);
  return product;
}

enum { ALL = -1 };

/* At unknown i an affine function of all unknowns, or the part of it that modes of a patch have */
static void get_functions(const ms_pcg *s, int32_t patch, int32_t i, double f[MS_MODES]) {
  const int32_t of = s->coarse.aggregates.of[i];
  memset(f, 0, MS_MODES * sizeof *f);
  if (patch == ALL) ms_modes_affine_functions(s->base.system->model, i, f);
  else if (of >= 0 && s->coarse.overlap->patch[of] == patch)
    ms_coarse_overlap_weights(&s->coarse, i, f);
}

/* r = A u for such a motion u of one component: the correction is u, all of which is left to the
 * modes of ranks, but for rounding. */
static const char *check_motions_of(ms_pcg *s, int32_t patch) {
  const double LITTLE = 1e-5;
  const ms_model *model = s->base.system->model;
  const ms_unknowns *rows = &model->unknowns;
  for (int k = 0; k < MS_MODES * rows->dims; k++) {
    float *u = s->p;
    memset(u, 0, vector_size(s) * sizeof *u);
    for (int32_t i = 0; i < rows->nfree; i++) {
      double f[MS_MODES];
      get_functions(s, patch, i, f);
      u[k / MS_MODES * rows->stride + i] = (float)f[k % MS_MODES];
    }
    double sum, whole, rest;
    s->kernels->apply(s, 0, model->half_edges.nslices, &sum);
    s->kernels->apply_split_rows(s, &sum);
    correct(s, 0, s->q, &whole);
    correct(s, 1, s->q, &rest);
    if (rest > LITTLE * whole) return "an affine motion is not left to the modes of ranks";
  }
  return NULL;
}

static const char *check_motions(ms_pcg *s) {
  const char *wrong = s->coarse.overlap->n > 1 ? check_motions_of(s, ALL) : "one patch";
  for (int32_t p = 0; p < s->coarse.overlap->n && !wrong; p++) wrong = check_motions_of(s, p);
  return wrong;
}

/* The matrix of the modes has the same blocks of this rank, whether these are those of the coarse
 * space, whose springs are rounded to floats, or computed from springs. Collective */
static const char *check_matrix(ms_pcg *s) {
  ms_rank_modes *q = s->modes;
  const size_t n = (size_t)q->bytes[q->model->shape.ranks->rank] / sizeof *q->own;
  double *known = malloc(n * sizeof *known), most = 0, off = 0;
  ms_rank_modes_factor(q, &s->base.system->a, 1 / s->jacobi.scale, s->coarse.overlap);
  memcpy(known, q->own, n * sizeof *known);
  ms_rank_modes_factor(q, &s->base.system->a, 1 / s->jacobi.scale, NULL);
  for (size_t i = 0; i < n; i++)
    if (q->own[i] != 0 || known[i] != 1) /* in place of a motion that depends on others */
      most = fmax(most, fabs(q->own[i])), off = fmax(off, fabs(q->own[i] - known[i]));
  free(known);
  return off <= 1e-5 * most ? NULL : "other blocks";
}

/* 0 < r.z < r.A^-1 r */
static const char *check_others(ms_pcg *s) {
  const ms_unknowns *rows = &s->base.system->model->unknowns;
  float *r = s->r;
  double unused;
  unsigned seed = 1;
  memset(r, 0, vector_size(s) * sizeof *r);
  for (int round = 0; round < 20; round++) {
    for (int32_t c = 0; c < rows->dims; c++)
      for (int32_t i = 0; i < rows->nfree; i++)
        r[c * rows->stride + i] = (float)uniform(&seed) - 0.5f;
    const double whole = correct(s, 0, r, &unused), rest = correct(s, 1, r, &unused);
    if (!(rest > 0 && rest < whole)) return "no part of the correction";
  }
  return NULL;
}

static const char *check_overlap(msim_comm *comm, void *data) {
  msim_options opt = two_level_options();
  msim_sim *sim = NULL;
  msim_error why;
  opt.comm = comm, opt.skip_off = MSIM_SKIP_KEPT_FACTOR; /* no lagged factors */
  EXPECT(msim_sim_create(data, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_step(sim, 3, &why) == MSIM_OK);
  EXPECT(pcg_of(sim)->coarse.leaves_overlap && pcg_of(sim)->single);
  const char *wrong = check_motions(pcg_of(sim));
  if (!wrong) wrong = check_others(pcg_of(sim));
  const char *other = check_matrix(pcg_of(sim));
  if (!wrong) wrong = other;
  msim_sim_destroy(sim);
  return wrong;
}

static void affine_motions_are_left_to_the_modes_of_ranks(void **state) {
  (void)state;
  const double sideways[3] = {9.81, 0, 0};
  msim_scene *scenes[] = {hanging_cloth(40, 20000, 0.01), hanging_cloth(40, 20000, 0.01),
                          hanging_cube(12, 2000)};
  assert_ok(msim_scene_set_gravity(scenes[1], sideways, err)); /* planar */
  for (int i = 0; i < 3; i++) {
    for (int32_t n = 2; n <= 3; n++) {
      const char *wrong = run_ranks(n, check_overlap, scenes[i]);
      if (wrong) fail_msg("scene %d, %d ranks: %s", i, n, wrong);
    }
    msim_scene_destroy(scenes[i]);
  }
}

/*------------------------------------- patches --------------------------------------------------*/

enum { SIDE = 16, ITEMS = SIDE * SIDE };

/* Items on a square grid, item i at particle ITEMS - 1 - i */
typedef struct grid {
  double x[3 * ITEMS];
  int32_t particle[ITEMS], of[ITEMS];
} grid;

static void make_grid(grid *g) {
  *g = (grid){.of = {0}};
  for (int32_t i = 0; i < ITEMS; i++) {
    g->particle[i] = ITEMS - 1 - i;
    g->x[3 * g->particle[i] + 1] = i % SIDE, g->x[3 * g->particle[i] + 2] = 2 * (i / SIDE);
  }
}

static int32_t split(grid *g, int32_t n, int32_t npatches, int32_t nranks) {
  const ms_rank_places at = {.n = n, .particle = g->particle, .x = g->x};
  return ms_rank_patches_split(npatches, nranks, at, g->of);
}

/* Of 16 x 32 m: four times 8 x 16 m, then sixteen times 4 x 8 m */
static void patches_are_split_into_equal_boxes(void **state) {
  (void)state;
  static const int32_t ranks[] = {2, 8, 9, 17, 64, 65, 128, 129, 1000},
                       expected[] = {16, 16, 14, 8, 4, 3, 2, 1, 1};
  static grid g;
  for (int r = 0; r < 9; r++) {
    int32_t items[MS_MOST_PATCHES] = {0}, of_box[16];
    make_grid(&g);
    assert_int_equal(split(&g, ITEMS, 1, ranks[r]), expected[r]);
    for (int32_t i = 0; i < ITEMS; i++) {
      assert_in_range(g.of[i], 0, expected[r] - 1);
      items[g.of[i]]++;
      const int32_t box = i % SIDE / 4 + 4 * (i / SIDE / 4);
      if (i % 4 == 0 && i / SIDE % 4 == 0) of_box[box] = g.of[i];
      assert_int_equal(g.of[i], of_box[box]);
    }
    for (int32_t p = 0; p < expected[r]; p++)
      if (ITEMS % expected[r] == 0) assert_int_equal(items[p], ITEMS / expected[r]);
  }
}

/* Patches of 48 items and more are split into up to 64 of a rank and 256 of all. */
static void large_patches_are_split_further(void **state) {
  (void)state;
  enum { MOST = 4096 };
  static const struct {
    int32_t items, nranks, expected;
  } cases[] = {{MOST, 2, 64}, {MOST, 4, 64}, {MOST, 5, 51}, {MOST, 16, 16}, {MOST, 256, 1},
               {1024, 2, 32}, {768, 2, 32},  {767, 2, 31},  {767, 16, 16},  {736, 2, 16}};
  static int32_t particle[MOST], of[MOST];
  static double x[3 * MOST];
  for (int32_t i = 0; i < MOST; i++) particle[i] = i, x[3 * i] = i;
  for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
    const ms_rank_places at = {.n = cases[c].items, .particle = particle, .x = x};
    memset(of, 0, sizeof of);
    assert_int_equal(ms_rank_patches_split(1, cases[c].nranks, at, of), cases[c].expected);
  }
}

/* Other patches and items of none stay as they are; those with few items are not split. */
static void small_patches_are_not_split(void **state) {
  (void)state;
  static grid g;
  make_grid(&g);
  for (int32_t i = 0; i < ITEMS; i++) g.of[i] = i < 3 ? 0 : i < 8 ? 1 : i < 16 ? 2 : -1;
  assert_int_equal(split(&g, ITEMS, 3, 2), 4);
  for (int32_t i = 0; i < ITEMS; i++)
    assert_int_equal(g.of[i], i < 3 ? 0 : i < 8 ? 1 : i < 12 ? 2 : i < 16 ? 3 : -1);
  for (int32_t p = 3; p <= MS_MOST_PATCHES; p++) {
    for (int32_t i = 0; i < ITEMS; i++) g.of[i] = i % p;
    assert_int_equal(split(&g, ITEMS, p, 100), p);
  }
}

/* Coordinates whose mean is rounded to one of them, and overflow */
static void equal_and_extreme_places(void **state) {
  (void)state;
  const double next = nextafter(1, 2), pairs[][2] = {{1, 1}, {1, next}, {next, 1}, {1e308, -1e308}};
  static grid g;
  for (int k = 0; k < 4; k++) {
    make_grid(&g);
    for (int32_t i = 0; i < ITEMS; i++)
      g.x[3 * i] = pairs[k][i % 5 == 0], g.x[3 * i + 1] = g.x[3 * i + 2] = 0;
    const int32_t n = split(&g, ITEMS, 1, 2);
    assert_int_equal(n, pairs[k][0] == pairs[k][1] ? 1 : 2);
    for (int32_t i = 0; i < ITEMS; i++) /* particle[0] is one of every 5th */
      assert_int_equal(g.of[i] == g.of[0], n == 1 || g.particle[i] % 5 == 0);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(patches_are_split_into_equal_boxes),
      cmocka_unit_test(large_patches_are_split_further),
      cmocka_unit_test(small_patches_are_not_split),
      cmocka_unit_test(equal_and_extreme_places),
      cmocka_unit_test(affine_motions_are_left_to_the_modes_of_ranks),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
