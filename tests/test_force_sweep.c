/* Tests of the force sweep: spring forces at every length against long double, and results against
 * plain loops, for every instruction set and number of threads. */
#include <float.h>
#include <math.h>
#include <stdlib.h>

#include "base/simd.h"
#include "physics/fused_step.h"
#include "scenes.h"

static const char *const sets[] = {"baseline", "avx2", "avx512"};
enum { NSETS = 3 };

/*------------------------------------- lengths --------------------------------------------------*/

/* Pairs of particles, each joined by one spring; the first of a pair is in the origin, so that no
 * length is rounded. One pair per power of ten, one of length 0, one with NaN. */
enum { LONGEST = 150, PAIRS = 2 * LONGEST + 3, ZERO = PAIRS - 2, BROKEN = PAIRS - 1 };

typedef struct pairs {
  double x[6 * PAIRS], v[6 * PAIRS], mass[2 * PAIRS], k[PAIRS], rest[PAIRS], damping[PAIRS];
  int32_t ij[2 * PAIRS];
} pairs;

static void make_pairs(pairs *p) {
  unsigned seed = 5;
  memset(p, 0, sizeof *p);
  for (int i = 0; i < PAIRS; i++) {
    const double length = i < ZERO ? pow(10, i - LONGEST) : 0;
    for (int c = 0; c < 3; c++) {
      p->x[6 * i + 3 + c] = length * (0.1 + uniform(&seed)) * (c == i % 3 ? -1 : 1);
      p->v[6 * i + 3 + c] = uniform(&seed) - 0.5;
    }
    p->mass[2 * i] = p->mass[2 * i + 1] = 1;
    p->ij[2 * i] = 2 * i, p->ij[2 * i + 1] = 2 * i + 1;
    p->k[i] = 1 + 99 * uniform(&seed), p->rest[i] = uniform(&seed);
    p->damping[i] = uniform(&seed);
  }
}

/* The force of the spring on the second particle of pair i, and a scale for its error. */
static void exact(const pairs *p, int i, long double f[3], long double *scale) {
  const double *d = p->x + 6 * i + 3, *dv = p->v + 6 * i + 3;
  long double l2 = 0, rate = 0;
  for (int c = 0; c < 3; c++) l2 += (long double)d[c] * d[c];
  const long double l = sqrtl(l2);
  for (int c = 0; c < 3; c++) rate += d[c] / l * dv[c];
  for (int c = 0; c < 3; c++)
    f[c] = -(p->k[i] * (l - p->rest[i]) + p->damping[i] * rate) * (d[c] / l);
  *scale = p->k[i] * (l + p->rest[i]) + p->damping[i];
}

static void check_pairs(const pairs *p, const ms_unknowns *rows, const double *f) {
  int32_t row[2 * PAIRS];
  ms_unknowns_find_rows(rows, row);
  for (int i = 0; i < PAIRS; i++) {
    long double want[3], scale;
    exact(p, i, want, &scale);
    for (int c = 0; c < 3; c++) {
      const double one = f[c * rows->stride + row[2 * i]];
      const double other = f[c * rows->stride + row[2 * i + 1]];
      if (i == BROKEN) assert_true(isnan(one) && isnan(other));
      else if (i == ZERO) assert_true(one == 0 && other == 0);
      else assert_true(fabsl(other - want[c]) <= 4 * DBL_EPSILON * scale && one == -other);
    }
  }
}

static void forces_of_all_lengths(void **state) {
  (void)state;
  static pairs p;
  make_pairs(&p);
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  /* the scene refuses some of the lengths: they are set in the vectors later */
  static const double origin[6 * PAIRS];
  assert_ok(msim_scene_add_particles(scene, 2 * PAIRS, origin, NULL, p.mass, err));
  assert_ok(msim_scene_add_springs(scene, PAIRS, p.ij, p.k, p.rest, p.damping, err));
  ms_model model;
  assert_ok(ms_model_create(scene->data, MSIM_SKIP_TWO_D, &model, err));
  double *x = ms_unknowns_new_vector(scene->data, &model.unknowns),
         *f = ms_unknowns_new_vector(scene->data, &model.unknowns);
  double *v = ms_unknowns_new_vector(scene->data, &model.unknowns);
  for (int i = 0; i < NSETS; i++) {
    model.isa = ms_isa_find(sets[i]);
    if (model.isa < 0) continue; /* not supported by this CPU */
    p.x[6 * BROKEN + 4] = NAN;
    ms_unknowns_gather(&model.unknowns, p.x, x);
    ms_unknowns_gather(&model.unknowns, p.v, v);
    ms_fused_step_run(&model, &(ms_fused_step){.x = x, .v = v, .f = f});
    check_pairs(&p, &model.unknowns, f);
  }
  ms_memory_free(&scene->data->alloc, x), ms_memory_free(&scene->data->alloc, f);
  ms_memory_free(&scene->data->alloc, v);
  ms_model_destroy(&model);
  msim_scene_destroy(scene);
}

