/* Tests of the operators of two-level conjugate gradients, on matrices of folded cloth: the coarse
 * matrix, its solution, and A in single precision. */
#include <float.h>
#include <stdlib.h>

#include "physics/angle_springs.h"
#include "scene_check.h"
#include "two_level.h"

enum { FOLDED, FLAT, HUB, BENDING, SCENES };

/* Connects a particle with all others. */
static void add_hub(msim_scene *scene) {
  const msim_scene_view view = view_of(scene);
  for (int32_t p = 2; p < view.nparticles; p++) {
    const double k = 1 + p % 7;
    assert_ok(msim_scene_add_springs(scene, 1, (int32_t[2]){1, p}, &k, NULL, NULL, err));
  }
}

/* Angular springs along the rows of a cloth, and one across it, in which particle 0 is pinned */
static void add_angles(msim_scene *scene, int32_t side) {
  const double k = 0.1, across = 0.3;
  for (int32_t p = 0; p + 2 < side * side; p++)
    if (p % side + 2 < side)
      assert_ok(
          msim_scene_add_angles(scene, 1, (int32_t[3]){p, p + 1, p + 2}, &k, NULL, NULL, err));
  assert_ok(msim_scene_add_angles(scene, 1, (int32_t[3]){0, side * side - 1, side}, &across, NULL,
                                  NULL, err));
}

/* A cloth that has moved: in space, in its plane, or with an unknown of many springs. The matrix is
 * that of the last step. */
static msim_sim *moved(int kind, int32_t side, int32_t aggregate) {
  const double sideways[3] = {9.81, 0, 0};
  const msim_options opt = two_level_options();
  msim_scene *scene = hanging_cloth(side, 1000, 0.01);
  if (kind == FLAT) assert_ok(msim_scene_set_gravity(scene, sideways, err));
  if (kind == HUB) add_hub(scene);
  if (kind == BENDING) add_angles(scene, side);
  msim_sim *sim = make_two_level_sim(scene, &opt, aggregate);
  assert_int_equal(sim->islands->model.unknowns.dims, kind == FLAT ? 2 : 3);
  assert_int_equal(sim->islands->model.half_edges.nparts > 0, kind == HUB);
  assert_ok(msim_sim_step(sim, 30, err));
  assert_true(pcg_of(sim)->coarse_is_ready);
  msim_scene_destroy(scene);
  return sim;
}

static size_t length(const msim_sim *sim) {
  return (size_t)sim->islands->model.unknowns.dims * (size_t)sim->islands->model.unknowns.stride;
}

/* Floats as doubles; entries of padding are 0 */
static double *random_vector(const msim_sim *sim, unsigned seed) {
  const ms_unknowns *rows = &sim->islands->model.unknowns;
  double *v = calloc(length(sim), sizeof *v);
  for (int32_t c = 0; c < rows->dims; c++)
    for (int32_t r = 0; r < rows->nfree; r++)
      v[c * rows->stride + r] = (double)(float)(uniform(&seed) - 0.5);
  return v;
}

static double dot(const msim_sim *sim, const double *u, const double *v) {
  return ms_vector_dot(sim->islands->model.shape, u, v);
}

/* out = P z */
static void prolong(const msim_sim *sim, const ms_coarse *coarse, const double *z, double *out) {
  const ms_unknowns *rows = &sim->islands->model.unknowns;
  for (int32_t at = 0; at < rows->dims * rows->nfree; at++) {
    const int32_t c = at / rows->nfree, r = at % rows->nfree, k = coarse->aggregates.of[r];
    double sum = 0;
    for (int32_t m = 0; m < 4 && k >= 0; m++)
      sum += (double)coarse->aggregates.weight[4 * r + m] * z[4 * rows->dims * k + 4 * c + m];
    out[c * rows->stride + r] = sum;
  }
}

/* As an iteration does, but the chunks backwards. v: floats as doubles */
static double coarse_solve(msim_sim *sim, const double *v) {
  ms_coarse *coarse = &pcg_of(sim)->coarse;
  float *r = pcg_of(sim)->r;
  for (size_t i = 0; i < length(sim); i++) r[i] = (float)v[i];
  const int32_t slices = coarse->model->half_edges.nslices, chunk = MS_RESTRICTION_SLICES;
  for (int32_t k = (slices - 1) / chunk; k >= 0; k--)
    ms_coarse_restrict(coarse, 1, r, chunk * k,
                       chunk * (k + 1) < slices ? chunk * (k + 1) : slices);
  return ms_coarse_solve(coarse);
}

/*------------------------------------- coarse matrix --------------------------------------------*/

/* P^T v, z and v.Q v are as ms_coarse_solve documents them; Q is symmetric positive
 * semidefinite. */
