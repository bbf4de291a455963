/* Tests of conjugate gradients on the matrices of random small scenes, against dense Cholesky
 * factorization: angular springs, contact, pins, planar scenes, stiffnesses and masses over many
 * orders of magnitude, far from the origin; with and without a coarse space. */
#include "linear/jacobi.h"
#include "linear/residual.h"
#include "drawn_scenes.h"
#include "two_level.h"

enum { MOST = 32, LARGEST = 3 * MOST };

/* What scene `seed` has */
enum { PLANAR = 1, ANGLES = 2, CONTACT = 4, FAR = 8, STIFF = 16, LIGHT = 32, SOME = 64 };

/* A chain with springs between any of its particles */
static msim_scene *draw_chain(unsigned of) {
  unsigned seed = of * 2654435769u;
  const int32_t n = 8 + draw_index(&seed, MOST - 8), pins[2] = {0, n / 2};
  double x[3 * MOST], v[3 * MOST], mass[MOST], lowest = INFINITY;
  const double g[3] = {0.5, 0, -9.81}, far = of & FAR ? 1e6 : 0;
  msim_scene *scene;
  for (int32_t i = 0; i < 3 * n; i++)
    x[i] = of & PLANAR && i % 3 == 1 ? 0 : far + draw(&seed),
    v[i] = of & PLANAR && i % 3 == 1 ? 0 : draw(&seed);
  for (int32_t p = 0; p < n; p++)
    mass[p] = pow(10, of & LIGHT ? 4 * draw(&seed) - 5 : draw(&seed)),
    lowest = fmin(lowest, x[3 * p + 2]);
  for (int32_t p = 0; p < 2; p++)
    for (int32_t c = 0; c < 3; c++) v[3 * pins[p] + c] = 0;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, n, x, v, mass, err));
  for (int32_t e = 0; e < 3 * n; e++) {
    const int32_t i = e % n, j = e < n - 1 ? i + 1 : (i + 1 + draw_index(&seed, n - 1)) % n;
    const double k = pow(10, of & STIFF ? 5 + draw(&seed) : 2 + draw(&seed)), c = 1 + draw(&seed);
    assert_ok(msim_scene_add_springs(scene, 1, (int32_t[2]){i, j}, &k, NULL, &c, err));
  }
  for (int32_t p = 0; p + 2 < n && of & ANGLES; p++) {
    const double k = 2 + draw(&seed);
    assert_ok(msim_scene_add_angles(scene, 1, (int32_t[3]){p, p + 1, p + 2}, &k, NULL, NULL, err));
  }
  assert_ok(msim_scene_pin(scene, of % 3 == 0 ? 0 : 2, pins, err));
  if (of & CONTACT) plane(scene, 0, 0, 1, lowest, 0, 0.3);
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

/*------------------------------------- dense matrix ---------------------------------------------*/

typedef struct dense {
  int32_t n;
  double a[LARGEST][LARGEST], l[LARGEST][LARGEST]; /* A = L L^T */
} dense;

/* The unknowns of a vector, component by component */
static void compress(const ms_unknowns *rows, const double *vec, double *to) {
  for (int32_t i = 0; i < rows->dims * rows->nfree; i++)
    to[i] = vec[i / rows->nfree * rows->stride + i % rows->nfree];
}

static void expand(const ms_unknowns *rows, const double *from, double *vec) {
  for (int32_t i = 0; i < rows->dims * rows->nfree; i++)
    vec[i / rows->nfree * rows->stride + i % rows->nfree] = from[i];
}

static void fill(const ms_linear_system *system, dense *d) {
  const ms_model *m = system->model;
  const ms_unknowns *rows = &m->unknowns;
  double *x = ms_unknowns_new_vector(m->scene, rows), *y = ms_unknowns_new_vector(m->scene, rows);
  d->n = rows->dims * rows->nfree;
  for (int32_t j = 0; j < d->n; j++) {
    double unit[LARGEST] = {0};
    unit[j] = 1;
    expand(rows, unit, x);
    ms_linear_system_apply(system, x, y);
    compress(rows, y, d->a[j]);
  }
  MS_FREE(&m->scene->alloc, x, y);
  for (int32_t i = 0; i < d->n; i++)
    for (int32_t j = 0; j <= i; j++) {
      double sum = d->a[i][j];
      for (int32_t k = 0; k < j; k++) sum -= d->l[i][k] * d->l[j][k];
      assert_true(j < i || sum > 0);
      d->l[i][j] = j < i ? sum / d->l[j][j] : sqrt(sum);
    }
}

