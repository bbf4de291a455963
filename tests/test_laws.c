/* Tests of the laws of springs: forces, matrices and energies against formulas written out and
 * against differences of each other. */
#include "laws.h"

#include "physics/energy.h"
#include "physics/law.h"
#include "physics/law_springs.h"
#include "physics/nonlinearity.h"
#include "physics/reference.h"
#include "physics/totals.h"

enum { N = 40, M = 300 };

typedef struct fixture {
  msim_scene *scene;
  ms_model model;
  double *x; /* a vector */
} fixture;

static fixture make_fixture(int32_t n, int32_t m, int planar, unsigned seed) {
  fixture f = {.scene = law_net(n, m, planar, 0.2, seed)};
  assert_ok(ms_model_create(f.scene->data, 0, &f.model, err));
  assert_int_equal(f.model.unknowns.dims, planar ? 2 : 3);
  f.x = ms_unknowns_new_vector(f.scene->data, &f.model.unknowns);
  ms_unknowns_gather(&f.model.unknowns, f.scene->data->x, f.x);
  return f;
}

static void free_fixture(fixture *f) {
  ms_memory_free(&f->scene->data->alloc, f->x);
  ms_model_destroy(&f->model);
  msim_scene_destroy(f->scene);
}

static double *new_vector(const fixture *f) {
  return ms_unknowns_new_vector(f->scene->data, &f->model.unknowns);
}

static void free_vector(const fixture *f, double *v) { ms_memory_free(&f->scene->data->alloc, v); }

/*------------------------------------- values ---------------------------------------------------*/

static double spring_length(const ms_scene *s, int32_t e, const double *x) {
  const double *a = x + 3 * s->ij[2 * e], *b = x + 3 * s->ij[2 * e + 1];
  return sqrt((b[0] - a[0]) * (b[0] - a[0]) + (b[1] - a[1]) * (b[1] - a[1]) +
              (b[2] - a[2]) * (b[2] - a[2]));
}

static void values_are_the_formulas(void **state) {
  (void)state;
  msim_scene *scene = law_net(10, 7, 0, 0, 3);
  const ms_scene *s = scene->data;
  for (int32_t e = 0; e < 7; e++)
    for (double l = 0.001; l < 2; l += 0.0137) {
      const double h = 1e-6, rest = s->rest[e], k = s->k[e];
      const ms_law_value at = ms_law_value_of(s, e, l), more = ms_law_value_of(s, e, l + h),
                         less = ms_law_value_of(s, e, l - h);
      assert_close(at.force, law_value(e, k, l - rest), 1e-12 * (1 + fabs(at.force)));
      if (fabs(more.slope - less.slope) > 1e-2) continue; /* at a kink */
      assert_close(at.slope, (more.force - less.force) / (2 * h), 1e-6 * (1 + k));
      assert_close(at.force, (more.energy - less.energy) / (2 * h), 1e-7 * (1 + k));
      assert_true(fabs(at.slope) <= ms_scene_stiffness(s, e) * (1 + 1e-12));
      assert_true(at.energy >= -ms_scene_energy_depth(s, e) - 1e-12);
    }
  for (int32_t e = 0; e < 7; e++) assert_close(ms_law_value_of(s, e, s->rest[e]).energy, 0, 1e-14);
  msim_scene_destroy(scene);
}

/* A linear table is linear; one of a monotone force has a force of the same monotony. */
static void tables_are_monotone(void **state) {
  (void)state;
  unsigned seed = 5;
  for (int round = 0; round < 50; round++) {
    double x[12] = {-1}, f[12] = {-2};
    for (int i = 1; i < 12; i++) {
      x[i] = x[i - 1] + 0.01 + uniform(&seed);
      f[i] = round ? f[i - 1] + (i % 3 ? uniform(&seed) * uniform(&seed) : 0) : -2 + 3 * (x[i] + 1);
    }
    const msim_law law = {
        .size = sizeof law, .kind = MSIM_LAW_TABLE, .n = 12, .stretch = x, .force = f};
    msim_scene *scene = law_net(4, 1, 0, 0, 1);
    assert_ok(msim_scene_add_law(scene, &law, NULL, err));
    assert_ok(msim_scene_set_law(scene, 1, &(int32_t){0}, LAW_KINDS + 1, err));
    double last = -INFINITY;
    for (double e = -2; e < x[11] + 1; e += 0.003) {
      const ms_law_value at = ms_law_value_of(scene->data, 0, scene->data->rest[0] + e);
      assert_true(at.slope >= -1e-13 && at.force >= last - 1e-13);
      if (!round) assert_close(at.force, -2 + 3 * (e + 1), 1e-12);
      last = at.force;
    }
    for (int i = 0; i < 12; i++)
      assert_close(ms_law_value_of(scene->data, 0, scene->data->rest[0] + x[i]).force, f[i], 1e-12);
    msim_scene_destroy(scene);
  }
}

