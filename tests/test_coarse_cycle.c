/* Tests of the cycle that replaces the coarse factor of large systems, against a dense one on the
 * matrix that P and A give column by column. */
#include "linear/coarse_cycle.h"

#include <float.h>
#include <stdlib.h>

#include "checkpoints.h"
#include "linear/iteration_estimate.h"
#include "scene_check.h"
#include "two_level.h"

static const ms_coarse_size SMALL = {.aggregate = 16, .cluster = 4};

enum { FOLDED, FLAT, SOLID, COMPRESSED, PLANE, SCENES };

static double least_t(msim_sim *sim) {
  const ms_half_edges *edges = &sim->islands->model.half_edges;
  double least = INFINITY;
  for (int32_t at = 0; at < MS_SLICE * edges->nentries; at++)
    least = fmin(least, (double)pcg_of(sim)->coefficients[32 * (at / 8) + at % 8]);
  return least;
}

/* The matrix of the cycle is that of the last step; with COMPRESSED springs t < 0 in it. */
static msim_sim *moved(int kind) {
  const double sideways[3] = {9.81, 0, 0};
  msim_options opt = two_level_options();
  opt.skip_off = MSIM_SKIP_KEPT_FACTOR;
  msim_scene *scene = kind == SOLID ? hanging_cube(9, 1000) : hanging_cloth(22, 1000, 0.01);
  if (kind == FLAT) assert_ok(msim_scene_set_gravity(scene, sideways, err));
  if (kind == PLANE) plane(scene, 0, 0, 1, -0.1, 0, 0), opt.collision = MSIM_COLLISION_EVENT;
  if (kind == COMPRESSED) opt.jacobian = MSIM_JACOBIAN_EXACT, opt.h = 1.0 / 400;
  msim_sim *sim = make_sim_with_coarse(scene, &opt, SMALL);
  assert_int_equal(sim->islands->model.unknowns.dims, kind == FLAT ? 2 : 3);
  assert_ok(msim_sim_step(sim, 30, err));
  assert_true(pcg_of(sim)->coarse_is_ready);
  assert_true(pcg_of(sim)->coarse.cycle.chol.n > 5);
  assert_int_equal(least_t(sim) < 0, kind == COMPRESSED);
  assert_int_equal(pcg_of(sim)->coarse.nconstrained > 0, kind == PLANE);
  msim_scene_destroy(scene);
  return sim;
}

/*------------------------------------- dense matrices -------------------------------------------*/

/* n x n, by rows */
typedef struct dense {
  int32_t n;
  double *a;
} dense;

static dense zeros(int32_t n) {
  return (dense){.n = n, .a = calloc((size_t)n * (size_t)n, sizeof(double))};
}

static void multiply(const dense *m, const double *x, double *y) {
  for (int32_t i = 0; i < m->n; i++) {
    y[i] = 0;
    for (int32_t j = 0; j < m->n; j++) y[i] += m->a[i * m->n + j] * x[j];
  }
}

static double dot(int32_t n, const double *x, const double *y) {
  double sum = 0;
  for (int32_t i = 0; i < n; i++) sum += x[i] * y[i];
  return sum;
}

static double energy(const dense *m, const double *x) {
  double *y = calloc((size_t)m->n, sizeof *y);
  multiply(m, x, y);
  const double e = dot(m->n, x, y);
  free(y);
  return e;
}

/* x = m^-1 x by Gaussian elimination of a positive definite copy */
static void solve(const dense *m, double *x) {
  const int32_t n = m->n;
  dense c = zeros(n);
  memcpy(c.a, m->a, (size_t)(n * n) * sizeof *c.a);
  for (int32_t k = 0; k < n; k++) {
    assert_true(c.a[k * n + k] > 0);
    for (int32_t i = k + 1; i < n; i++) {
      const double f = c.a[i * n + k] / c.a[k * n + k];
      for (int32_t j = k; j < n && f != 0; j++) c.a[i * n + j] -= f * c.a[k * n + j];
      x[i] -= f * x[k];
    }
  }
  for (int32_t k = n - 1; k >= 0; k--) {
    for (int32_t j = k + 1; j < n; j++) x[k] -= c.a[k * n + j] * x[j];
    x[k] /= c.a[k * n + k];
  }
  free(c.a);
}