static void coarse_operator_is_symmetric(void **state) {
  (void)state;
  for (int kind = 0; kind < SCENES; kind++) {
    msim_sim *sim = moved(kind, 20, 32);
    ms_coarse *coarse = &pcg_of(sim)->coarse;
    double *u = random_vector(sim, 1), *v = random_vector(sim, 2);
    double *Qu = random_vector(sim, 3), *Qv = random_vector(sim, 3);
    const double vv = coarse_solve(sim, v);
    prolong(sim, coarse, coarse->z, Qv);
    prolong(sim, coarse, coarse->r, Qu); /* P P^T v: an orthogonal projection of v */
    assert_close(dot(sim, Qu, Qu), dot(sim, Qu, v), 1e-5 * dot(sim, v, v));
    const double uu = coarse_solve(sim, u);
    prolong(sim, coarse, coarse->z, Qu);
    assert_true(uu > 0 && vv > 0);
    assert_close(dot(sim, v, Qv), vv, 1e-13 * vv);
    assert_close(dot(sim, u, Qu), uu, 1e-13 * uu);
    assert_close(dot(sim, u, Qv), dot(sim, v, Qu), 1e-13 * sqrt(uu * vv));
    free(u), free(v), free(Qu), free(Qv);
    msim_sim_destroy(sim);
  }
}

/* P^T r of rows in several chunks is the sum over the unknowns of each aggregate, in double
 * precision, twice. */
static void restriction_adds_all_chunks(void **state) {
  (void)state;
  for (int kind = 0; kind < SCENES; kind++) {
    msim_sim *sim = moved(kind, 48, 32);
    const ms_unknowns *rows = &sim->islands->model.unknowns;
    ms_coarse *coarse = &pcg_of(sim)->coarse;
    const ms_aggregates *a = &coarse->aggregates;
    assert_true(rows->first_pinned > 2 * MS_SLICE * MS_RESTRICTION_SLICES);
    for (unsigned seed = 1; seed <= 2; seed++) {
      double *v = random_vector(sim, seed);
      coarse_solve(sim, v);
      for (int32_t at = 0; at < 4 * rows->dims * a->n; at++) {
        const int32_t k = at / (4 * rows->dims), c = at / 4 % rows->dims;
        double sum = 0, size = 0;
        for (int32_t i = a->first[k]; i < a->first[k + 1]; i++) {
          const double w = (double)a->weight[4 * a->unknown[i] + at % 4];
          sum += w * v[c * rows->stride + a->unknown[i]], size += fabs(w);
        }
        assert_close(coarse->r[at], sum, 64 * DBL_EPSILON * size);
      }
      free(v);
    }
    msim_sim_destroy(sim);
  }
}

/* u = A v and v.A v by pcg, in the units of msim; v: floats as doubles */
static void apply(msim_sim *sim, const double *v, double *u, double *curvature) {
  ms_pcg *pcg = pcg_of(sim);
  float *p = pcg->p, *q = pcg->q;
  double parts;
  for (size_t i = 0; i < length(sim); i++) p[i] = (float)v[i];
  pcg->kernels->apply(pcg, 0, sim->islands->model.half_edges.nslices, curvature);
  pcg->kernels->apply_split_rows(pcg, &parts);
  const ms_linear_system *system = pcg->base.system;
  *curvature += parts + ms_angle_springs_apply(system->model, &system->a, 1 / pcg->jacobi.scale,
                                               (ms_operands){p, q, 1});
  for (size_t i = 0; i < length(sim); i++) u[i] = pcg->jacobi.scale * (double)q[i];
  *curvature *= pcg->jacobi.scale;
}

/* u = A v with the rounded coefficients of pcg, in double precision */
static void multiply(msim_sim *sim, const double *v, double *u) {
  const ms_pcg *pcg = pcg_of(sim);
  const ms_model *model = &sim->islands->model;
  const size_t stride = (size_t)model->unknowns.stride, dims = (size_t)model->unknowns.dims;
  for (size_t r = 0; r < (size_t)model->unknowns.nfree; r++) {
    const ms_half_edge_span span = ms_half_edges_of_row(&model->half_edges, (int32_t)r);
    for (size_t c = 0; c < dims; c++)
      u[c * stride + r] = pcg->jacobi.scale * pcg->inertia[r] * v[c * stride + r];
    for (int32_t at = span.begin; at < span.end; at += span.step) {
      const float *a = pcg->coefficients + 4 * MS_SLICE * (at / MS_SLICE) + at % MS_SLICE;
      const size_t j = (size_t)ms_half_edges_neighbour(&model->half_edges, at);
      double along = 0;
      for (size_t c = 0; c < dims; c++)
        along += (double)a[MS_SLICE * (c + 1)] * (v[c * stride + r] - v[c * stride + j]);
      for (size_t c = 0; c < dims; c++)
        u[c * stride + r] +=
            pcg->jacobi.scale * ((double)a[0] * (v[c * stride + r] - v[c * stride + j]) +
                                 along * (double)a[MS_SLICE * (c + 1)]);
    }
  }
  ms_angle_springs_apply(model, &pcg->base.system->a, 1, (ms_operands){v, u, 0});
}