/* Near rest force and energy of a table are relative to e, as Newton's method needs it. slope: that
 * of the parabola through the three points around e = 0. */
static void check_table_at_rest(int32_t n, const double *x, const double *f, double slope) {
  const msim_law is = {.size = sizeof is, .kind = MSIM_LAW_TABLE, .n = n, .stretch = x, .force = f};
  ms_law law;
  ms_law_batch at = {.only_force = 0};
  const msim_allocator alloc = ms_memory_allocator(NULL);
  assert_true(ms_laws_prepare(&alloc, &is, &law));
  for (int i = 0; i < 40; i++) {
    const double e = x[n - 1] * pow(10, -i / 2.) * (i % 2 ? 1 : -1);
    at.stretch[0] = e;
    ms_law_evaluate(&law, 1, NULL, NULL, &at);
    if (i > 20) assert_close(at.force[0], slope * e, 1e-9 * fabs(slope * e));
    if (i > 2) assert_close(at.energy[0], 0.5 * at.force[0] * e, 0.1 * at.force[0] * e);
  }
  ms_laws_free_one(&alloc, &law);
}

static void tables_do_not_cancel_at_rest(void **state) {
  (void)state;
  check_table_at_rest(3, (double[]){-0.1, 0, 0.1}, (double[]){-10, 0, 5}, 75);
  check_table_at_rest(5, (double[]){-0.1, -0.02, 0, 0.03, 0.1}, (double[]){-30, -2, 0, 5, 6},
                      380. / 3);
}

/*------------------------------------- forces ---------------------------------------------------*/

/* f of each particle, by the formulas of laws.h, and its constant force */
static void written_force(const ms_scene *s, double *f) {
  for (int32_t e = 0; e < s->nsprings; e++) {
    const int32_t i = s->ij[2 * e], j = s->ij[2 * e + 1];
    const double l = spring_length(s, e, s->x);
    const double pull = law_value(s->law[e], s->k[e], l - s->rest[e]) / l;
    for (int c = 0; c < 3; c++) {
      const double d = s->x[3 * j + c] - s->x[3 * i + c];
      f[3 * i + c] += pull * d, f[3 * j + c] -= pull * d;
    }
  }
  for (int32_t i = 0; i < 3 * s->nparticles && s->force; i++) f[i] += s->force[i];
  for (int c = 0; c < 3; c++) f[c] = 0; /* pinned */
}

static void forces_of_random_nets(void **state) {
  (void)state;
  for (unsigned seed = 1; seed <= 100; seed++) {
    /* beyond 64 springs for each law; a hub, whose row is split, in every fourth */
    const int32_t n = seed % 4 ? N : 3, m = seed % 4 ? 3 * M : 9 * M;
    fixture f = make_fixture(n, m, seed % 2, seed);
    double *force = new_vector(&f), got[3 * N] = {0}, want[3 * N] = {0}, plain[3 * N] = {0};
    const double zero[3 * N] = {0};
    double largest = 1;
    for (int again = 0; again < 2; again++) ms_force_compute(&f.model, f.x, NULL, force);
    ms_unknowns_scatter(&f.model.unknowns, force, got);
    written_force(f.scene->data, want);
    ms_reference_compute_force(f.scene->data, f.scene->data->x, zero, plain);
    for (int i = 0; i < 3 * n; i++) largest = fmax(largest, fabs(want[i]));
    for (int i = 3; i < 3 * n; i++) {
      assert_close(got[i], want[i], 1e-11 * largest);
      assert_close(plain[i], want[i], 1e-11 * largest);
    }
    free_vector(&f, force);
    free_fixture(&f);
  }
}

/* With few laws most rows have no such spring, many one, some several; with and without constant
 * forces, which must not add up from sweep to sweep. */