/* A scene in which all rest lengths equal the distances: the forces are exactly 0. */
static void springs_at_rest_exert_no_force(void **state) {
  (void)state;
  enum { N = 100 };
  double x[3 * N], k[3 * N], mass[N];
  int32_t ij[6 * N];
  unsigned seed = 9;
  for (int i = 0; i < 3 * N; i++) {
    x[i] = uniform(&seed), k[i] = 1e12 * uniform(&seed), mass[i % N] = 1;
    ij[2 * i] = i % N, ij[2 * i + 1] = (i + 1 + i / N) % N;
  }
  msim_scene *scene;
  ms_model model;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, N, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 3 * N, ij, k, NULL, NULL, err));
  assert_ok(ms_model_create(scene->data, MSIM_SKIP_TWO_D, &model, err));
  double *rows = ms_unknowns_new_vector(scene->data, &model.unknowns);
  double *f = ms_unknowns_new_vector(scene->data, &model.unknowns);
  ms_unknowns_gather(&model.unknowns, x, rows);
  for (int i = 0; i < NSETS; i++) {
    model.isa = ms_isa_find(sets[i]);
    if (model.isa < 0) continue;
    ms_fused_step_run(&model, &(ms_fused_step){.x = rows, .f = f});
    for (int r = 0; r < 3 * model.unknowns.stride; r++) assert_true(f[r] == 0);
  }
  ms_memory_free(&scene->data->alloc, rows), ms_memory_free(&scene->data->alloc, f);
  ms_model_destroy(&model);
  msim_scene_destroy(scene);
}

/*------------------------------------- results --------------------------------------------------*/

enum { SIDE = 40, VECTORS = 9 };

typedef struct bench {
  msim_scene *scene;
  ms_model model;
  double *vec[VECTORS];
} bench;

static void set_up(bench *b) {
  unsigned seed = 3;
  b->scene = hanging_cloth(SIDE, 200, 0.3);
  assert_ok(msim_scene_set_drag(b->scene, 0.2, err));
  assert_ok(ms_model_create(b->scene->data, 0, &b->model, err));
  double flat[3 * SIDE * SIDE];
  for (int i = 0; i < VECTORS; i++) {
    for (int r = 0; r < 3 * SIDE * SIDE; r++) flat[r] = uniform(&seed);
    b->vec[i] = ms_unknowns_new_vector(b->scene->data, &b->model.unknowns);
    ms_unknowns_gather(&b->model.unknowns, flat, b->vec[i]);
  }
}

static void tear_down(bench *b) {
  for (int i = 0; i < VECTORS; i++) ms_memory_free(&b->scene->data->alloc, b->vec[i]);
  ms_model_destroy(&b->model);
  msim_scene_destroy(b->scene);
}

/* All results at once; along: NULL for the new velocity. */
static ms_fused_step everything(const bench *b, const double *along) {
  double *const *vec = b->vec;
  return (ms_fused_step){.x = vec[0],
                         .v = vec[1],
                         .f = vec[5],
                         .a = vec[6],
                         .v_to = vec[7],
                         .v_from = vec[2],
                         .a_before = vec[3],
                         .h_before = 0.25,
                         .h = 0.5,
                         .x_to = vec[8],
                         .x_from = vec[4],
                         .along = along,
                         .drift = 2};
}