/* M = L L^T in the order of the aggregates */
static void multiply_factor(const ms_block_cholesky *chol, double *M) {
  const int32_t b = chol->block, n = chol->n * b;
  double *L = calloc((size_t)(n * n), sizeof *L);
  for (int32_t k = 0; k < chol->n; k++)
    for (int32_t e = chol->first[k]; e < chol->first[k + 1]; e++)
      for (int32_t at = 0; at < b * b; at++) {
        const int32_t row = b * chol->row[e] + at % b, column = b * k + at / b;
        if (row >= column) L[row * n + column] = chol->value[b * b * e + at];
      }
  for (int32_t at = 0; at < n * n; at++) {
    const int32_t i = b * chol->position[at / n / b] + at / n % b;
    const int32_t j = b * chol->position[at % n / b] + at % n % b;
    M[at] = 0;
    for (int32_t k = 0; k <= (i < j ? i : j); k++) M[at] += L[i * n + k] * L[j * n + k];
  }
  free(L);
}

/* L L^T = P^T A P / scale, column by column, with A in single precision */
static void coarse_matrix_is_the_triple_product(void **state) {
  (void)state;
  for (int kind = 0; kind < SCENES; kind++) {
    msim_sim *sim =
        moved(kind, kind == FLAT || kind == HUB ? 17 : 9, kind == FLAT || kind == HUB ? 64 : 8);
    ms_pcg *pcg = pcg_of(sim);
    const ms_coarse *coarse = &pcg->coarse;
    const int32_t n = coarse->chol.block * coarse->aggregates.n;
    double *M = calloc((size_t)(n * n), sizeof *M), *unit = calloc((size_t)n, sizeof *unit);
    double *p = random_vector(sim, 1), *q = random_vector(sim, 1), *Ap = random_vector(sim, 1);
    const ms_coarse_matrix a = {.coefficients = pcg->coefficients,
                                .inertia = pcg->inertia,
                                .a = &pcg->base.system->a,
                                .by = 1 / pcg->jacobi.scale};
    assert_ok(ms_coarse_factor(&pcg->coarse, &a));
    multiply_factor(&coarse->chol, M);
    for (int32_t j = 0; j < n; j++) {
      memset(unit, 0, (size_t)n * sizeof *unit);
      unit[j] = 1;
      prolong(sim, coarse, unit, p);
      multiply(sim, p, Ap);
      for (int32_t i = 0; i < n; i++) {
        memset(unit, 0, (size_t)n * sizeof *unit);
        unit[i] = 1;
        prolong(sim, coarse, unit, q);
        assert_close(M[i * n + j], dot(sim, q, Ap) / pcg->jacobi.scale, 1e-13);
      }
    }
    free(M), free(unit), free(p), free(q), free(Ap);
    msim_sim_destroy(sim);
  }
}

/*------------------------------------- A in single precision ------------------------------------*/

/* A bound on the rounding errors of A v at an unknown with n springs: (n + 8)/2 FLT_EPSILON times
 * the sum of (t + |w|^2) |dv| over these, w = sqrt(g) d, and of its inertia, for rounding t, w and
 * dv, the products, and each sum (Higham, Accuracy and Stability, 2002, section 3.1). */
static double bound_errors(const msim_sim *sim, const double *v, int32_t r) {
  const ms_half_edges *half_edges = &sim->islands->model.half_edges;
  const ms_coefficients *a = &sim->islands->stepper.solver->system.a;
  const int32_t stride = sim->islands->model.unknowns.stride;
  const ms_half_edge_span span = ms_half_edges_of_row(half_edges, r);
  double sum = 0, n = 8;
  for (int32_t c = 0; c < sim->islands->model.unknowns.dims; c++)
    sum += sim->islands->model.mass[r] * fabs(v[c * stride + r]);
  for (int32_t at = span.begin; at < span.end; at += span.step, n++) {
    double dd = 0, ww = 0;
    for (int32_t c = 0; c < sim->islands->model.unknowns.dims; c++) {
      dd += pow(v[c * stride + r] - v[c * stride + ms_half_edges_neighbour(half_edges, at)], 2);
      ww +=
          a->g[at] *
          pow(a->x[c * stride + r] - a->x[c * stride + ms_half_edges_neighbour(half_edges, at)], 2);
    }
    sum += (a->t[at] + ww) * sqrt(dd);
  }
  return n / 2 * FLT_EPSILON * sum;
}

