/* Tests of force sweeps and vectors in single precision: forces against sums in long double within
 * a bound from rounding analysis, for every instruction set, kind of springs and number of
 * threads. */
#include <float.h>
#include <math.h>
#include <stdlib.h>

#include "base/simd.h"
#include "physics/fused_step.h"
#include "physics/single.h"
#include "scenes.h"

static const char *const sets[] = {"baseline", "avx2", "avx512"};
MS_TABLES(ms_single_force_kernels);
enum { NSETS = 3, N = 400, HUB = 7, SPRINGS = 4 * N, PINNED = 11 };

#define U (FLT_EPSILON / 2) /* the largest relative error of an operation */

/*------------------------------------- scenes ---------------------------------------------------*/

/* Random springs, of which one particle has a quarter, so that its row is split; planar, or not;
 * with rest lengths; damped */
typedef struct kind {
  int planar, rests, damped;
} kind;

static const kind kinds[] = {{0, 0, 0}, {0, 1, 0}, {0, 1, 1}, {1, 0, 0}, {1, 1, 0}, {1, 1, 1}};
enum { KINDS = sizeof kinds / sizeof *kinds };

typedef struct sweep_test {
  msim_scene *scene;
  ms_model model;
  double x[3 * N], v[3 * N];
  float *vec[6]; /* x, v, f, a, v_to, x_to: in memory for doubles, as those of a stepper */
} sweep_test;

static void make_scene(const kind *k, double shift, sweep_test *t) {
  double mass[N], force[3 * N];
  const double gravity[3] = {1, -9.81, k->planar ? 0 : 2};
  unsigned seed = 17;
  for (int i = 0; i < 3 * N; i++) {
    const int flat = k->planar && i % 3 == 2;
    t->x[i] = flat ? 0 : shift + uniform(&seed) / 3, t->v[i] = flat ? 0 : uniform(&seed) / 3 - 0.1;
    force[i] = flat ? 0 : uniform(&seed), mass[i / 3] = 0.1 + uniform(&seed);
  }
  t->v[3 * PINNED] = t->v[3 * PINNED + 1] = t->v[3 * PINNED + 2] = 0;
  assert_ok(msim_scene_create(NULL, &t->scene, err));
  assert_ok(msim_scene_add_particles(t->scene, N, t->x, NULL, mass, err));
  for (int e = 0; e < SPRINGS; e++) {
    const int i = e % 4 ? e / 4 : HUB, j = (int)((N - 1) * uniform(&seed));
    const int32_t ij[2] = {i, j == i ? N - 1 : j}, pin = PINNED;
    const double stiffness = 1 + 1e4 * uniform(&seed), rest = k->rests ? uniform(&seed) : 0,
                 damping = k->damped ? 10 * uniform(&seed) : 0;
    assert_ok(msim_scene_add_springs(t->scene, 1, ij, &stiffness, &rest, &damping, err));
    if (e == 0) assert_ok(msim_scene_pin(t->scene, 1, &pin, err));
  }
  assert_ok(msim_scene_set_gravity(t->scene, gravity, err));
  assert_ok(msim_scene_set_drag(t->scene, 0.3, err));
  assert_ok(msim_scene_set_forces(t->scene, force, err));
}

static void make_model(sweep_test *t) {
  const ms_scene *data = t->scene->data;
  assert_ok(ms_model_create(data, 0, &t->model, err));
  assert_ok(ms_single_create(&t->model, err));
  for (int i = 0; i < 6; i++) t->vec[i] = (float *)ms_unknowns_new_vector(data, &t->model.unknowns);
  ms_single_set_origin(&t->model, t->x);
  ms_single_gather_x(&t->model, t->x, t->vec[0]);
  ms_single_gather_v(&t->model, t->v, t->vec[1]);
}

static void set_up(const kind *k, double shift, sweep_test *t) {
  make_scene(k, shift, t);
  make_model(t);
  assert_int_equal(t->model.unknowns.dims, k->planar ? 2 : 3);
  assert_true(t->model.half_edges.nparts > 0);
}

