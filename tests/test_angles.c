/* Tests of the formulas of angular springs: forces and matrix against complex steps of an energy of
 * their own, the limits at straight and folded edges, conserved quantities, and the parts that
 * models, products and sparse matrices take from them. */
#include <complex.h>
#include <math.h>
#include <stdlib.h>

#include "base/vec3.h"
#include "linear/sparse_matrix.h"
#include "physics/angle.h"
#include "physics/angle_springs.h"
#include "physics/nonlinearity.h"
#include "physics/reference.h"
#include "scenes.h"
#include "sim/sim.h"

#define PI 3.14159265358979323846

static uint64_t seed = 1;

/* Uniform in [-1, 1) */
static double random_number(void) {
  seed = seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
  return (double)(seed >> 11) / 4503599627370496.0 - 1;
}

/*------------------------------------- an energy ------------------------------------------------*/

/* E = k/2 (phi - bend)^2 with phi = 2 atan(|b p + a q|/|b p - a q|) (Kahan 2006), for x = (x_i,
 * x_j, x_k) */
static double complex energy(const ms_angle_spring *s, const double complex x[9]) {
  double complex a2 = 0, b2 = 0, sum = 0, difference = 0;
  for (int c = 0; c < 3; c++) {
    const double complex p = x[c] - x[3 + c], q = x[6 + c] - x[3 + c];
    a2 += p * p, b2 += q * q;
  }
  const double complex a = csqrt(a2), b = csqrt(b2);
  for (int c = 0; c < 3; c++) {
    const double complex p = x[c] - x[3 + c], q = x[6 + c] - x[3 + c];
    sum += (b * p + a * q) * (b * p + a * q), difference += (b * p - a * q) * (b * p - a * q);
  }
  const double complex turn = 2 * catan(csqrt(sum) / csqrt(difference)) - s->bend;
  return s->k / 2 * turn * turn;
}

/* dE/dx_i by a complex step, at x + by e_j */
static double slope(const ms_angle_spring *s, const double x[9], int i, int j, double by) {
  const double STEP = 1e-30;
  double complex z[9];
  for (int c = 0; c < 9; c++) z[c] = x[c] + (c == j ? by : 0);
  z[i] += I * STEP;
  return cimag(energy(s, z)) / STEP;
}

/* d2E/dx_i dx_j: central differences of complex steps, extrapolated to order 4 */
static double curvature(const ms_angle_spring *s, const double x[9], int i, int j) {
  const double D = 2e-4;
  const double wide = (slope(s, x, i, j, D) - slope(s, x, i, j, -D)) / (2 * D);
  const double narrow = (slope(s, x, i, j, D / 2) - slope(s, x, i, j, -D / 2)) / D;
  return (4 * narrow - wide) / 3;
}

/*------------------------------------- formulas -------------------------------------------------*/

static ms_angle measure(const double x[9]) {
  ms_angle at;
  double p[3], q[3];
  for (int c = 0; c < 3; c++) p[c] = x[c] - x[3 + c], q[c] = x[6 + c] - x[3 + c];
  ms_angle_measure(p, q, &at);
  return at;
}

/* f: the forces on i, j, k */
static void find_forces(const ms_angle_spring *s, const double x[9], const double *v, double f[9]) {
  const ms_angle at = measure(x);
  double vp[3], vq[3];
  for (int c = 0; c < 3 && v; c++) vp[c] = v[c] - v[3 + c], vq[c] = v[6 + c] - v[3 + c];
  ms_angle_force(&at, s, v ? vp : NULL, v ? vq : NULL, f, f + 6);
  for (int c = 0; c < 3; c++) f[3 + c] = -(f[c] + f[6 + c]);
}

static void find_matrix(const ms_angle_spring *s, const double x[9], double h, int clamp,
                        double to[9][9]) {
  const ms_angle at = measure(x);
  double element[MS_ANGLE_ELEMENT], block[3][3];
  ms_angle_matrix(&at, s, h, clamp, element);
  for (int r = 0; r < 9; r++)
    for (int c = 0; c < 9; c++) {
      ms_angle_block(element, r / 3, c / 3, block);
      to[r][c] = block[r % 3][c % 3];
    }
}

static void random_corners(double x[9]) {
  for (int c = 0; c < 9; c++) x[c] = random_number();
}