static void solve_dense(const dense *d, const double *b, double *x) {
  for (int32_t i = 0; i < d->n; i++) {
    x[i] = b[i];
    for (int32_t k = 0; k < i; k++) x[i] -= d->l[i][k] * x[k];
    x[i] /= d->l[i][i];
  }
  for (int32_t i = d->n; i-- > 0;) {
    for (int32_t k = i + 1; k < d->n; k++) x[i] -= d->l[k][i] * x[k];
    x[i] /= d->l[i][i];
  }
}

/* The trace of A^-1 D, D the diagonal blocks: no eigenvalue of it is larger. */
static double trace(const dense *d, int32_t dims) {
  double sum = 0;
  const int32_t nfree = d->n / dims;
  for (int32_t j = 0; j < d->n; j++) {
    double column[LARGEST] = {0}, x[LARGEST];
    for (int32_t c = 0; c < dims; c++)
      column[c * nfree + j % nfree] = d->a[j][c * nfree + j % nfree];
    solve_dense(d, column, x);
    sum += x[j];
  }
  return sum;
}

/* ||u - w|| in the norm of A */
static double distance(const dense *d, const double *u, const double *w) {
  double sum = 0;
  for (int32_t i = 0; i < d->n; i++)
    for (int32_t j = 0; j < d->n; j++) sum += (u[i] - w[i]) * d->a[i][j] * (u[j] - w[j]);
  return sqrt(fmax(sum, 0));
}

/*------------------------------------- solutions ------------------------------------------------*/

/* The residual r of a solution is within rtol, or at its rounding level, and the error in the norm
 * of A is sqrt(r.A^-1 r) <= sqrt(trace(A^-1 D)) ||r||. */
static void expect_solution(msim_sim *sim, double rtol) {
  ms_solver *solver = sim->islands->stepper.solver;
  const ms_linear_system *system = &solver->system;
  const ms_model *m = system->model;
  const ms_unknowns *rows = &m->unknowns;
  static dense d;
  double *b, *y, *work1, *work2, right[LARGEST], got[LARGEST], want[LARGEST];
  int64_t count = 0;
  assert_true(MS_NEW_VECTORS(m->scene, rows, &b, &y, &work1, &work2));
  ms_vector_fill_random(m->shape, 1, b);
  fill(system, &d);
  compress(rows, b, right);
  solve_dense(&d, right, want);
  const ms_linear_target target = {rtol, ms_jacobi_norm(m, &system->a, b), 100000};
  assert_ok(solver->linear->ops->solve(solver->linear, &target, b, y, &count, err));
  compress(rows, y, got);
  const double residual = ms_residual_compute(system, b, y, work1),
               level = ms_residual_compute_rounding_level(system, b, y, work1, work2),
               most = fmax(rtol * target.size, level);
  assert_true(count > 0);
  assert_close(residual, 0, most);
  assert_close(distance(&d, got, want), 0, sqrt(trace(&d, rows->dims)) * (most + level));
  MS_FREE(&m->scene->alloc, b, y, work1, work2);
}

static void random_systems_are_solved(void **state) {
  (void)state;
  static const double rtol[] = {1e-2, 1e-6, 1e-8, 1e-12, 1e-15};
  int constrained = 0, planar = 0;
  for (unsigned seed = 0; seed < 2 * SOME; seed++) {
    msim_scene *scene = draw_chain(seed);
    msim_options opt = two_level_options();
    opt.collision = MSIM_COLLISION_EVENT; /* constraints of particles on planes */
    msim_sim *sim = make_two_level_sim(scene, &opt, seed / SOME ? 8 : 0);
    assert_ok(msim_sim_step(sim, 3, err));
    const ms_solver *solver = sim->islands->stepper.solver;
    constrained += solver->system.a.nconstraints > 0;
    planar += sim->islands->model.unknowns.dims == 2;
    for (int i = 0; i < 5; i++) expect_solution(sim, rtol[i]);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
  assert_true(constrained > SOME / 4 && planar > SOME / 4);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(random_systems_are_solved)};
  return cmocka_run_group_tests_name("pcg_random", tests, NULL, NULL);
}