/*------------------------------------- P^T A P --------------------------------------------------*/

static int32_t size_of(const ms_coarse *c) { return 4 * c->model->unknowns.dims * c->aggregates.n; }

/* The mode (component and mode of an aggregate) `at` at row r */
static double mode_at(const ms_coarse *c, int32_t at, int32_t r) {
  const int32_t block = 4 * c->model->unknowns.dims;
  return c->aggregates.of[r] == at / block ? (double)c->aggregates.weight[4 * r + at % 4] : 0;
}

/* Spring by spring, in the units of pcg.h, with max(0, t); constrained unknowns, whose modes are 0,
 * have their inertia only. */
static dense triple_product(const msim_sim *sim) {
  const ms_pcg *pcg = pcg_of((msim_sim *)sim);
  const ms_coarse *coarse = &pcg->coarse;
  const ms_half_edges *edges = &coarse->model->half_edges;
  const int32_t dims = coarse->model->unknowns.dims, block = 4 * dims;
  dense m = zeros(size_of(coarse));
  for (int32_t r = 0; r < coarse->model->unknowns.nfree; r++) {
    const int32_t own = coarse->aggregates.of[r];
    const ms_half_edge_span span = ms_half_edges_of_row(edges, r);
    for (int32_t i = 0; i < block && own >= 0; i++)
      for (int32_t q = 0; q < 4; q++)
        m.a[(own * block + i) * m.n + own * block + i / 4 * 4 + q] +=
            pcg->inertia[r] * mode_at(coarse, own * block + i, r) *
            mode_at(coarse, own * block + i / 4 * 4 + q, r);
    for (int32_t at = span.begin; at < span.end && own >= 0; at += span.step) {
      const int32_t s = ms_half_edges_neighbour(edges, at);
      const int32_t other = ms_aggregates_find(coarse->model, &coarse->aggregates, s);
      const float *t = pcg->coefficients + 32 * (at / 8) + at % 8;
      if (edges->spring[at] < 0) continue;
      for (int32_t i = 0; i < block; i++)
        for (int32_t j = 0; j < block; j++) {
          const double k = (double)t[8 + 8 * (i / 4)] * (double)t[8 + 8 * (j / 4)] +
                           (i / 4 == j / 4 ? fmax(0, (double)t[0]) : 0);
          const double left = k * mode_at(coarse, own * block + i, r);
          m.a[(own * block + i) * m.n + own * block + j] +=
              left * mode_at(coarse, own * block + j, r);
          if (other >= 0)
            m.a[(own * block + i) * m.n + other * block + j] -=
                left * mode_at(coarse, other * block + j, s);
        }
    }
  }
  for (int32_t at = 0; at < coarse->nconstrained; at++) {
    const int32_t r = coarse->constrained[at], own = coarse->aggregates.of[r];
    for (int32_t i = 0; i < block; i++)
      for (int32_t q = 0; q < 4; q++)
        m.a[(own * block + i) * m.n + own * block + i / 4 * 4 + q] +=
            pcg->inertia[r] * (double)coarse->modes[4 * r + i % 4] *
            (double)coarse->modes[4 * r + q];
  }
  return m;
}

/*------------------------------------- the cycle ------------------------------------------------*/

/* Entry of Q: mode `at` of a cluster at mode `of` of an aggregate */
static double cluster_mode(const ms_coarse *c, int32_t of, int32_t at) {
  const int32_t block = c->cycle.block, k = of / block;
  if (c->cycle.cluster[k] != at / block || of % block / 4 != at % block / 4) return 0;
  return (double)c->cycle.modes[16 * k + 4 * (at % 4) + of % 4];
}