static void few_springs_have_a_law(void **state) {
  (void)state;
  for (unsigned seed = 1; seed <= 60; seed++) {
    unsigned random = seed;
    const int32_t n = N, hub = seed % 3 == 0; /* a split row */
    msim_scene *scene = law_net(hub ? 6 : n, M, seed % 2, 0, seed);
    ms_scene *s = scene->data;
    double force[3 * N] = {0}, got[3 * N] = {0}, want[3 * N] = {0}, largest = 1;
    for (int32_t e = 0; e < M; e++)
      if (e % (hub ? 100 : 17) || seed == 1)
        assert_ok(msim_scene_set_law(scene, 1, &e, e == 20 ? 5 : 0, err));
    for (int i = 0; i < 3 * n; i++) force[i] = seed % 2 && i % 3 == 1 ? 0 : uniform(&random);
    if (seed % 4 >= 2) assert_ok(msim_scene_set_forces(scene, force, err));
    ms_model model;
    assert_ok(ms_model_create(s, 0, &model, err));
    double *x = ms_unknowns_new_vector(s, &model.unknowns),
           *f = ms_unknowns_new_vector(s, &model.unknowns);
    ms_unknowns_gather(&model.unknowns, s->x, x);
    for (int again = 0; again < 3; again++) ms_force_compute(&model, x, NULL, f);
    ms_unknowns_scatter(&model.unknowns, f, got);
    written_force(s, want);
    for (int i = 0; i < 3 * s->nparticles; i++) largest = fmax(largest, fabs(want[i]));
    for (int i = 3; i < 3 * s->nparticles; i++) assert_close(got[i], want[i], 1e-13 * largest);
    ms_memory_free(&s->alloc, x), ms_memory_free(&s->alloc, f);
    ms_model_destroy(&model);
    msim_scene_destroy(scene);
  }
}

/* Free particles alone: the sum of forces is rounding error. */
static void momentum_is_conserved(void **state) {
  (void)state;
  msim_scene *scene = law_net(N, M, 0, 0.3, 8);
  ms_scene *s = scene->data;
  s->pinned[0] = 0;
  ms_model model;
  assert_ok(ms_model_create(s, 0, &model, err));
  double *x = ms_unknowns_new_vector(s, &model.unknowns),
         *f = ms_unknowns_new_vector(s, &model.unknowns), sum[3] = {0};
  ms_unknowns_gather(&model.unknowns, s->x, x);
  ms_force_compute(&model, x, x, f);
  for (int32_t r = 0; r < N; r++)
    for (int c = 0; c < 3; c++) sum[c] += f[c * model.unknowns.stride + r];
  for (int c = 0; c < 3; c++) assert_close(sum[c], 0, 1e-11);
  ms_memory_free(&s->alloc, x), ms_memory_free(&s->alloc, f);
  ms_model_destroy(&model);
  msim_scene_destroy(scene);
}

/*------------------------------------- matrix ---------------------------------------------------*/

/* A net whose forces are smooth. softens 0: only springs with df/de >= f/l have a law; 1: all. */
static msim_scene *smooth_net(int planar, int softens) {
  msim_scene *scene = law_net(planar ? N : 5, M, planar, 0, 12);
  for (int32_t e = 0; e < M; e++) {
    const int32_t law = e % (LAW_KINDS + 1);
    if (law >= 1 && law <= 3) assert_ok(msim_scene_set_law(scene, 1, &e, 4, err));
    const double l = spring_length(scene->data, e, scene->data->x);
    const ms_law_value at = ms_law_value_of(scene->data, e, l);
    if (at.slope < at.force / l && !softens) assert_ok(msim_scene_set_law(scene, 1, &e, 0, err));
  }
  return scene;
}

/* y = (A - M) p, z = -h^2 J p by differences of forces; without damping */
static void multiply(const fixture *f, double h, const double *p, double *y, double *z) {
  const double d = 1e-6;
  const ms_unknowns *rows = &f->model.unknowns;
  double *at = new_vector(f), *more = new_vector(f);
  ms_coefficients a;
  assert_ok(ms_coefficients_create(&f->model, &a, err));
  assert_int_equal(a.block, rows->dims);
  ms_coefficients_compute(&f->model, f->x, h, 0, &a);
  ms_coefficients_apply_massless(&f->model, &a, p, y);
  for (int sign = -1; sign <= 1; sign += 2) {
    ms_vector_copy_all(f->model.shape, f->x, at);
    ms_vector_axpy(f->model.shape, sign * d, p, at);
    ms_force_compute(&f->model, at, NULL, more);
    ms_vector_axpy(f->model.shape, -sign * h * h / (2 * d), more, z);
  }
  ms_coefficients_destroy(&f->model, &a);
  free_vector(f, at), free_vector(f, more);
}