/* Its neighbours are consecutive rows, most slices have equally many, and their number is odd. */
static void set_up_cloth(double damping, sweep_test *t) {
  enum { SIDE = 19 };
  unsigned seed = 5;
  msim_scene_view view = {.size = sizeof view};
  t->scene = hanging_cloth(SIDE, 1000, damping);
  msim_scene_get(t->scene, &view);
  for (int i = 0; i < 3 * SIDE * SIDE; i++)
    t->x[i] = view.x[i] + 0.01 * uniform(&seed), t->v[i] = uniform(&seed);
  make_model(t);
  assert_int_equal(t->model.half_edges.nslices % 2, 1);
}

static void tear_down(sweep_test *t) {
  for (int i = 0; i < 6; i++) ms_memory_free(&t->scene->data->alloc, t->vec[i]);
  ms_model_destroy(&t->model);
  msim_scene_destroy(t->scene);
}

static ms_fused_step everything(const sweep_test *t) {
  return (ms_fused_step){.x = t->vec[0],
                         .v = t->vec[1],
                         .f = t->vec[2],
                         .a = t->vec[3],
                         .v_to = t->vec[4],
                         .v_from = t->vec[1],
                         .h = 1e-3,
                         .x_to = t->vec[5],
                         .x_from = t->vec[0],
                         .drift = 1e-3};
}

/*------------------------------------- forces ---------------------------------------------------*/

/* Sums of one particle; scale: of the magnitudes that rounding errors are relative to */
typedef struct sum {
  long double f[3], scale;
  int terms;
} sum;

static void add_spring(const ms_scene *s, int e, const double *x, const double *v, sum *sums) {
  const int32_t *ij = s->ij + 2 * e;
  long double d[3], l2 = 0, rate = 0, speed2 = 0;
  for (int c = 0; c < 3; c++) {
    const long double dv = v[3 * ij[1] + c] - v[3 * ij[0] + c];
    d[c] = (long double)x[3 * ij[1] + c] - x[3 * ij[0] + c];
    l2 += d[c] * d[c], rate += d[c] * dv, speed2 += dv * dv;
  }
  const long double l = sqrtl(l2), pull = s->k[e] * (l - s->rest[e]) + s->damping[e] * rate / l;
  for (int end = 0; end < 2; end++) {
    sum *at = &sums[ij[end]];
    for (int c = 0; c < 3; c++) at->f[c] += (end ? -pull : pull) * d[c] / l;
    at->scale += s->k[e] * (l + s->rest[e]) + s->damping[e] * sqrtl(speed2);
    at->terms++;
  }
}

/* The forces at the positions and velocities that the vectors have after rounding. */
static void exact_forces(const sweep_test *t, sum *sums) {
  const ms_scene *s = t->scene->data;
  static double x[3 * N], v[3 * N];
  memset(sums, 0, N * sizeof *sums);
  memset(x, 0, sizeof x), memset(v, 0, sizeof v);
  ms_unknowns_scatter(&t->model.unknowns, ms_single_get_x(&t->model, t->vec[0]), x);
  ms_unknowns_scatter(&t->model.unknowns, ms_single_get_v(&t->model, t->vec[1]), v);
  for (int e = 0; e < s->nsprings; e++) add_spring(s, e, x, v, sums);
  for (int p = 0; p < N; p++)
    for (int c = 0; c < 3; c++) {
      const double drag = 0.3 * v[3 * p + c], weight = s->mass[p] * s->external.gravity[c],
                   own = s->force[3 * p + c];
      sums[p].f[c] += (long double)weight + own - drag;
      sums[p].scale += fabs(drag) + fabs(weight) + fabs(own);
    }
}

/* A spring: k and L are rounded, d, l, (l - L), 1/l, and products are, at most 12 times; then it is
 * added to the others of its row. */
static void check_forces(const sweep_test *t, const sum *sums) {
  const ms_unknowns *rows = &t->model.unknowns;
  for (int32_t r = 0; r < rows->nfree; r++) {
    const sum *want = &sums[rows->particle[r]];
    for (int32_t c = 0; c < rows->dims; c++) {
      const size_t at = (size_t)(c * rows->stride + r);
      const long double f = want->f[rows->axis[c]];
      const double off = fabs((double)(t->vec[2][at] - f));
      if (!(off <= U * (double)want->scale * (12 + want->terms)))
        fail_msg("row %d: the force %Lg is off by %g, scale %Lg", r, f, off, want->scale);
      assert_close(t->vec[3][at] * t->model.mass[r], t->vec[2][at], 4 * U * fabsf(t->vec[2][at]));
      const double v = t->vec[1][at] + 1e-3 * t->vec[3][at];
      assert_close(t->vec[4][at], v, 4 * U * (fabs(v) + 1));
      assert_close(t->vec[5][at], t->vec[0][at] + 1e-3 * t->vec[4][at], 4 * U);
    }
  }
}

