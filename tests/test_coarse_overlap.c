/* Tests of what the coarse space of a rank leaves to the modes of ranks: the affine motions of the
 * rank, and no more. */
#include "linear/coarse_overlap.h"
#include "linear/modes.h"
#include "rank_runs.h"
#include "two_level.h"

typedef struct overlap_case {
  msim_scene *scene;
  double little; /* of the correction of an affine motion: what is not left */
} overlap_case;

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

/* r = A u for an affine motion u of one component: the correction is u, all of which is left to the
 * modes of ranks, but for rounding. */
static const char *check_motions(ms_pcg *s, double little) {
  const ms_model *model = s->base.system->model;
  const ms_unknowns *rows = &model->unknowns;
  for (int k = 0; k < MS_MODES * rows->dims; k++) {
    float *u = s->p;
    memset(u, 0, vector_size(s) * sizeof *u);
    for (int32_t i = 0; i < rows->nfree; i++) {
      double f[MS_MODES];
      ms_modes_affine_functions(model, i, f);
      u[k / MS_MODES * rows->stride + i] = (float)f[k % MS_MODES];
    }
    double sum, whole, rest;
    s->kernels->apply(s, 0, model->half_edges.nslices, &sum);
    correct(s, 0, s->q, &whole);
    correct(s, 1, s->q, &rest);
    if (rest > little * whole) return "an affine motion is not left to the modes of ranks";
  }
  return NULL;
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
  const overlap_case *c = data;
  msim_options opt = two_level_options();
  msim_sim *sim = NULL;
  msim_error why;
  opt.comm = comm, opt.skip_off = MSIM_SKIP_KEPT_FACTOR; /* no lagged factors */
  EXPECT(msim_sim_create(c->scene, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_step(sim, 3, &why) == MSIM_OK);
  EXPECT(pcg_of(sim)->coarse.leaves_overlap && pcg_of(sim)->single);
  const char *wrong = check_motions(pcg_of(sim), c->little);
  if (!wrong) wrong = check_others(pcg_of(sim));
  msim_sim_destroy(sim);
  return wrong;
}

static void affine_motions_are_left_to_the_modes_of_ranks(void **state) {
  (void)state;
  const double sideways[3] = {9.81, 0, 0};
  /* in the cube coordinates are almost dependent on each other in some aggregates */
  overlap_case cases[] = {{hanging_cloth(40, 20000, 0.01), 1e-5},
                          {hanging_cloth(40, 20000, 0.01), 1e-5},
                          {hanging_cube(12, 2000), 0.1}};
  assert_ok(msim_scene_set_gravity(cases[1].scene, sideways, err)); /* planar */
  for (int i = 0; i < 3; i++) {
    for (int32_t n = 2; n <= 3; n++) {
      const char *wrong = run_ranks(n, check_overlap, &cases[i]);
      if (wrong) fail_msg("scene %d, %d ranks: %s", i, n, wrong);
    }
    msim_scene_destroy(cases[i].scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(affine_motions_are_left_to_the_modes_of_ranks),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
