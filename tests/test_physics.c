/* Tests of forces and matrices against complex-step derivatives, formulas written out, and each
 * other. */
#include <complex.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "linear/sparse_matrix.h"
#include "physics/matrix_kernels.h"
#include "testing.h"

enum { N = 12, NS = 30 };
#define STEP 1e-100 /* of the complex step, which has no cancellation: any tiny value */

typedef struct tangle {
  double x[3 * N], v[3 * N], mass[N];
  int32_t ij[2 * NS];
  double k[NS], rest[NS], damping[NS];
  double gravity[3], drag;
} tangle;

/* Springs stretched and compressed, several between the same pair. */
static tangle make_tangle(double damping, double drag) {
  tangle s = {.gravity = {0.3, -9.81, 1.0}, .drag = drag};
  unsigned seed = 7;
  for (int i = 0; i < 3 * N; i++) s.x[i] = uniform(&seed), s.v[i] = uniform(&seed) - 0.5;
  for (int i = 0; i < N; i++) s.mass[i] = 0.1 + uniform(&seed);
  for (int e = 0; e < NS; e++) {
    int i = e % N, j = (i + 1 + (int)(uniform(&seed) * (N - 1))) % N;
    s.ij[2 * e] = i, s.ij[2 * e + 1] = j;
    s.k[e] = 10 + 90 * uniform(&seed), s.rest[e] = uniform(&seed);
    s.damping[e] = damping * uniform(&seed);
  }
  s.ij[2] = s.ij[1], s.ij[3] = s.ij[0]; /* the first spring's pair again, the other way round */
  return s;
}

static msim_scene *scene_of(const tangle *s) {
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, N, s->x, NULL, s->mass, err));
  assert_ok(msim_scene_add_springs(scene, NS, s->ij, s->k, s->rest, s->damping, err));
  assert_ok(msim_scene_set_gravity(scene, s->gravity, err));
  assert_ok(msim_scene_set_drag(scene, s->drag, err));
  return scene;
}

static msim_sim *sim_of(msim_scene *scene, const char *method, double h, int jacobian) {
  msim_sim *sim;
  msim_options opt;
  msim_options_init(&opt, sizeof opt);
  opt.integrator = method, opt.h = h, opt.solver = "pcg", opt.jacobian = jacobian;
  assert_ok(msim_sim_create(scene, &opt, &sim, err));
  return sim;
}

/*------------------------------------- reference formulas ---------------------------------------*/

static double complex energy(const tangle *s, const double complex *x) {
  double complex e = 0;
  for (int i = 0; i < N; i++)
    for (int c = 0; c < 3; c++) e -= s->mass[i] * s->gravity[c] * x[3 * i + c];
  for (int q = 0; q < NS; q++) {
    double complex l2 = 0;
    for (int c = 0; c < 3; c++) {
      double complex d = x[3 * s->ij[2 * q + 1] + c] - x[3 * s->ij[2 * q] + c];
      l2 += d * d;
    }
    double complex stretch = csqrt(l2) - s->rest[q];
    e += 0.5 * s->k[q] * stretch * stretch;
  }
  return e;
}

/* damped 0: elastic; 1: dashpots and drag */
static void force(const tangle *s, const double complex *x, const double complex *v, int damped,
                  double complex *f) {
  for (int i = 0; i < 3 * N; i++) f[i] = damped ? -s->drag * v[i] : 0;
  for (int q = 0; q < NS; q++) {
    double complex d[3], l2 = 0, rate = 0;
    int i = 3 * s->ij[2 * q], j = 3 * s->ij[2 * q + 1];
    for (int c = 0; c < 3; c++) d[c] = x[j + c] - x[i + c], l2 += d[c] * d[c];
    double complex l = csqrt(l2);
    for (int c = 0; c < 3; c++) rate += d[c] / l * (v[j + c] - v[i + c]);
    double complex push = damped ? s->damping[q] * rate : s->k[q] * (l - s->rest[q]);
    for (int c = 0; c < 3; c++) f[i + c] += push * d[c] / l, f[j + c] -= push * d[c] / l;
  }
}