static void results_are_the_formulas(void **state) {
  (void)state;
  bench b;
  set_up(&b);
  double **vec = b.vec;
  const ms_unknowns *rows = &b.model.unknowns;
  for (int old = 0; old < 2; old++) {
    const ms_fused_step pass = everything(&b, old ? vec[1] : NULL);
    const double pinned = vec[8][rows->first_pinned];
    assert_true(ms_fused_step_run(&b.model, &pass));
    assert_true(vec[8][rows->first_pinned] == pinned);
    for (int c = 0; c < 3; c++)
      for (int r = 0; r < rows->nfree; r++) {
        const int at = c * rows->stride + r;
        assert_close(vec[6][at] * b.model.mass[r], vec[5][at], 1e-14 * fabs(vec[5][at]));
        const double v = vec[2][at] + 0.25 * vec[3][at] + 0.5 * vec[6][at];
        assert_close(vec[7][at], v, 1e-14 * (fabs(v) + 1));
        const double x = vec[4][at] + 2 * (old ? vec[1][at] : vec[7][at]);
        assert_close(vec[8][at], x, 1e-14 * (fabs(x) + 1));
      }
  }
  tear_down(&b);
}

/* A NaN, infinite or huge number is detected in any row, component and result. */
static void bad_numbers_are_detected(void **state) {
  (void)state;
  static const double bad[] = {NAN, INFINITY, -INFINITY, -2 * MS_LARGEST_VALID};
  bench b;
  set_up(&b);
  const ms_fused_step pass = everything(&b, b.vec[1]);
  const int32_t n = b.model.unknowns.nfree;
  for (int i = 0; i < 4; i++)
    for (int c = 0; c < 3; c++)
      for (int from = 2; from <= 4; from += 2) { /* v_from, x_from */
        double *at = b.vec[from] + c * b.model.unknowns.stride + (i % 2 ? n - 1 : n / 3 + i);
        const double good = *at;
        *at = bad[i];
        assert_false(ms_fused_step_run(&b.model, &pass));
        *at = good;
        assert_true(ms_fused_step_run(&b.model, &pass));
      }
  tear_down(&b);
}

static void threads_agree_to_the_bit(void **state) {
  (void)state;
  static const int32_t threads[] = {1, 2, 3, 7};
  bench b;
  set_up(&b);
  const ms_fused_step pass = everything(&b, NULL);
  const size_t n = 3 * (size_t)b.model.unknowns.stride * sizeof(double);
  double *first[4];
  for (int t = 0; t < 4; t++) {
    b.model.pool = ms_pool_create(&b.scene->data->alloc, threads[t]);
    ms_fused_step_run(&b.model, &pass);
    for (int i = 0; i < 4; i++) {
      if (t == 0) first[i] = memcpy(malloc(n), b.vec[5 + i], n);
      assert_memory_equal(first[i], b.vec[5 + i], n);
      memset(b.vec[5 + i], 0, (size_t)b.model.unknowns.nfree * sizeof(double));
    }
    ms_pool_destroy(b.model.pool);
  }
  for (int i = 0; i < 4; i++) free(first[i]);
  tear_down(&b);
}

/* Springs that a cache cannot hold are fetched from memory before they are used (simd.h). */
static void many_springs_have_the_same_forces(void **state) {
  (void)state;
  bench b;
  set_up(&b);
  const size_t n = 3 * (size_t)b.model.unknowns.stride * sizeof(double);
  ms_fused_step pass = everything(&b, NULL);
  for (int s = 0; s < 2 * NSETS; s++) {
    b.model.isa = ms_isa_find(sets[s / 2]);
    pass.v = s % 2 ? b.vec[1] : NULL; /* with damping, or without */
    if (b.model.isa < 0) continue;
    assert_true(ms_fused_step_run(&b.model, &pass));
    double *f = memcpy(malloc(n), b.vec[5], n);
    memset(b.vec[5], 0, n);
    const size_t nvalues = b.model.half_edges.nvalues;
    b.model.half_edges.nvalues = MS_CACHE; /* a fiction */
    assert_true(ms_fused_step_run(&b.model, &pass));
    b.model.half_edges.nvalues = nvalues;
    assert_memory_equal(f, b.vec[5], (size_t)b.model.unknowns.nfree * sizeof(double));
    free(f);
  }
  tear_down(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(forces_of_all_lengths),
                                     cmocka_unit_test(springs_at_rest_exert_no_force),
                                     cmocka_unit_test(results_are_the_formulas),
                                     cmocka_unit_test(bad_numbers_are_detected),
                                     cmocka_unit_test(threads_agree_to_the_bit),
                                     cmocka_unit_test(many_springs_have_the_same_forces)};
  return cmocka_run_group_tests_name("force_sweep", tests, NULL, NULL);
}