static void forces_are_exact_up_to_rounding(void **state) {
  (void)state;
  static sum sums[N];
  for (int k = 0; k < KINDS; k++)
    for (int far = 0; far < 2; far++) {
      sweep_test t;
      set_up(&kinds[k], far ? 1000 : 0, &t);
      exact_forces(&t, sums);
      const ms_fused_step sweep = everything(&t);
      for (int i = 0; i < NSETS; i++) {
        t.model.isa = ms_isa_find(sets[i]);
        if (t.model.isa < 0) continue; /* not supported by this CPU */
        assert_true(ms_fused_step_run(&t.model, &sweep));
        check_forces(&t, sums);
      }
      tear_down(&t);
    }
}

/* Particles in the same place, and closer than the root of the least normal float: finite forces */
static void short_springs_are_finite(void **state) {
  (void)state;
  const double x[] = {0, 0, 0, 0, 0, 0, 1e-30, 0, 0}, mass[] = {1, 1, 1}, k[] = {1e3, 1e3},
               rest[] = {1, 0.5};
  const int32_t ij[] = {0, 1, 1, 2};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 3, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 2, ij, k, rest, NULL, err));
  msim_options opt = options("symplectic-euler", 1e-3);
  opt.precision = MSIM_PRECISION_SINGLE;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 1, err));
  const msim_state s = state_of(sim);
  for (int i = 0; i < 9; i++) assert_true(fabs(s.v[i]) < 10);
  assert_true(s.v[0] == 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void threads_agree(void **state) {
  (void)state;
  sweep_test t;
  set_up(&kinds[2], 0, &t);
  const ms_fused_step sweep = everything(&t);
  const size_t n = 3 * (size_t)t.model.unknowns.stride * sizeof(float);
  float *first = malloc(n);
  for (int32_t threads = 1; threads <= 3; threads++) {
    t.model.pool = ms_pool_create(&t.scene->data->alloc, threads);
    ms_fused_step_run(&t.model, &sweep);
    if (threads == 1) memcpy(first, t.vec[5], n);
    assert_memory_equal(first, t.vec[5], n);
    ms_pool_destroy(t.model.pool);
  }
  free(first);
  tear_down(&t);
}

/* AVX-512 computes two slices at once (slice_pair.h), unless springs are many (simd.h): the same
 * bits as one by one */
static void check_slices_alone(sweep_test *t, int isa) {
  const ms_fused_step sweep = everything(t);
  const ms_force_kernels *kernels = ms_single_force_kernels_of[isa];
  const int32_t slices = t->model.half_edges.nslices;
  const size_t n = 3 * (size_t)t->model.unknowns.stride * sizeof(float);
  float *together[6];
  t->model.isa = isa;
  assert_true(ms_fused_step_run(&t->model, &sweep));
  for (int i = 2; i < 6; i++) {
    together[i] = malloc(n);
    memcpy(together[i], t->vec[i], n);
    memset(t->vec[i], 0, n);
  }
  for (int32_t slice = 0; slice < slices; slice++) {
    assert_true(t->vec[5][MS_SLICE * slice] == 0); /* no slice has computed the next one */
    assert_true(kernels->slices(&t->model, &sweep, slice, slice + 1));
  }
  for (int i = 2; i < 6; i++) assert_memory_equal(together[i], t->vec[i], n);
  const size_t nvalues = t->model.half_edges.nvalues;
  t->model.half_edges.nvalues = MS_CACHE; /* a fiction */
  memset(t->vec[5], 0, n);
  assert_true(kernels->slices(&t->model, &sweep, 0, slices));
  t->model.half_edges.nvalues = nvalues;
  for (int i = 2; i < 6; i++) {
    assert_memory_equal(together[i], t->vec[i], n);
    free(together[i]);
  }
  for (int32_t row = 0; row < t->model.unknowns.nfree; row++) {
    const float before = t->vec[1][row];
    t->vec[1][row] = NAN;
    assert_false(kernels->slices(&t->model, &sweep, 0, slices));
    t->vec[1][row] = before;
  }
}

static void slices_agree_alone_and_together(void **state) {
  (void)state;
  for (int s = 0; s < NSETS; s++) {
    const int isa = ms_isa_find(sets[s]);
    for (int k = 0; k < KINDS + 2 && isa >= 0; k++) {
      sweep_test t;
      if (k < KINDS) set_up(&kinds[k], 0, &t);
      else set_up_cloth(0.1 * (k - KINDS), &t);
      check_slices_alone(&t, isa);
      tear_down(&t);
    }
  }
}

static void bad_numbers_are_detected(void **state) {
  (void)state;
  static const float bad[] = {NAN, INFINITY, -INFINITY, -2 * MS_LARGEST_VALID_SINGLE};
  sweep_test t;
  set_up(&kinds[1], 0, &t);
  ms_fused_step sweep = everything(&t);
  sweep.x_from = t.vec[3], sweep.v_from = t.vec[2], sweep.f = sweep.a = NULL;
  const ms_unknowns *rows = &t.model.unknowns;
  for (int i = 0; i < 4; i++)
    for (int c = 0; c < 3; c++)
      for (int from = 2; from < 4; from++) {
        const int32_t row = i % 2 ? rows->nfree - 1 : rows->nfree / 3 + i;
        float *at = t.vec[from] + c * rows->stride + row;
        const float good = *at;
        *at = bad[i];
        assert_false(ms_fused_step_run(&t.model, &sweep));
        assert_int_equal(ms_vector_find_invalid(t.model.state_shape, t.vec[from]), row);
        *at = good;
        assert_true(ms_fused_step_run(&t.model, &sweep));
        assert_int_equal(ms_vector_find_invalid(t.model.state_shape, t.vec[from]), -1);
        float *error = at + rows->dims * rows->stride; /* of a sum, as read from a checkpoint */
        *error = bad[i];
        assert_int_equal(ms_vector_find_invalid(t.model.state_shape, t.vec[from]), row);
        *error = 0;
      }
  tear_down(&t);
}

/* Pairs of floats have twice as many bits as floats, and padding is 0. */
static void states_become_pairs_of_floats(void **state) {
  (void)state;
  sweep_test t;
  set_up(&kinds[1], 1000, &t);
  const ms_unknowns *rows = &t.model.unknowns;
  const double *x = ms_single_get_x(&t.model, t.vec[0]), *v = ms_single_get_v(&t.model, t.vec[1]);
  for (int32_t c = 0; c < rows->dims; c++)
    for (int32_t r = 0; r < rows->stride; r++) {
      const size_t at = (size_t)(c * rows->stride + r);
      const int32_t p = rows->particle[r];
      if (p < 0) assert_true(t.vec[0][at] == 0 && t.vec[1][at] == 0);
      if (p < 0) continue;
      assert_close(x[at], t.x[3 * p + c], U * U + 1000 * DBL_EPSILON);
      assert_close(v[at], t.v[3 * p + c], U * U);
    }
  tear_down(&t);
}

/* x' = x + h v and v' = v + h a, 1e5 times: each sum is off by less than a float, as errors of
 * earlier sums are not lost. What is missing in one float after a step is in the other. */
static void sums_do_not_drift(void **state) {
  (void)state;
  enum { STEPS = 100000 };
  const double x = 0.5, v[3] = {1 / 3., 7, 0}, from[3] = {x, x, x}, h = 1e-5;
  msim_scene *scene = make_single_particle(from, v, 9.81);
  ms_model model;
  assert_ok(ms_model_create(scene->data, MSIM_SKIP_TWO_D, &model, err));
  assert_ok(ms_single_create(&model, err));
  float *vec[3]; /* x, v, x of the loops of vector.h */
  for (int i = 0; i < 3; i++)
    vec[i] = (float *)ms_unknowns_new_vector(scene->data, &model.unknowns);
  const double factor = (float)h, step = (double)(float)9.81 * factor;
  ms_single_gather_x(&model, from, vec[0]);
  ms_single_gather_x(&model, from, vec[2]);
  ms_single_gather_v(&model, v, vec[1]);
  double sum_x = x, sum_v = 0;
  for (int i = 0; i < STEPS; i++) {
    const ms_fused_step sweep = {.x = vec[0],
                                 .v_to = vec[1],
                                 .v_from = vec[1],
                                 .h = h,
                                 .x_to = vec[0],
                                 .x_from = vec[0],
                                 .drift = h};
    assert_true(ms_fused_step_run(&model, &sweep));
    ms_vector_add_scaled(model.state_shape, vec[2], h, vec[1], vec[2]);
    sum_v -= step, sum_x += factor * sum_v;
  }
  const size_t z = 2 * (size_t)model.unknowns.stride;
  assert_close(ms_single_get_v(&model, vec[1])[z], sum_v, 8 * U * fabs(sum_v));
  assert_close(ms_single_get_x(&model, vec[0])[z], sum_x, 8 * U * fabs(sum_x));
  assert_close(ms_single_get_x(&model, vec[2])[z], sum_x, 8 * U * fabs(sum_x));
  for (int i = 0; i < 3; i++) ms_memory_free(&scene->data->alloc, vec[i]);
  ms_model_destroy(&model);
  msim_scene_destroy(scene);
}

/*------------------------------------- vectors --------------------------------------------------*/

/* Each operation on floats is that on doubles, rounded; rows from n to stride stay. Behind the
 * floats, in as many numbers, vectors have the errors of sums. */
static void vectors_of_floats_follow_the_formulas(void **state) {
  (void)state;
  enum { ROWS = 21, STRIDE = 24, SIZE = 3 * STRIDE };
  const ms_shape shape = {ROWS, STRIDE, 3, 0, 1, NULL};
  static float x[2 * SIZE], y[2 * SIZE], z[2 * SIZE], f[2 * SIZE], to[8][2 * SIZE];
  double dot = 0;
  unsigned seed = 3;
  for (int i = 0; i < SIZE; i++) {
    x[i] = (float)uniform(&seed), y[i] = (float)uniform(&seed), z[i] = (float)uniform(&seed);
    f[i] = (float)uniform(&seed);
    if (i % STRIDE < ROWS) dot += (double)x[i] * (double)y[i];
    for (int k = 0; k < 8; k++) to[k][i] = k == 1 ? y[i] : k == 2 ? x[i] : -1;
  }
  ms_vector_copy(shape, x, to[0]);
  ms_vector_axpy(shape, 0.3, x, to[1]);
  ms_vector_scale(shape, 0.7, to[2]);
  ms_vector_add_scaled(shape, x, -0.2, y, to[3]);
  ms_vector_add_two_scaled(shape, x, 0.4, y, -0.6, z, to[4]);
  ms_vector_three_term(shape, x, 0.4, y, -0.6, z, 0.1, f, to[5]);
  for (int i = 0; i < SIZE; i++) {
    const double want[] = {x[i],
                           y[i] + 0.3 * x[i],
                           0.7 * x[i],
                           x[i] - 0.2 * y[i],
                           x[i] + 0.4 * y[i] - 0.6 * z[i],
                           x[i] + 0.4 * (y[i] - x[i]) - 0.6 * (z[i] - x[i]) + 0.1 * f[i]};
    const float before[] = {-1, y[i], x[i], -1, -1, -1};
    for (int k = 0; k < 6; k++) {
      if (i % STRIDE < ROWS) assert_close(to[k][i], want[k], 8 * U);
      else assert_true(to[k][i] == before[k]);
    }
  }
  assert_close(ms_vector_dot(shape, x, y), dot, 1e-13);
  assert_true(ms_vector_is_equal(shape, x, to[0]) && !ms_vector_is_equal(shape, x, y));
  ms_vector_copy_all(shape, x, to[6]);
  assert_memory_equal(to[6], x, sizeof x);
  ms_vector_clear_all(shape, to[6]);
  assert_true(ms_vector_is_zero(shape, to[6]));
  for (int i = 0; i < SIZE; i++) {
    to[6][i] = FLT_TRUE_MIN;
    assert_true(ms_vector_is_zero(shape, to[6]) == (i % STRIDE >= ROWS));
    to[6][i] = 0;
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(forces_are_exact_up_to_rounding),
                                     cmocka_unit_test(short_springs_are_finite),
                                     cmocka_unit_test(threads_agree),
                                     cmocka_unit_test(slices_agree_alone_and_together),
                                     cmocka_unit_test(bad_numbers_are_detected),
                                     cmocka_unit_test(states_become_pairs_of_floats),
                                     cmocka_unit_test(sums_do_not_drift),
                                     cmocka_unit_test(vectors_of_floats_follow_the_formulas)};
  return cmocka_run_group_tests_name("single", tests, NULL, NULL);
}