/* z += w D^-1 r, w = 0.95 */
static void smooth(const dense *m, int32_t block, const double *r, double *z) {
  for (int32_t k = 0; k < m->n; k += block) {
    dense d = zeros(block);
    double x[12];
    for (int32_t i = 0; i < block; i++) {
      x[i] = r[k + i];
      for (int32_t j = 0; j < block; j++) d.a[i * block + j] = m->a[(k + i) * m->n + k + j];
    }
    solve(&d, x);
    for (int32_t i = 0; i < block; i++) z[k + i] += 0.95 * x[i];
    free(d.a);
  }
}

/* z += f Q (Q^T A Q)^-1 Q^T r, f = 1.25 */
static void correct(const ms_coarse *c, const dense *m, const double *r, double *z) {
  const int32_t n = m->n, clusters = c->cycle.block * c->cycle.chol.n;
  dense product = zeros(clusters);
  double *q = calloc((size_t)n, sizeof *q), *aq = calloc((size_t)n, sizeof *aq);
  double *x = calloc((size_t)clusters, sizeof *x);
  for (int32_t j = 0; j < clusters; j++) {
    for (int32_t i = 0; i < n; i++) q[i] = cluster_mode(c, i, j);
    multiply(m, q, aq);
    x[j] = dot(n, q, r);
    for (int32_t k = 0; k < clusters; k++)
      for (int32_t i = 0; i < n; i++) product.a[k * clusters + j] += cluster_mode(c, i, k) * aq[i];
  }
  solve(&product, x);
  for (int32_t i = 0; i < n; i++)
    for (int32_t j = 0; j < clusters; j++) z[i] += 1.25 * cluster_mode(c, i, j) * x[j];
  free(q), free(aq), free(x), free(product.a);
}

static void subtract_from(const dense *m, const double *r, const double *z, double *residual) {
  multiply(m, z, residual);
  for (int32_t i = 0; i < m->n; i++) residual[i] = r[i] - residual[i];
}

static void dense_cycle(const ms_coarse *c, const dense *m, const double *r, double *z) {
  double *residual = calloc((size_t)m->n, sizeof *residual);
  memset(z, 0, (size_t)m->n * sizeof *z);
  smooth(m, c->cycle.block, r, z);
  subtract_from(m, r, z, residual);
  correct(c, m, residual, z);
  subtract_from(m, r, z, residual);
  smooth(m, c->cycle.block, residual, z);
  free(residual);
}

static double *random_array(int32_t n, unsigned seed) {
  double *v = calloc((size_t)n, sizeof *v);
  for (int32_t i = 0; i < n; i++) v[i] = uniform(&seed) - 0.5;
  return v;
}

/*------------------------------------- tests ----------------------------------------------------*/

/* The result is that of the formula with dense matrices. Rounding to 16 bits adds 2^-16 to each of
 * some 80 numbers of a row, and the energy norm is up to about 8 times smaller than that of the
 * numbers in units of D: 8 sqrt(80) 2^-16 = 1e-3. */
static void cycle_is_that_of_the_formula(void **state) {
  (void)state;
  for (int kind = 0; kind < SCENES; kind++) {
    msim_sim *sim = moved(kind);
    ms_coarse *coarse = &pcg_of(sim)->coarse;
    const dense m = triple_product(sim);
    double *z = calloc((size_t)m.n, sizeof *z), *want = calloc((size_t)m.n, sizeof *want);
    for (unsigned seed = 1; seed <= 2; seed++) {
      double *r = random_array(m.n, seed);
      dense_cycle(coarse, &m, r, want);
      ms_coarse_cycle_solve(&coarse->cycle, NULL, r, z);
      const double size = energy(&m, want);
      for (int32_t i = 0; i < m.n; i++) z[i] -= want[i];
      assert_true(sqrt(energy(&m, z) / size) <= 1e-3);
      free(r);
    }
    free(z), free(want), free(m.a);
    msim_sim_destroy(sim);
  }
}

/* B, r -> z, is symmetric and positive definite, and I - B A contracts in the energy norm. As that
 * is (I - S A)(I - f C)(I - S A), C the projection on the clusters, and |I - S A| < 1, it is
 * 1 - f < x.A (I - B A) x / x.A x < 1. */