/* Edges of lengths a and b in a random direction that deviate from straight by phi */
static void bent_corners(double phi, double a, double b, double x[9]) {
  double u[3] = {random_number(), random_number(), random_number() + 2},
         t[3] = {random_number(), 2 + random_number(), 0};
  ms_vec3_axpy(-ms_vec3_dot(u, t) / ms_vec3_dot(u, u), u, t);
  const double lu = ms_vec3_norm(u), lt = ms_vec3_norm(t);
  for (int c = 0; c < 3; c++) {
    x[3 + c] = 0;
    x[c] = -a * u[c] / lu;
    x[6 + c] = b * (cos(phi) * u[c] / lu + sin(phi) * t[c] / lt);
  }
}

static double largest_of(const double (*m)[9]) {
  double largest = 0;
  for (int i = 0; i < 81; i++) largest = fmax(largest, fabs(m[i / 9][i % 9]));
  return largest;
}

static void check_derivatives(const ms_angle_spring *s, const double x[9], double tolerance) {
  double f[9], m[9][9];
  find_forces(s, x, NULL, f);
  find_matrix(s, x, 1, 0, m);
  const double scale = s->k / fmin(measure(x).a2, measure(x).b2);
  for (int i = 0; i < 9; i++) {
    assert_close(f[i], -slope(s, x, i, 0, 0), 1e-13 * scale);
    for (int j = 0; j < 9; j++) {
      assert_close(m[i][j], curvature(s, x, i, j), tolerance * scale);
      assert_true(m[i][j] == m[j][i]);
    }
  }
  const ms_angle at = measure(x);
  double complex z[9];
  for (int c = 0; c < 9; c++) z[c] = x[c];
  assert_close(ms_angle_energy(&at, s), creal(energy(s, z)), 1e-14 * s->k * 10);
}

static void forces_and_matrix_are_derivatives_of_the_energy(void **state) {
  (void)state;
  for (int n = 0; n < 300; n++) {
    const ms_angle_spring s = {1 + random_number() / 2, n % 3 ? PI / 2 * (1 + random_number()) : 0,
                               0};
    double x[9];
    random_corners(x);
    const ms_angle at = measure(x);
    if (fmin(at.a2, at.b2) < 0.1 || at.phi < 0.1 || at.phi > PI - 0.1) continue;
    check_derivatives(&s, x, 1e-7);
  }
}

/* Also near straight edges, and exactly there; the same for rest = 0 at folded ones. */
static void straight_edges_are_smooth(void **state) {
  (void)state;
  for (int n = 0; n < 40; n++) {
    const ms_angle_spring straight = {0.7, 0, 0}, folded = {0.7, PI, 0};
    const double phi = n % 8 ? pow(10, -n % 8) : 0;
    double x[9];
    bent_corners(phi, 0.8, 1.1, x);
    check_derivatives(&straight, x, 1e-7);
    for (int c = 6; c < 9; c++) x[c] = -x[c];
    check_derivatives(&folded, x, 1e-7);
  }
  const ms_angle_spring s = {2, 0, 0.3};
  double x[9] = {-1, 0, 0, 0, 1e-20, 0, 0.5, 0, 0}, f[9], m[9][9];
  find_forces(&s, x, NULL, f); /* linear, however small the deviation is */
  assert_close(f[1], 2 * 3e-20, 1e-33);
  x[4] = 0;
  find_forces(&s, x, NULL, f);
  for (int c = 0; c < 9; c++) assert_true(f[c] == 0);
  find_matrix(&s, x, 1, 0, m); /* (2 + 0.3) |y_i/1 + y_k/0.5 - 3 y_j|^2 in y and z */
  assert_close(m[1][1], 2.3, 1e-14);
  assert_close(m[8][8], 2.3 * 4, 1e-14);
  assert_close(m[4][4], 2.3 * 9, 1e-13);
  assert_close(m[2][8], 2.3 * 2, 1e-14);
  assert_true(m[0][0] == 0 && m[1][2] == 0);
}

/* No force, and the stiffness k equal in all planes, where the direction of the force is not
 * defined; nothing where an edge has no length. */