static void random_vector(const fixture *f, double *p) {
  unsigned seed = 3;
  for (int32_t c = 0; c < f->model.unknowns.dims; c++)
    for (int32_t r = 0; r < f->model.unknowns.nfree; r++)
      p[c * f->model.unknowns.stride + r] = uniform(&seed) - 0.5;
}

static void matrix_is_the_derivative(void **state) {
  (void)state;
  for (int planar = 0; planar < 2; planar++)
    for (int softens = 0; softens < 2; softens++) {
      fixture f = {.scene = smooth_net(planar, softens)};
      assert_ok(ms_model_create(f.scene->data, 0, &f.model, err));
      f.x = new_vector(&f);
      ms_unknowns_gather(&f.model.unknowns, f.scene->data->x, f.x);
      double *p = new_vector(&f), *y = new_vector(&f), *z = new_vector(&f);
      random_vector(&f, p);
      multiply(&f, 0.1, p, y, z);
      double most = 0;
      for (int32_t c = 0; c < f.model.unknowns.dims; c++)
        for (int32_t r = 0; r < f.model.unknowns.nfree; r++) {
          const int32_t at = c * f.model.unknowns.stride + r;
          most = fmax(most, fabs(y[at] - z[at]));
        }
      if (!softens) assert_close(most, 0, 1e-6);
      else /* a majorant */
        assert_true(ms_vector_dot(f.model.shape, p, y) > ms_vector_dot(f.model.shape, p, z) &&
                    most > 1e-3);
      free_vector(&f, p), free_vector(&f, y), free_vector(&f, z);
      free_fixture(&f);
    }
}

/* p.(A - M) p >= 0 for the clamped matrix, and < 0 for some p of the exact one. */
static void clamped_matrix_is_positive(void **state) {
  (void)state;
  fixture f = make_fixture(N, M, 0, 4);
  double *p = new_vector(&f), *y = new_vector(&f);
  unsigned seed = 9;
  int indefinite = 0;
  ms_coefficients a;
  assert_ok(ms_coefficients_create(&f.model, &a, err));
  for (int round = 0; round < 200; round++) {
    const int clamp = round % 2;
    const int32_t row = round / 2 % f.model.unknowns.nfree;
    memset(p, 0, 3 * (size_t)f.model.unknowns.stride * sizeof *p);
    for (int c = 0; c < 3; c++) p[c * f.model.unknowns.stride + row] = uniform(&seed) - 0.5;
    ms_coefficients_compute(&f.model, f.x, 1, clamp, &a);
    ms_coefficients_apply_massless(&f.model, &a, p, y);
    const double square = ms_vector_dot(f.model.shape, p, y);
    if (clamp) assert_true(square >= -1e-10);
    else indefinite |= square < 0;
  }
  assert_true(indefinite);
  ms_coefficients_destroy(&f.model, &a);
  free_vector(&f, p), free_vector(&f, y);
  free_fixture(&f);
}

/* Where both ends are at one point there is no force, and the matrix has the slope there. */
static void coincident_ends_have_a_slope(void **state) {
  (void)state;
  const double x[6] = {0}, mass[2] = {1, 1}, k = 10, rest = 0.5;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  add_laws(scene);
  assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, (int32_t[]){0, 1}, &k, &rest, NULL, err));
  assert_ok(msim_scene_set_law(scene, 1, &(int32_t){0}, MSIM_LAW_CALLBACK, err));
  ms_model model;
  assert_ok(ms_model_create(scene->data, MSIM_SKIP_TWO_D, &model, err));
  double *at = ms_unknowns_new_vector(scene->data, &model.unknowns),
         *f = ms_unknowns_new_vector(scene->data, &model.unknowns);
  ms_force_compute(&model, at, NULL, f);
  for (int c = 0; c < 3; c++) assert_true(f[c * model.unknowns.stride] == 0);
  ms_coefficients a;
  assert_ok(ms_coefficients_create(&model, &a, err));
  ms_coefficients_compute(&model, at, 0.1, 0, &a);
  for (int c = 0; c < 3; c++)
    assert_close(a.diagonal[c * model.unknowns.first_pinned], 1 + 0.01 * 10 * cosh(0.5), 1e-14);
  ms_coefficients_destroy(&model, &a);
  ms_memory_free(&scene->data->alloc, at), ms_memory_free(&scene->data->alloc, f);
  ms_model_destroy(&model);
  msim_scene_destroy(scene);
}