static void matrix_is_rounded_spring_by_spring(void **state) {
  (void)state;
  for (int kind = 0; kind < SCENES; kind++) {
    msim_sim *sim = moved(kind, 20, 32);
    const int32_t stride = sim->islands->model.unknowns.stride;
    double *v = random_vector(sim, 1), *exact = random_vector(sim, 1), *got = random_vector(sim, 1);
    double curvature, apart = 0;
    apply(sim, v, got, &curvature);
    ms_coefficients_apply(&sim->islands->model, &sim->islands->stepper.solver->system.a, v, exact);
    for (int32_t r = 0; r < sim->islands->model.unknowns.nfree; r++) {
      const double bound = bound_errors(sim, v, r);
      for (int32_t c = 0; c < sim->islands->model.unknowns.dims; c++) {
        const double off = fabs(got[c * stride + r] - exact[c * stride + r]);
        assert_close(off, 0, bound + FLT_EPSILON * fabs(exact[c * stride + r]));
        apart = fmax(apart, off / bound);
      }
    }
    assert_true(apart > 0.01); /* otherwise nothing was rounded */
    assert_close(curvature, dot(sim, v, exact), FLT_EPSILON * curvature);
    free(v), free(exact), free(got);
    msim_sim_destroy(sim);
  }
}

/* The forces of a spring on its ends are opposite: a rigid translation gives the inertia only, to
 * the last bit, and for any motion the sum of the spring forces is 0, up to the rounding of A v. */
static void springs_stay_balanced(void **state) {
  (void)state;
  msim_scene *scene;
  const msim_lattice block = {.size = sizeof block,
                              .n = {6, 6, 6},
                              .extent = {1, 0.5, 0.7},
                              .mass = 0.7,
                              .k = 1e5,
                              .damping = 3};
  const msim_options opt = two_level_options();
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &block, err));
  msim_sim *sim = make_two_level_sim(scene, &opt, 64);
  assert_ok(msim_sim_step(sim, 1, err));
  const ms_unknowns *rows = &sim->islands->model.unknowns;
  const ms_pcg *pcg = pcg_of(sim);
  double *v = random_vector(sim, 1), *Av = random_vector(sim, 1), curvature, sum[3] = {0},
         bound = 0;
  apply(sim, v, Av, &curvature);
  for (int32_t r = 0; r < rows->nfree; r++) bound += bound_errors(sim, v, r);
  for (int32_t at = 0; at < rows->dims * rows->nfree; at++) {
    const int32_t c = at / rows->nfree, i = c * rows->stride + at % rows->nfree;
    sum[c] += Av[i] - pcg->inertia[at % rows->nfree] * pcg->jacobi.scale * v[i];
    v[i] = (double)(0.1f * (float)(c + 1));
  }
  for (int32_t c = 0; c < 3; c++) assert_close(sum[c], 0, bound);
  apply(sim, v, Av, &curvature);
  for (int32_t at = 0; at < rows->dims * rows->nfree; at++) {
    const int32_t r = at % rows->nfree, i = at / rows->nfree * rows->stride + r;
    assert_true(Av[i] == (double)((float)pcg->inertia[r] * (float)v[i]) * pcg->jacobi.scale);
    assert_close(Av[i] / (sim->islands->model.mass[r] * v[i]), 1, FLT_EPSILON);
  }
  free(v), free(Av);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A coarse factor is used only for the set of constrained unknowns that it was computed for. */
static void other_constraint_sets_are_detected(void **state) {
  (void)state;
  const ms_constraint hold[3] = {{.row = 1}, {.row = 5}, {.row = 9}};
  msim_scene *scene = hanging_cube(6, 1e4);
  plane(scene, 0, 0, 1, -5, 0, 0);
  const msim_options opt = two_level_options();
  msim_sim *sim = make_two_level_sim(scene, &opt, 64);
  ms_coarse *coarse = &pcg_of(sim)->coarse;
  for (int32_t n = 0; n < 3; n++) {
    ms_coarse_constrain(coarse, hold, n);
    for (int32_t m = 0; m < 3; m++)
      assert_int_equal(ms_coarse_is_constrained_by(coarse, hold, m), m == n);
    assert_int_equal(ms_coarse_is_constrained_by(coarse, hold + 1, n), n == 0);
  }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(coarse_operator_is_symmetric),
                                     cmocka_unit_test(restriction_adds_all_chunks),
                                     cmocka_unit_test(coarse_matrix_is_the_triple_product),
                                     cmocka_unit_test(matrix_is_rounded_spring_by_spring),
                                     cmocka_unit_test(springs_stay_balanced),
                                     cmocka_unit_test(other_constraint_sets_are_detected)};
  return cmocka_run_group_tests_name("coarse", tests, NULL, NULL);
}