static void undefined_directions_have_no_force(void **state) {
  (void)state;
  const ms_angle_spring s = {2, 0.5, 0};
  double x[9] = {-1, 0, 0, 0, 0, 0, 1, 0, 0}, f[9], m[9][9];
  for (int fold = 0; fold < 2; fold++, x[6] = -1) {
    find_forces(&s, x, NULL, f);
    find_matrix(&s, x, 1, 0, m);
    for (int c = 0; c < 9; c++) assert_true(f[c] == 0);
    assert_close(m[1][1], 2, 1e-15);
    assert_close(m[1][7], fold ? -2 : 2, 1e-15);
  }
  x[6] = 0;
  find_forces(&s, x, x, f);
  find_matrix(&s, x, 1, 0, m);
  for (int c = 0; c < 9; c++) assert_true(f[c] == 0 && m[c][c] == 0);
}

static void momentum_and_angular_momentum_are_conserved(void **state) {
  (void)state;
  for (int n = 0; n < 300; n++) {
    const ms_angle_spring s = {1, 1 + random_number(), 0.5};
    double x[9], v[9], f[9], torque[3] = {0}, size = 0;
    if (n % 3) random_corners(x);
    else bent_corners(n % 2 ? 1e-9 : 0, 1, 2, x);
    random_corners(v);
    find_forces(&s, x, v, f);
    for (int c = 0; c < 9; c++) size = fmax(size, fabs(f[c]));
    for (int c = 0; c < 3; c++) {
      assert_true(f[c] + f[3 + c] + f[6 + c] == 0 ||
                  fabs(f[c] + f[3 + c] + f[6 + c]) < 1e-15 * size);
      for (int k = 0; k < 3; k++) {
        const double *at = x + 3 * k, *by = f + 3 * k;
        torque[c] += at[(c + 1) % 3] * by[(c + 2) % 3] - at[(c + 2) % 3] * by[(c + 1) % 3];
      }
      assert_close(torque[c], 0, 1e-14 * fmax(size, 1));
    }
  }
}

/* The power of damping is -c (dphi/dt)^2, by a difference of phi; so it is at straight edges. */
static void damping_dissipates(void **state) {
  (void)state;
  for (int n = 0; n < 200; n++) {
    const ms_angle_spring s = {0, 0, 0.7};
    const double D = 1e-5;
    double x[9], v[9], f[9], ahead[9], behind[9], power = 0;
    if (n % 2) random_corners(x);
    else bent_corners(0, 1, 0.6, x);
    const ms_angle at = measure(x);
    if (n % 2 && (fmin(at.a2, at.b2) < 0.2 || at.phi < 0.2 || at.phi > PI - 0.2)) continue;
    random_corners(v);
    find_forces(&s, x, v, f);
    for (int c = 0; c < 9; c++) {
      power += f[c] * v[c];
      ahead[c] = x[c] + D * v[c], behind[c] = x[c] - D * v[c];
    }
    const double change =
        n % 2 ? (measure(ahead).phi - measure(behind).phi) / (2 * D) : measure(ahead).phi / D;
    assert_close(power, -0.7 * change * change, 1e-3 * (1 + change * change) * (n % 2 ? 1e-3 : 1));
  }
}

/* By Cholesky's method with a small shift */
static int is_semidefinite(const double m[9][9], double shift) {
  double l[9][9] = {{0}};
  for (int i = 0; i < 9; i++)
    for (int j = 0; j <= i; j++) {
      double sum = m[i][j] + (i == j ? shift : 0);
      for (int k = 0; k < j; k++) sum -= l[i][k] * l[j][k];
      if (i == j && !(sum > 0)) return 0;
      l[i][j] = i == j ? sqrt(sum) : sum / l[j][j];
    }
  return 1;
}

/* The clamped matrix is positive semidefinite, is the exact one at rest, and keeps the tension-like
 * stiffness across the plane: k phi/tan(phi/2)/2 for alpha = beta. */