static void cycle_is_symmetric_and_contracts(void **state) {
  (void)state;
  for (int kind = 0; kind < SCENES; kind++) {
    msim_sim *sim = moved(kind);
    ms_coarse_cycle *cycle = &pcg_of(sim)->coarse.cycle;
    const dense m = triple_product(sim);
    double *u = random_array(m.n, 1), *v = random_array(m.n, 2), *Bu = random_array(m.n, 1);
    double *Bv = random_array(m.n, 1);
    ms_coarse_cycle_solve(cycle, NULL, u, Bu);
    ms_coarse_cycle_solve(cycle, NULL, v, Bv);
    assert_true(dot(m.n, u, Bu) > 0 && dot(m.n, v, Bv) > 0);
    assert_close(dot(m.n, u, Bv), dot(m.n, v, Bu), 1e-6 * sqrt(dot(m.n, u, Bu) * dot(m.n, v, Bv)));
    for (int round = 0; round < 20; round++) { /* u = (I - B A) u, its slowest part in the end */
      const double before = energy(&m, u);
      multiply(&m, u, v);
      ms_coarse_cycle_solve(cycle, NULL, v, Bv);
      assert_true(dot(m.n, v, Bv) <= (1.25 + 1e-6) * before);
      for (int32_t i = 0; i < m.n; i++) u[i] -= Bv[i];
      assert_true(energy(&m, u) < 0.9 * before);
    }
    free(u), free(v), free(Bu), free(Bv), free(m.a);
    msim_sim_destroy(sim);
  }
}

/* A diagonal block that is not positive definite is reported, even if that of the clusters is. */
static void indefinite_matrices_are_reported(void **state) {
  (void)state;
  msim_sim *sim = moved(FOLDED);
  ms_pcg *pcg = pcg_of(sim);
  const ms_coarse_matrix a = {.coefficients = pcg->coefficients,
                              .inertia = pcg->inertia,
                              .a = &pcg->base.system->a,
                              .by = 1 / pcg->jacobi.scale};
  assert_ok(ms_coarse_factor(&pcg->coarse, &a));
  double *inertia = pcg->inertia + sim->islands->model.unknowns.nfree / 2;
  for (int i = 0; i < 1000 && !ms_coarse_factor(&pcg->coarse, &a); i++) *inertia -= 1e-3;
  assert_int_equal(ms_coarse_factor(&pcg->coarse, &a), MSIM_NOT_SPD);
  assert_ok(ms_block_cholesky_factor(&pcg->coarse.cycle.chol));
  msim_sim_destroy(sim);
}

/* The modes of a cluster are orthonormal, and translations are among them. */
static void clusters_translate(void **state) {
  (void)state;
  for (int kind = 0; kind < SCENES; kind++) {
    msim_sim *sim = moved(kind);
    const ms_coarse *c = &pcg_of(sim)->coarse;
    const int32_t n = size_of(c), clusters = c->cycle.block * c->cycle.chol.n;
    for (int32_t i = 0; i < clusters && kind != PLANE; i++) {
      double rest = 0, size = 0, dots[4] = {0};
      for (int32_t k = 0; k < n; k++) {
        for (int32_t j = 0; j < 4; j++)
          dots[j] += cluster_mode(c, k, i) * cluster_mode(c, k, i / 4 * 4 + j);
      }
      for (int32_t j = 0; j < 4; j++) assert_close(dots[j], i % 4 == j, 1e-6);
      if (i % 4) continue;
      for (int32_t k = 0; k < n; k++) {
        double one = 0, part = 0; /* P^T 1, and that of the cluster's modes in it */
        for (int32_t r = 0; r < c->model->unknowns.nfree; r++) one += mode_at(c, k, r);
        if (c->cycle.cluster[k / c->cycle.block] != i / c->cycle.block ||
            k % c->cycle.block / 4 != i % c->cycle.block / 4)
          continue;
        for (int32_t j = 0; j < 4; j++) {
          double product = 0;
          for (int32_t p = 0; p < n; p++) {
            double sum = 0;
            if (cluster_mode(c, p, i + j) == 0) continue;
            for (int32_t r = 0; r < c->model->unknowns.nfree; r++) sum += mode_at(c, p, r);
            product += cluster_mode(c, p, i + j) * sum;
          }
          part += cluster_mode(c, k, i + j) * product;
        }
        rest += pow(one - part, 2), size += one * one;
      }
      assert_true(rest <= 1e-10 * size);
    }
    msim_sim_destroy(sim);
  }
}