/* dF/dx of the elastic force, or dF/dv of the damping, column by column */
static void derivative(const tangle *s, int of_damping, double *J) {
  double complex x[3 * N], v[3 * N], f[3 * N];
  for (int column = 0; column < 3 * N; column++) {
    for (int i = 0; i < 3 * N; i++) x[i] = s->x[i], v[i] = s->v[i];
    *(of_damping ? &v[column] : &x[column]) += STEP * I;
    force(s, x, v, of_damping, f);
    for (int i = 0; i < 3 * N; i++) J[3 * N * i + column] = cimag(f[i]) / STEP;
  }
}

static double entry(const msim_csr *A, int row, int column) {
  for (int32_t e = A->rowptr[row]; e < A->rowptr[row + 1]; e++)
    if (A->colind[e] == column) return A->val[e];
  return 0;
}

/*------------------------------------- tests ----------------------------------------------------*/

static void force_is_minus_energy_gradient(void **state) {
  (void)state;
  tangle s = make_tangle(0, 0);
  msim_scene *scene = scene_of(&s);
  msim_sim *sim = sim_of(scene, "verlet", 1e-3, 0);
  double f[3 * N];
  msim_sim_force(sim, s.x, s.v, f);
  for (int i = 0; i < 3 * N; i++) {
    double complex x[3 * N];
    for (int j = 0; j < 3 * N; j++) x[j] = s.x[j];
    x[i] += STEP * I;
    assert_close(f[i], -cimag(energy(&s, x)) / STEP, 2e-13);
  }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void damping_force_is_the_formula(void **state) {
  (void)state;
  tangle s = make_tangle(3, 0.7);
  memset(s.gravity, 0, sizeof s.gravity);
  msim_scene *scene = scene_of(&s);
  msim_sim *sim = sim_of(scene, "verlet", 1e-3, 0);
  double f[3 * N], sum[3] = {0};
  double complex x[3 * N], v[3 * N], elastic[3 * N], damped[3 * N];
  for (int i = 0; i < 3 * N; i++) x[i] = s.x[i], v[i] = s.v[i];
  force(&s, x, v, 0, elastic);
  force(&s, x, v, 1, damped);
  msim_sim_force(sim, s.x, s.v, f);
  for (int i = 0; i < 3 * N; i++) {
    assert_close(f[i], creal(elastic[i] + damped[i]), 2e-13);
    sum[i % 3] += f[i] + s.drag * s.v[i];
  }
  for (int c = 0; c < 3; c++) assert_close(sum[c], 0, 1e-12); /* spring forces cancel */
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A = M - h D - h^2 J with J and D by complex step; symmetric bit by bit */
static void matrix_is_the_derivative(void **state) {
  (void)state;
  static double J[9 * N * N], D[9 * N * N];
  const double h = 0.07;
  tangle s = make_tangle(3, 0.7);
  msim_scene *scene = scene_of(&s);
  msim_sim *sim = sim_of(scene, "linearly-implicit-euler", h, MSIM_JACOBIAN_EXACT);
  msim_csr A = {.size = sizeof A};
  assert_ok(msim_sim_matrix(sim, &A, err));
  assert_int_equal(A.n, 3 * N);
  derivative(&s, 0, J);
  derivative(&s, 1, D);
  for (int r = 0; r < 3 * N; r++)
    for (int c = 0; c < 3 * N; c++) {
      double mass = r == c ? s.mass[r / 3] : 0;
      assert_close(entry(&A, r, c), mass - h * D[3 * N * r + c] - h * h * J[3 * N * r + c], 1e-13);
      assert_true(entry(&A, r, c) == entry(&A, c, r));
    }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Three particles, springs 1-2 and 2-3, nothing else: J = (M - A)/h^2. Each spring contributes J_ii
 * = J_jj = k (-I + L/l (I - d d^T/l^2)) and J_ij = J_ji = -J_ii, d = x_j - x_i, l = |d|. */
static void three_particles_entry_by_entry(void **state) {
  (void)state;
  const double x[9] = {0.1, 0.2, -0.3, 1.2, 0.5, 0.1, 1.9, 1.4, 0.6}, mass[3] = {1, 2, 3};
  const double k[2] = {20, 30}, L[2] = {0.9, 1.1}, h = 1;
  const int32_t ij[4] = {0, 1, 1, 2};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 3, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 2, ij, k, L, NULL, err));
  msim_sim *sim = sim_of(scene, "linearly-implicit-euler", h, MSIM_JACOBIAN_EXACT);
  msim_csr A = {.size = sizeof A};
  assert_ok(msim_sim_matrix(sim, &A, err));
  double block[2][3][3]; /* J_ii of each spring */
  for (int s = 0; s < 2; s++) {
    double d[3], l2 = 0;
    for (int c = 0; c < 3; c++) d[c] = x[3 * s + 3 + c] - x[3 * s + c], l2 += d[c] * d[c];
    double l = sqrt(l2);
    for (int r = 0; r < 3; r++)
      for (int c = 0; c < 3; c++)
        block[s][r][c] = k[s] * (-(r == c) + L[s] / l * ((r == c) - d[r] * d[c] / l2));
  }
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
          double J = 0;
          if (i == j) J = (i < 2 ? block[i][r][c] : 0) + (i > 0 ? block[i - 1][r][c] : 0);
          else if (abs(i - j) == 1) J = -block[i < j ? i : j][r][c];
          double m = i == j && r == c ? mass[i] : 0;
          assert_close(entry(&A, 3 * i + r, 3 * j + c), m - h * h * J, 1e-14);
        }
  /* blocks (1,3) and (3,1) are not stored */
  assert_int_equal(A.rowptr[9], 9 * 7);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* The matrix, n by n, of what is stored: of all entries, or of those on and above the diagonal */
static void make_dense(const ms_sparse_matrix *a, int32_t n, int is_upper, double *dense) {
  for (int32_t r = 0; r < n; r++)
    for (int32_t e = a->rowptr[r]; e < a->rowptr[r + 1]; e++) {
      if (e > a->rowptr[r]) assert_true(a->colind[e - 1] < a->colind[e]);
      dense[n * r + a->colind[e]] = a->val[e];
      if (is_upper) dense[n * a->colind[e] + r] = a->val[e];
    }
}

/* Both triangles, the upper one in another order, and A x without a matrix agree. */
static void formats_agree(void **state) {
  (void)state;
  tangle s = make_tangle(3, 0.7);
  msim_scene *scene = scene_of(&s);
  const int32_t pins[3] = {2, 5, 6};
  assert_ok(msim_scene_pin(scene, 3, pins, err));
  ms_model model;
  ms_coefficients a;
  ms_sparse_graph graph;
  ms_sparse_matrix full, upper;
  assert_ok(ms_model_create(scene->data, 0, &model, err));
  assert_ok(ms_coefficients_create(&model, &a, err));
  assert_ok(ms_sparse_matrix_create_graph(&model, &graph, err));
  const int32_t order[N - 3] = {8, 0, 7, 1, 6, 2, 5, 3, 4}, n = 3 * (N - 3);
  const ms_sparse_layout layouts[] = {{MSIM_FORMAT_FULL, 3, order}, {MSIM_FORMAT_UPPER, 3, order}};
  assert_ok(ms_sparse_matrix_create(&model, &graph, layouts[0], &full, err));
  assert_ok(ms_sparse_matrix_create(&model, &graph, layouts[1], &upper, err));
  double *x = ms_unknowns_new_vector(scene->data, &model.unknowns),
         *y = ms_unknowns_new_vector(scene->data, &model.unknowns);
  double *magnitude = ms_unknowns_new_vector(scene->data, &model.unknowns);
  double px[3 * N], py[3 * N], dense[2][9 * N * N] = {{0}};
  ms_unknowns_gather(&model.unknowns, s.x, x);
  ms_coefficients_compute(&model, x, 0.07, 0, &a);
  ms_sparse_matrix_assemble(&model, &a, &full);
  ms_sparse_matrix_assemble(&model, &a, &upper);
  make_dense(&full, n, 0, dense[0]);
  make_dense(&upper, n, 1, dense[1]);
  assert_memory_equal(dense[0], dense[1], sizeof dense[0]);
  ms_unknowns_gather(&model.unknowns, s.v, x);
  for (int32_t r = model.unknowns.first_pinned; r < model.unknowns.stride; r++)
    for (int c = 0; c < 3; c++) x[c * model.unknowns.stride + r] = 0;
  ms_coefficients_apply(&model, &a, x, y);
  ms_coefficients_apply_abs(&model, &a, x, magnitude);
  ms_sparse_matrix_pack(&model, &full, x, px);
  ms_sparse_matrix_pack(&model, &full, y, py);
  for (int32_t r = 0; r < n; r++) {
    double sum = 0;
    for (int32_t c = 0; c < n; c++) sum += dense[0][n * r + c] * px[c];
    assert_close(sum, py[r], 1e-13);
  }
  for (int32_t i = 0; i < 3 * model.unknowns.stride; i++)
    if (i % model.unknowns.stride < model.unknowns.nfree) assert_true(magnitude[i] >= fabs(y[i]));
  ms_memory_free(&scene->data->alloc, x), ms_memory_free(&scene->data->alloc, y);
  ms_memory_free(&scene->data->alloc, magnitude);
  ms_sparse_matrix_destroy(&model, &full), ms_sparse_matrix_destroy(&model, &upper);
  ms_sparse_matrix_destroy_graph(&model, &graph);
  ms_coefficients_destroy(&model, &a);
  ms_model_destroy(&model);
  msim_scene_destroy(scene);
}

/* The kernels of every instruction set agree up to rounding, padding and incomplete slices
 * included. */
static void instruction_sets_agree(void **state) {
  (void)state;
  static const char *const sets[] = {"baseline", "avx2", "avx512"};
  tangle s = make_tangle(3, 0.7);
  msim_scene *scene = scene_of(&s);
  ms_model model;
  ms_coefficients a;
  assert_ok(ms_model_create(scene->data, 0, &model, err));
  assert_ok(ms_coefficients_create(&model, &a, err));
  const size_t n = 3 * (size_t)model.unknowns.stride,
               slots = MS_SLICE * (size_t)model.half_edges.nentries;
  double *x = ms_unknowns_new_vector(scene->data, &model.unknowns);
  double *y = ms_unknowns_new_vector(scene->data, &model.unknowns);
  double first[3][9 * N * N];
  ms_unknowns_gather(&model.unknowns, s.x, x);
  for (size_t i = 0; i < 3; i++) {
    model.isa = ms_isa_find(sets[i]);
    if (model.isa < 0) continue; /* not supported by this CPU */
    ms_coefficients_compute(&model, x, 0.07, 0, &a);
    ms_coefficients_apply(&model, &a, x, y);
    const double *results[] = {a.t, a.g, y};
    const size_t counts[] = {slots, slots, n};
    for (int r = 0; r < 3; r++) {
      assert_true(counts[r] <= 9 * N * N);
      if (i == 0) memcpy(first[r], results[r], counts[r] * sizeof(double));
      for (size_t k = 0; k < counts[r]; k++)
        assert_close(results[r][k], first[r][k], 1e-12 * (1 + fabs(first[r][k])));
    }
  }
  assert_int_equal(ms_isa_find("avx1024"), -1);
  ms_memory_free(&scene->data->alloc, x), ms_memory_free(&scene->data->alloc, y);
  ms_coefficients_destroy(&model, &a);
  ms_model_destroy(&model);
  msim_scene_destroy(scene);
}

/* Two particles `length` apart, rest length 1, k = 100, masses 1: A for h = 0.1. */
static void pair_matrix(double length, int jacobian, double A[6][6]) {
  const double x[6] = {0, 0, 0, length, 0, 0}, mass[2] = {1, 1}, k = 100, rest = 1;
  const int32_t ij[2] = {0, 1};
  msim_scene *scene;
  msim_csr csr = {.size = sizeof csr};
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
  msim_sim *sim = sim_of(scene, "linearly-implicit-euler", 0.1, jacobian);
  assert_ok(msim_sim_matrix(sim, &csr, err));
  for (int r = 0; r < 6; r++)
    for (int c = 0; c < 6; c++) A[r][c] = entry(&csr, r, c);
  double v[6] = {0}, f[6];
  if (length == 0) {
    msim_sim_force(sim, x, v, f);
    for (int i = 0; i < 6; i++) assert_true(f[i] == 0);
  }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void clamp_and_zero_length(void **state) {
  (void)state;
  double A[6][6];
  pair_matrix(0.5, MSIM_JACOBIAN_EXACT, A); /* 1 - L/l = -1 */
  assert_close(A[0][0], 1 + 1, 1e-15);
  assert_close(A[1][1], 1 - 1, 1e-15);
  pair_matrix(0.5, MSIM_JACOBIAN_CLAMP, A);
  assert_close(A[0][0], 1 + 1, 1e-15);
  assert_true(A[1][1] == 1 && A[2][2] == 1 && A[1][4] == 0);
  pair_matrix(2.0, MSIM_JACOBIAN_CLAMP, A); /* stretched: clamping changes nothing */
  assert_close(A[1][1], 1 + 0.5, 1e-15);
  pair_matrix(0.0, MSIM_JACOBIAN_EXACT, A); /* J_ii = -k I */
  for (int r = 0; r < 3; r++)
    for (int c = 0; c < 3; c++) {
      assert_close(A[r][c], r == c ? 2 : 0, 1e-15);
      assert_close(A[r][3 + c], r == c ? -1 : 0, 1e-15);
    }
}

static void energy_is_the_sum(void **state) {
  (void)state;
  tangle s = make_tangle(0, 0);
  msim_scene *scene = scene_of(&s);
  msim_sim *sim = sim_of(scene, "verlet", 1e-3, 0);
  msim_state now = {.size = sizeof now, .n = N, .x = s.x, .v = s.v};
  msim_energy e = {.size = sizeof e};
  double complex x[3 * N];
  double kinetic = 0, p[3] = {0}, l[3] = {0};
  for (int i = 0; i < 3 * N; i++) x[i] = s.x[i];
  for (int i = 0; i < N; i++)
    for (int c = 0; c < 3; c++) {
      int a = (c + 1) % 3, b = (c + 2) % 3;
      kinetic += 0.5 * s.mass[i] * s.v[3 * i + c] * s.v[3 * i + c];
      p[c] += s.mass[i] * s.v[3 * i + c];
      l[c] += s.mass[i] * (s.x[3 * i + a] * s.v[3 * i + b] - s.x[3 * i + b] * s.v[3 * i + a]);
    }
  assert_ok(msim_sim_set_state(sim, &now, err));
  msim_sim_energy(sim, &e);
  assert_close(e.kinetic, kinetic, 1e-13);
  assert_close(e.elastic + e.gravitational, creal(energy(&s, x)), 1e-12);
  assert_close(e.total, e.kinetic + e.elastic + e.gravitational, 1e-12);
  for (int c = 0; c < 3; c++) {
    assert_close(e.momentum[c], p[c], 1e-14);
    assert_close(e.angular_momentum[c], l[c], 1e-14);
  }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(force_is_minus_energy_gradient),
                                     cmocka_unit_test(damping_force_is_the_formula),
                                     cmocka_unit_test(matrix_is_the_derivative),
                                     cmocka_unit_test(three_particles_entry_by_entry),
                                     cmocka_unit_test(formats_agree),
                                     cmocka_unit_test(instruction_sets_agree),
                                     cmocka_unit_test(clamp_and_zero_length),
                                     cmocka_unit_test(energy_is_the_sum)};
  return cmocka_run_group_tests_name("physics", tests, NULL, NULL);
}