static void clamped_matrix_is_semidefinite(void **state) {
  (void)state;
  for (int n = 0; n < 300; n++) {
    const ms_angle_spring s = {1, n % 2 ? 0 : PI / 2 * (1 + random_number()), 0.1};
    double x[9], m[9][9], exact[9][9];
    random_corners(x);
    find_matrix(&s, x, 0.5, 1, m);
    assert_true(is_semidefinite((const double(*)[9])m, 1e-12 * largest_of((const double(*)[9])m)));
    const ms_angle_spring at_rest = {1, measure(x).phi, 0.1};
    find_matrix(&at_rest, x, 0.5, 1, m), find_matrix(&at_rest, x, 0.5, 0, exact);
    for (int i = 0; i < 81; i++) assert_close(m[i / 9][i % 9], exact[i / 9][i % 9], 1e-13);
  }
  const ms_angle_spring s = {1, 0, 0};
  const double x[9] = {-1, 0, 0, 0, 0, 0, 0, 1, 0}; /* phi = pi/2, n = -z */
  double m[9][9];
  find_matrix(&s, x, 1, 1, m);
  assert_close(m[2][2], PI / 2 / 2, 1e-15);
  assert_close(m[2][8], PI / 2 / 2, 1e-15);
  find_matrix(&s, x, 1, 0, m);
  assert_close(m[2][2], 0, 1e-15);
  assert_close(m[2][8], PI / 2, 1e-15);
}

/*------------------------------------- models ---------------------------------------------------*/

enum { N = 12, SPRINGS = 8, ANGLES = 10 };

/* Random particles, springs and angles, some of them pinned; planar: z = 0 */
static msim_scene *random_scene(int planar, double damping) {
  double x[3 * N], mass[N], k[SPRINGS], c[SPRINGS], stiffness[ANGLES], rest[ANGLES],
      dashpot[ANGLES];
  int32_t ij[2 * SPRINGS], ijk[3 * ANGLES];
  const int32_t pins[2] = {3, 7};
  for (int i = 0; i < N; i++) {
    mass[i] = 1.5 + random_number();
    for (int d = 0; d < 3; d++) x[3 * i + d] = d == 2 && planar ? 0 : 3 * random_number();
  }
  for (int e = 0; e < SPRINGS; e++) {
    ij[2 * e] = e, ij[2 * e + 1] = (e + 1 + e % 3) % N;
    k[e] = 20 + 10 * random_number(), c[e] = damping;
  }
  for (int e = 0; e < ANGLES; e++) {
    const int first = (int)(N * (random_number() + 1) / 2);
    for (int q = 0; q < 3; q++) ijk[3 * e + q] = (first + q * (1 + e % 4)) % N;
    stiffness[e] = 5 + 3 * random_number(), rest[e] = e % 2 ? PI : PI / 2 * (1 + random_number());
    dashpot[e] = damping * (1 + random_number());
  }
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, N, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, SPRINGS, ij, k, NULL, c, err));
  assert_ok(msim_scene_add_angles(scene, ANGLES, ijk, stiffness, rest, dashpot, err));
  assert_ok(msim_scene_pin(scene, 2, pins, err));
  return scene;
}

/* Random vectors of an island: positions near those of the scene, velocities */
typedef struct vectors {
  double *x, *v, *f, *y, *z;
} vectors;

static vectors new_vectors(const ms_model *m) {
  vectors w;
  assert_true(MS_NEW_VECTORS(m->scene, &m->unknowns, &w.x, &w.v, &w.f, &w.y, &w.z));
  ms_unknowns_gather(&m->unknowns, m->scene->x, w.x);
  for (int32_t r = 0; r < m->unknowns.nfree; r++)
    for (int32_t c = 0; c < m->unknowns.dims; c++)
      w.v[c * m->unknowns.stride + r] = random_number();
  return w;
}

static void free_vectors(const ms_model *m, const vectors *w) {
  MS_FREE(&m->scene->alloc, w->x, w->v, w->f, w->y, w->z);
}

static void forces_agree_with_the_reference(void **state) {
  (void)state;
  for (int n = 0; n < 100; n++) {
    msim_scene *scene = random_scene(n % 2, n % 4 < 2 ? 0 : 0.3);
    ms_model m;
    double v[3 * N] = {0}, f[3 * N], there[3 * N];
    assert_ok(ms_model_create(scene->data, 0, &m, err));
    assert_int_equal(m.unknowns.dims, n % 2 ? 2 : 3);
    const vectors w = new_vectors(&m);
    ms_unknowns_scatter(&m.unknowns, w.v, v);
    for (int with_v = 0; with_v < 2; with_v++) {
      const double none[3 * N] = {0};
      memset(f, 0, sizeof f);
      ms_reference_compute_force(scene->data, scene->data->x, with_v ? v : none, there);
      ms_force_compute(&m, w.x, with_v ? w.v : NULL, w.f);
      ms_unknowns_scatter(&m.unknowns, w.f, f);
      for (int i = 0; i < 3 * N; i++)
        if (!scene->data->pinned[i / 3]) assert_close(f[i], there[i], 1e-11 * (1 + fabs(there[i])));
    }
    free_vectors(&m, &w), ms_model_destroy(&m), msim_scene_destroy(scene);
  }
}