/* Mode q of the cluster of unknown r, at r */
static double cluster_mode_at(const ms_coarse *c, int32_t r, int q) {
  double sum = 0;
  for (int m = 0; m < 4; m++)
    sum += (double)c->aggregates.weight[4 * r + m] *
           (double)c->cycle.modes[16 * c->aggregates.of[r] + 4 * q + m];
  return sum;
}

/* The coordinates of a solid are among the modes of each cluster, to the accuracy of floats. */
static void clusters_rotate(void **state) {
  (void)state;
  msim_sim *sim = moved(SOLID);
  const ms_coarse *c = &pcg_of(sim)->coarse;
  const ms_unknowns *rows = &c->model->unknowns;
  const int32_t n = c->cycle.chol.n;
  for (int axis = 0; axis < 3; axis++) {
    double(*part)[4] = calloc((size_t)n, sizeof *part);
    for (int pass = 0; pass < 2; pass++)
      for (int32_t r = 0; r < rows->nfree; r++) {
        if (c->aggregates.of[r] < 0) continue;
        double *of = part[c->cycle.cluster[c->aggregates.of[r]]], sum = 0;
        const double x = c->model->scene->x[3 * rows->particle[r] + axis];
        for (int q = 0; q < 4; q++) {
          if (pass == 0) of[q] += x * cluster_mode_at(c, r, q);
          sum += of[q] * cluster_mode_at(c, r, q);
        }
        if (pass == 1) assert_close(sum, x, 1e-5);
      }
    free(part);
  }
  msim_sim_destroy(sim);
}

/* A cycle takes at most a third more iterations than a factor for the same aggregates, and a factor
 * for larger ones, which has as many numbers as the cycle, a quarter more than that. */