/*------------------------------------- energies -------------------------------------------------*/

static void totals_are_the_sum_of_energies(void **state) {
  (void)state;
  fixture f = make_fixture(N, M, 0, 6);
  double *v = new_vector(&f), zero[3 * N] = {0}, written = 0;
  ms_totals *parts = calloc((size_t)ms_totals_count_parts(&f.model), sizeof *parts);
  const ms_totals t = ms_totals_compute(&f.model, f.x, v, parts);
  msim_energy e = {.size = sizeof e};
  ms_energy_compute(f.scene->data, f.scene->data->x, zero, &e);
  const ms_scene *s = f.scene->data;
  for (int32_t i = 0; i < M; i++) { /* Simpson's rule for the integral of the force */
    const double l = spring_length(s, i, s->x), h = (l - s->rest[i]) / 2000;
    for (int p = 0; p <= 2000; p++)
      written += h / 3 *
                 (p == 0 || p == 2000 ? 1
                  : p % 2             ? 4
                                      : 2) *
                 law_value(i % (LAW_KINDS + 1), s->k[i], p * h);
  }
  assert_close(t.elastic, e.elastic, 1e-11 * e.elastic);
  assert_close(t.elastic, written, 1e-6 * written);
  free(parts);
  free_vector(&f, v);
  free_fixture(&f);
}

/* Large steps: against energies; small ones: against the quadratic form of the exact matrix. */
static void nonlinearity_is_the_rest_of_the_energy(void **state) {
  (void)state;
  fixture f = make_fixture(N, M, 0, 15);
  msim_scene *scene = f.scene;
  double *d = new_vector(&f), *y = new_vector(&f), *z = new_vector(&f), *work = new_vector(&f);
  unsigned seed = 21;
  for (int c = 0; c < 3; c++)
    for (int32_t r = 0; r < f.model.unknowns.nfree; r++)
      d[c * f.model.unknowns.stride + r] = uniform(&seed) - 0.5;
  ms_coefficients a;
  assert_ok(ms_coefficients_create(&f.model, &a, err));
  ms_coefficients_compute(&f.model, f.x, 1, 0, &a);
  for (int32_t e = 0; e < f.model.half_edges.nentries * MS_SLICE; e++)
    if (f.model.half_edges.damping[ms_half_edges_value(&f.model.half_edges, e)] > 0)
      assert_true(a.g[e] != 0);
  for (double s = 1e-7; s < 1; s *= 10) {
    const double got = ms_nonlinearity_compute(&f.model, f.x, s, d, 1, work);
    msim_energy before = {.size = sizeof before}, after = before;
    double x[3 * N], zero[3 * N] = {0};
    memcpy(x, scene->data->x, sizeof x);
    ms_energy_compute(scene->data, x, zero, &before);
    ms_vector_add_scaled(f.model.shape, f.x, s, d, z);
    ms_unknowns_scatter(&f.model.unknowns, z, x);
    for (int c = 0; c < 3; c++) x[c] = scene->data->x[c];
    ms_energy_compute(scene->data, x, zero, &after);
    ms_force_compute(&f.model, f.x, NULL, y);
    const double want = after.elastic - before.elastic + s * ms_vector_dot(f.model.shape, y, d);
    assert_close(got, want, 1e-9 * fabs(want) + 1e-12 * before.elastic);
    if (s <= 1e-5) { /* damping off: its part of the matrix is not elastic */
      const double c2 = got / (s * s);
      assert_true(c2 > 0 && c2 < 1e5);
      static double first;
      if (s == 1e-7) first = c2;
      assert_close(c2, first, 2e-4 * first);
    }
  }
  ms_coefficients_destroy(&f.model, &a);
  double *all[] = {d, y, z, work};
  for (int i = 0; i < 4; i++) free_vector(&f, all[i]);
  free_fixture(&f);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(values_are_the_formulas),
      cmocka_unit_test(tables_are_monotone),
      cmocka_unit_test(tables_do_not_cancel_at_rest),
      cmocka_unit_test(forces_of_random_nets),
      cmocka_unit_test(few_springs_have_a_law),
      cmocka_unit_test(momentum_is_conserved),
      cmocka_unit_test(matrix_is_the_derivative),
      cmocka_unit_test(clamped_matrix_is_positive),
      cmocka_unit_test(coincident_ends_have_a_slope),
      cmocka_unit_test(totals_are_the_sum_of_energies),
      cmocka_unit_test(nonlinearity_is_the_rest_of_the_energy),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