/* A model with its matrix in all forms, at random vectors */
typedef struct matrices {
  ms_model m;
  ms_coefficients a;
  ms_sparse_matrix sparse;
  vectors w; /* v: z, y: A z, z: |A| |z| */
} matrices;

static void make_matrices(const msim_scene *scene, double h, matrices *to) {
  ms_sparse_graph graph;
  assert_ok(ms_model_create(scene->data, 0, &to->m, err));
  assert_ok(ms_coefficients_create(&to->m, &to->a, err));
  assert_ok(ms_sparse_matrix_create_graph(&to->m, &graph, err));
  const ms_sparse_layout layout = {MSIM_FORMAT_FULL, to->m.unknowns.dims, NULL};
  assert_ok(ms_sparse_matrix_create(&to->m, &graph, layout, &to->sparse, err));
  ms_sparse_matrix_destroy_graph(&to->m, &graph);
  to->w = new_vectors(&to->m);
  ms_coefficients_compute(&to->m, to->w.x, h, 0, &to->a);
  ms_coefficients_apply(&to->m, &to->a, to->w.v, to->w.y);
  ms_coefficients_apply_abs(&to->m, &to->a, to->w.v, to->w.z);
  ms_sparse_matrix_assemble(&to->m, &to->a, &to->sparse);
}

static void free_matrices(matrices *of) {
  free_vectors(&of->m, &of->w);
  ms_sparse_matrix_destroy(&of->m, &of->sparse);
  ms_coefficients_destroy(&of->m, &of->a), ms_model_destroy(&of->m);
}

/* out = M z - h D z - h^2 J z by differences of forces */
static void differentiate(const matrices *of, double h, double *out) {
  const double D = 1e-6;
  const ms_model *m = &of->m;
  const size_t n = (size_t)m->unknowns.dims * (size_t)m->unknowns.stride;
  double *step = ms_unknowns_new_vector(m->scene, &m->unknowns);
  ms_vector_scale_rows(m->shape, m->mass, of->w.v, out);
  for (int side = -1; side <= 1; side += 2) {
    for (size_t i = 0; i < n; i++) step[i] = of->w.x[i] + side * D * of->w.v[i];
    ms_force_compute(m, step, NULL, of->w.f);
    ms_vector_axpy(m->shape, -side * h * h / (2 * D), of->w.f, out);
    for (size_t i = 0; i < n; i++) step[i] = side * of->w.v[i];
    ms_force_compute(m, of->w.x, step, of->w.f);
    ms_vector_axpy(m->shape, -side * h / 2, of->w.f, out);
  }
  ms_memory_free(&m->scene->alloc, step);
}

/* In all products with the matrix, and in CSR */
static void products_are_derivatives_of_the_force(void **state) {
  (void)state;
  for (int n = 0; n < 60; n++) {
    msim_scene *scene = random_scene(n % 2, n % 4 < 2 ? 0 : 0.3);
    matrices a;
    double packed[3 * N];
    make_matrices(scene, 0.1, &a);
    double *out = ms_unknowns_new_vector(a.m.scene, &a.m.unknowns);
    differentiate(&a, 0.1, out);
    ms_sparse_matrix_pack(&a.m, &a.sparse, a.w.v, packed);
    for (int32_t row = 0; row < a.m.unknowns.dims * a.m.unknowns.nfree; row++) {
      const int32_t at = row % a.m.unknowns.dims * a.m.unknowns.stride + row / a.m.unknowns.dims;
      double product = 0, all = 0;
      for (int32_t e = a.sparse.rowptr[row]; e < a.sparse.rowptr[row + 1]; e++) {
        product += a.sparse.val[e] * packed[a.sparse.colind[e]];
        all += fabs(a.sparse.val[e] * packed[a.sparse.colind[e]]);
      }
      assert_close(a.w.y[at], out[at], 1e-7 * a.w.z[at]);
      assert_close(product, a.w.y[at], 1e-13 * a.w.z[at]);
      assert_true(a.w.z[at] >= all * (1 - 1e-12) && all > 0);
    }
    ms_memory_free(&a.m.scene->alloc, out);
    free_matrices(&a), msim_scene_destroy(scene);
  }
}