static void cycles_take_few_iterations(void **state) {
  (void)state;
  static const ms_coarse_size sizes[] = {
      {.aggregate = 48}, {.aggregate = 48, .cluster = 8}, {.aggregate = 256}};
  double count[3];
  const msim_options opt = two_level_options();
  for (int i = 0; i < 3; i++) {
    msim_scene *scene = hanging_cloth(64, 2000, 0.01);
    msim_sim *sim = make_sim_with_coarse(scene, &opt, sizes[i]);
    count[i] = iterations_after(sim, 15);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
  assert_true(count[1] < 4.0 / 3 * count[0] && count[2] > 1.25 * count[1]);
}

/* A factor has few numbers in narrow scenes, and in small ones even if all aggregates are adjacent.
 * Where it would have many, there is a cycle, or with angular springs one of larger aggregates. */
static void large_factors_give_way_to_a_cycle(void **state) {
  (void)state;
  static const struct {
    int32_t rows, columns, angles, random_springs, aggregate, cycle;
  } cases[] = {{110, 110, 0, 0, 64, 0},    {40, 1000, 0, 0, 64, 0}, {62, 62, 0, 3844, 64, 0},
               {100, 100, 0, 9000, 64, 1}, {150, 150, 0, 0, 64, 1}, {150, 150, 1, 0, 128, 0}};
  const msim_options opt = two_level_options();
  const double k = 1e-3;
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    const int32_t n = cases[i].rows * cases[i].columns, expected = n / cases[i].aggregate;
    msim_scene *scene = hanging_sheet(cases[i].rows, cases[i].columns, 100, 0);
    if (cases[i].angles)
      assert_ok(msim_scene_add_angles(scene, 1, (int32_t[3]){5, 6, 7}, &k, NULL, NULL, err));
    for (int32_t e = 0; e < cases[i].random_springs; e++) {
      const int32_t j = (int32_t)(e * 7919LL % n), ij[2] = {e, j == e ? n - 1 : j};
      assert_ok(msim_scene_add_springs(scene, 1, ij, &k, NULL, NULL, err));
    }
    msim_sim *sim = make_sim(scene, &opt);
    assert_in_range(pcg_of(sim)->base.aggregates, expected * 7 / 8, expected * 9 / 8);
    assert_int_equal(pcg_of(sim)->coarse.cycle.n > 0, cases[i].cycle);
    assert_int_equal(pcg_of(sim)->coarse.chol.n > 0, !cases[i].cycle);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* Where many iterations are estimated, smaller aggregates pay. */
static void many_iterations_get_smaller_aggregates(void **state) {
  (void)state;
  for (int stiff = 0; stiff < 2; stiff++) {
    msim_scene *scene = hanging_cloth(250, stiff ? 1e5 : 10, 0);
    ms_model model;
    assert_ok(ms_model_create(scene->data, 0, &model, err));
    const ms_iteration_estimate p = ms_iteration_estimate_compute(&model, 1.0 / 60, 1e-6);
    assert_int_equal(p.two_level > 75, stiff);
    assert_int_equal(p.aggregate, stiff ? 48 : 64);
    ms_model_destroy(&model);
    msim_scene_destroy(scene);
  }
}

/* The same bits with any number of threads, in a clone and from a checkpoint in the middle on */
static void bits_are_the_same(void **state) {
  (void)state;
  enum { RUNS = 4 };
  static const int32_t threads[RUNS] = {1, 2, 5, 2};
  double *x[RUNS];
  size_t length = 0;
  for (int i = 0; i < RUNS; i++) {
    msim_options opt = two_level_options();
    msim_scene *scene = hanging_cloth(250, 1000, 0.01);
    opt.threads = threads[i];
    msim_sim *sim = make_sim(scene, &opt), *resumed = NULL;
    assert_true(pcg_of(sim)->coarse.cycle.n > 0);
    assert_ok(msim_sim_step(sim, 1, err));
    if (i == 2) {
      assert_ok(msim_sim_clone(sim, &resumed, err));
      msim_sim_destroy(sim);
      sim = resumed;
    } else if (i == 3) {
      checkpoint c = save(sim);
      msim_sim_destroy(sim);
      sim = resume(scene, &opt, &c);
      free(c.bytes);
    }
    assert_ok(msim_sim_step(sim, 2, err));
    msim_state s = {.size = sizeof s};
    msim_sim_state(sim, &s);
    length = 3 * (size_t)s.n * sizeof *s.x;
    x[i] = malloc(length);
    memcpy(x[i], s.x, length);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
    assert_memory_equal(x[0], x[i], length);
  }
  for (int i = 0; i < RUNS; i++) free(x[i]);
}

static msim_status create_coarse(const msim_allocator *alloc, void *data) {
  ms_model model = *(ms_model *)data;
  ms_scene starved = *model.scene;
  ms_coarse coarse;
  starved.alloc = *alloc, model.scene = &starved;
  const msim_status status = ms_coarse_create(&model, SMALL, &coarse, NULL);
  ms_coarse_destroy(&coarse);
  return status;
}

static void memory_that_ends_is_reported(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(14, 100, 0);
  ms_model model;
  assert_ok(ms_model_create(scene->data, 0, &model, err));
  assert_true(expect_memory_errors(create_coarse, &model) > 50);
  ms_model_destroy(&model);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(cycle_is_that_of_the_formula),
                                     cmocka_unit_test(cycle_is_symmetric_and_contracts),
                                     cmocka_unit_test(indefinite_matrices_are_reported),
                                     cmocka_unit_test(clusters_translate),
                                     cmocka_unit_test(clusters_rotate),
                                     cmocka_unit_test(cycles_take_few_iterations),
                                     cmocka_unit_test(large_factors_give_way_to_a_cycle),
                                     cmocka_unit_test(many_iterations_get_smaller_aggregates),
                                     cmocka_unit_test(bits_are_the_same),
                                     cmocka_unit_test(memory_that_ends_is_reported)};
  return cmocka_run_group_tests_name("coarse cycle", tests, NULL, NULL);
}