/* A common translation is multiplied by M, to rounding of M alone, however stiff angles are. */
static void translations_have_no_stiffness(void **state) {
  (void)state;
  const double mass[3] = {1, 2, 3}, x[9] = {-0.3, 0, 0, 0, 0, 0.01, 0.2, 0.1, 0}, k = 1e12;
  const int32_t ijk[3] = {0, 1, 2};
  msim_scene *scene;
  ms_model m;
  ms_coefficients a;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 3, x, NULL, mass, err));
  assert_ok(msim_scene_add_angles(scene, 1, ijk, &k, NULL, NULL, err));
  assert_ok(ms_model_create(scene->data, 0, &m, err));
  assert_ok(ms_coefficients_create(&m, &a, err));
  const vectors w = new_vectors(&m);
  ms_coefficients_compute(&m, w.x, 1, 0, &a);
  for (int32_t r = 0; r < 3; r++)
    for (int32_t c = 0; c < 3; c++) w.v[c * m.unknowns.stride + r] = 0.1 * (c + 1);
  ms_coefficients_apply(&m, &a, w.v, w.y);
  for (int32_t r = 0; r < 3; r++)
    for (int32_t c = 0; c < 3; c++)
      assert_true(w.y[c * m.unknowns.stride + r] == mass[r] * (0.1 * (c + 1)));
  free_vectors(&m, &w), ms_coefficients_destroy(&m, &a), ms_model_destroy(&m);
  msim_scene_destroy(scene);
}

/* U(x + s) - U(x) - grad U.s, for large and for small s, against quad precision of the energy */
static void nonlinearity_is_accurate(void **state) {
  (void)state;
  for (int n = 0; n < 100; n++) {
    const double size = pow(10, -n % 7);
    msim_scene *scene = random_scene(0, 0);
    ms_model m;
    assert_ok(ms_model_create(scene->data, 0, &m, err));
    const vectors w = new_vectors(&m);
    const double small = size / 2;
    const double whole = ms_angle_springs_nonlinearity(&m, w.x, w.v, size);
    const double part = ms_angle_springs_nonlinearity(&m, w.x, w.v, small);
    double *moved = w.z;
    for (int32_t i = 0; i < 3 * m.unknowns.stride; i++) moved[i] = w.x[i] + small * w.v[i];
    /* E(x + 2 s) - E(x) - 2 E'(x).s = N(x, s) + N(x + s, s) + (E'(x + s) - E'(x)).s */
    const double next = ms_angle_springs_nonlinearity(&m, moved, w.v, small);
    double turned = 0;
    ms_model angles = m; /* of the angles alone */
    memset(m.half_edges.k, 0, m.half_edges.nvalues * sizeof(double));
    ms_force_compute(&angles, moved, NULL, w.f), ms_force_compute(&angles, w.x, NULL, w.y);
    for (int32_t r = 0; r < m.unknowns.nfree; r++)
      for (int32_t c = 0; c < 3; c++) {
        const int32_t at = c * m.unknowns.stride + r;
        turned -= (w.f[at] - w.y[at]) * small * w.v[at];
      }
    const double scale = fabs(part) + fabs(next) + fabs(turned);
    if (size < 0.05) assert_close(whole, part + next + turned, 1e-5 * scale + 1e-13 * size);
    else assert_close(whole, part + next + turned, 1e-8 * (scale + 1));
    free_vectors(&m, &w), ms_model_destroy(&m), msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(forces_and_matrix_are_derivatives_of_the_energy),
      cmocka_unit_test(straight_edges_are_smooth),
      cmocka_unit_test(undefined_directions_have_no_force),
      cmocka_unit_test(momentum_and_angular_momentum_are_conserved),
      cmocka_unit_test(damping_dissipates),
      cmocka_unit_test(clamped_matrix_is_semidefinite),
      cmocka_unit_test(forces_agree_with_the_reference),
      cmocka_unit_test(products_are_derivatives_of_the_force),
      cmocka_unit_test(translations_have_no_stiffness),
      cmocka_unit_test(nonlinearity_is_accurate)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
