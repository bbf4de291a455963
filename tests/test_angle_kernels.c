/* Tests of the vectorized loops over angular springs: against the formulas of one, which
 * test_angles checks, in meshes of every order, and the same bits with every instruction set. */
#include "angle_scenes.h"

#include "base/isa.h"
#include "physics/angle_springs.h"
#include "physics/reference.h"

/*------------------------------------- one angle ------------------------------------------------*/

/* Three particles, and the model of their angular spring */
typedef struct trio {
  msim_scene *scene;
  ms_model model;
  double *x, *v, *f;
} trio;

static trio make_trio(const double x[9], const double v[9], double rest, double damping) {
  const double mass[3] = {1, 1, 1}, k = 2;
  trio t;
  assert_ok(msim_scene_create(NULL, &t.scene, err));
  assert_ok(msim_scene_add_particles(t.scene, 3, x, v, mass, err));
  assert_ok(msim_scene_add_angles(t.scene, 1, (int32_t[]){0, 1, 2}, &k, &rest, &damping, err));
  assert_ok(ms_model_create(t.scene->data, 0, &t.model, err));
  assert_true(MS_NEW_VECTORS(t.scene->data, &t.model.unknowns, &t.x, &t.v, &t.f));
  ms_unknowns_gather(&t.model.unknowns, x, t.x);
  ms_unknowns_gather(&t.model.unknowns, v, t.v);
  return t;
}

static void free_trio(trio *t) {
  MS_FREE(&t->scene->data->alloc, t->x, t->v, t->f);
  ms_model_destroy(&t->model);
  msim_scene_destroy(t->scene);
}

/* The forces of the kernels, and those of the formulas of one angle */
static void find_both(const double x[9], const double v[9], double rest, double damping,
                      double f[9], double g[9]) {
  trio t = make_trio(x, v, rest, damping);
  memset(f, 0, 9 * sizeof *f), memset(g, 0, 9 * sizeof *g);
  ms_force_compute(&t.model, t.x, damping > 0 ? t.v : NULL, t.f);
  ms_unknowns_scatter(&t.model.unknowns, t.f, f);
  ms_reference_compute_force(t.scene->data, x, v, g);
  free_trio(&t);
}

/* Errors are those of rounding phi, of a unit in the last place of the larger of phi and bend, and
 * of the components of the torque. */
static void assert_same_forces(const double x[9], const double v[9], double rest, double damping) {
  double f[9], g[9], largest = 0;
  find_both(x, v, rest, damping, f, g);
  for (int i = 0; i < 9; i++) largest = fmax(largest, fabs(g[i]));
  for (int i = 0; i < 9; i++) assert_close(f[i], g[i], 2e-15 * (largest + 20));
}

/* Turned by every phi from almost straight to almost folded, with edges of unequal lengths, about
 * a skew axis or in a plane; rest lengths 1 and 0.4 make forces of the order of 2 phi. */
static void forces_are_those_of_one_angle(void **state) {
  (void)state;
  for (int planar = 0; planar < 2; planar++)
    for (int i = 0; i <= 400; i++) {
      const double phi =
          i <= 200 ? pow(10, -0.08 * (200 - i)) * 1.6 : PI - pow(10, -0.08 * (i - 200));
      const double c = cos(phi), s = sin(phi), tilt = planar ? 0 : 0.7;
      const double x[9] = {-1, 0, 0, 0, 0, 0, 0.4 * c, 0.4 * s * cos(tilt), 0.4 * s * sin(tilt)};
      const double v[9] = {0.3, -0.4, planar ? 0 : 0.5, 0, 0.2, 0, -0.7, 0.1, planar ? 0 : 0.2};
      for (int damped = 0; damped < 2; damped++) {
        if (damped && !planar && (phi < 1e-7 || phi > PI - 1e-7)) continue; /* u.w/|w|^2 */
        assert_same_forces(x, v, PI, damped ? 0.3 : 0);
        assert_same_forces(x, v, 2.1, damped ? 0.3 : 0);
      }
    }
}

/* Small deviations of straight edges have forces of small relative errors. */
static void small_deviations_are_accurate(void **state) {
  (void)state;
  for (int i = 1; i < 38; i++) {
    const double s = pow(10, -i / 2.), x[9] = {-1, s, 0, 0, 0, 0, 1, s, 0}, v[9] = {0};
    double f[9], g[9];
    find_both(x, v, PI, 0, f, g);
    for (int c = 0; c < 9; c++)
      if (c % 3 == 1) assert_close(f[c], g[c], 1e-14 * fabs(g[c]));
    assert_true(g[1] != 0);
  }
}

/* Exactly straight and folded edges of any bend, at rest and moving in any direction; edges without
 * length */
static void limits_are_those_of_one_angle(void **state) {
  (void)state;
  const double v[9] = {0.3, -0.4, 0.5, 0, 0.2, 0, -0.7, 0.1, 0.2};
  const double flat[9] = {0.3, -0.4, 0, 0, 0.2, 0, -0.7, 0.1, 0}, rest[3] = {PI, 0, 1};
  for (int i = 0; i < 3; i++)
    for (int damped = 0; damped < 2; damped++)
      for (int side = -1; side <= 1; side++) {
        const double x[9] = {-1, 0, 0, 0, 0, 0, 0.4 * side, 0, 0};
        assert_same_forces(x, damped ? v : flat, rest[i], damped ? 0.3 : 0);
        assert_same_forces(x, flat, rest[i], damped ? 0.3 : 0);
      }
  const double nowhere[9] = {0}, line[9] = {0, 0, 0, 0, 0, 0, 1, 0, 0};
  double f[9], g[9];
  for (int i = 0; i < 2; i++) {
    find_both(i ? line : nowhere, v, 1, 0.3, f, g);
    for (int c = 0; c < 9; c++) assert_true(f[c] == 0 && g[c] == 0);
  }
}

/*------------------------------------- meshes ---------------------------------------------------*/

enum { ROWS = 9, COLUMNS = 100, PARTICLES = ROWS * COLUMNS };

/* A cloth with angular springs along rows and columns, wrinkled in space or within a plane.
 * order 0: as built; 1: with the angles in random order; 2: with random angles; 3: all at one
 * vertex */
static msim_scene *make_mesh(int order, int planar, double damping) {
  unsigned seed = (unsigned)order + 3;
  msim_scene *scene;
  double x[3 * PARTICLES], mass[PARTICLES];
  int32_t ijk[6 * PARTICLES], n = 0;
  for (int32_t p = 0; p < PARTICLES; p++) {
    const double along = p / COLUMNS * 0.1, across = p % COLUMNS * 0.1;
    x[3 * p] = along + 0.01 * uniform(&seed), x[3 * p + 1] = across + 0.02 * sin(7 * along);
    x[3 * p + 2] = planar ? 0 : 0.03 * sin(9 * across) + 0.01 * uniform(&seed);
    mass[p] = 0.01;
  }
  for (int32_t p = 0; p < PARTICLES; p++)
    for (int d = 0; d < 2; d++) {
      const int32_t step = d ? COLUMNS : 1, at = d ? p / COLUMNS : p % COLUMNS;
      if (at == 0 || at == (d ? ROWS : COLUMNS) - 1) continue;
      const int32_t any = (int32_t)(uniform(&seed) * (PARTICLES - 2));
      const int32_t vertex = order == 2 ? any + 1 : order == 3 ? 5 : p;
      ijk[3 * n] = order < 2 ? p - step : vertex ? vertex - 1 : 1;
      ijk[3 * n + 1] = vertex;
      ijk[3 * n + 2] = order < 2 ? p + step : (vertex + 1 + any % (PARTICLES - 3)) % PARTICLES;
      if (ijk[3 * n + 2] == ijk[3 * n]) ijk[3 * n + 2] = (vertex + 2) % PARTICLES;
      n++;
    }
  for (int32_t e = n - 1; e > 0 && order == 1; e--) {
    const int32_t other = (int32_t)(uniform(&seed) * (e + 1));
    for (int c = 0; c < 3; c++) {
      const int32_t kept = ijk[3 * e + c];
      ijk[3 * e + c] = ijk[3 * other + c], ijk[3 * other + c] = kept;
    }
  }
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, PARTICLES, x, NULL, mass, err));
  for (int32_t e = 0; e < n; e++) {
    const double k = 0.5 + uniform(&seed), rest = e % 3 ? PI : 2.5;
    assert_ok(msim_scene_add_angles(scene, 1, ijk + 3 * e, &k, &rest, &damping, err));
  }
  assert_ok(msim_scene_pin(scene, 3, (int32_t[]){0, COLUMNS, 77}, err));
  return scene;
}

typedef struct mesh {
  msim_scene *scene;
  ms_model model;
  ms_coefficients a;
  double *x, *v, *f;
} mesh;

static mesh create_mesh(int order, int planar, double damping) {
  unsigned seed = 11;
  mesh m = {.scene = make_mesh(order, planar, damping)};
  assert_ok(ms_model_create(m.scene->data, 0, &m.model, err));
  assert_int_equal(m.model.unknowns.dims, planar ? 2 : 3);
  assert_ok(ms_coefficients_create(&m.model, &m.a, err));
  assert_true(MS_NEW_VECTORS(m.scene->data, &m.model.unknowns, &m.x, &m.v, &m.f));
  ms_unknowns_gather(&m.model.unknowns, m.scene->data->x, m.x);
  for (int32_t r = 0; r < m.model.unknowns.nfree; r++)
    for (int32_t c = 0; c < m.model.unknowns.dims; c++)
      m.v[c * m.model.unknowns.stride + r] = uniform(&seed) - 0.5;
  return m;
}

static void destroy_mesh(mesh *m) {
  MS_FREE(&m->scene->data->alloc, m->x, m->v, m->f);
  ms_coefficients_destroy(&m->model, &m->a);
  ms_model_destroy(&m->model);
  msim_scene_destroy(m->scene);
}

/* Sweep after sweep, as nothing may add up; with constant forces in every second mesh */
static void forces_of_meshes_agree_with_the_reference(void **state) {
  (void)state;
  for (int i = 0; i < 32; i++) {
    mesh m = create_mesh(i % 4, i / 4 % 2, i / 8 % 2 ? 0.02 : 0);
    double v[3 * PARTICLES] = {0}, f[3 * PARTICLES] = {0}, g[3 * PARTICLES], force[3 * PARTICLES];
    double largest = 1;
    for (int c = 0; c < 3 * PARTICLES; c++) force[c] = i / 4 % 2 && c % 3 == 2 ? 0 : 0.1 * (c % 5);
    if (i / 16) {
      assert_ok(msim_scene_set_forces(m.scene, force, err));
      assert_ok(ms_model_update_forces(&m.model, 0, err));
    }
    ms_unknowns_scatter(&m.model.unknowns, m.v, v);
    ms_reference_compute_force(m.scene->data, m.scene->data->x, v, g);
    for (int again = 0; again < 3; again++) ms_force_compute(&m.model, m.x, m.v, m.f);
    ms_unknowns_scatter(&m.model.unknowns, m.f, f);
    for (int c = 0; c < 3 * PARTICLES; c++) largest = fmax(largest, fabs(g[c]));
    for (int c = 0; c < 3 * PARTICLES; c++)
      if (!m.scene->data->pinned[c / 3]) assert_close(f[c], g[c], 1e-13 * largest);
    destroy_mesh(&m);
  }
}

/* y = K v of the kernels against the elements of the angles one by one, and v.K v */
static void products_are_those_of_the_elements(void **state) {
  (void)state;
  for (int i = 0; i < 16; i++) {
    mesh m = create_mesh(i % 4, i / 4 % 2, i / 8 ? 0.02 : 0);
    const ms_unknowns *rows = &m.model.unknowns;
    double *want = ms_unknowns_new_vector(m.scene->data, rows), largest = 0, sum = 0;
    ms_coefficients_compute(&m.model, m.x, 0.1, 0, &m.a);
    const double got = ms_angle_springs_apply(&m.model, &m.a, 2, (ms_operands){m.v, m.f, 0});
    for (int32_t e = 0; e < m.model.angles.n; e++) {
      const int32_t *row = m.model.angles.row + 3 * e;
      double element[MS_ANGLE_ELEMENT], x[3][3] = {{0}}, y[2][3];
      ms_angle_springs_get_element(&m.a, e, element);
      for (int q = 0; q < 3; q++)
        for (int32_t c = 0; c < rows->dims; c++) x[q][c] = m.v[c * rows->stride + row[q]];
      for (int c = 0; c < 3; c++) x[0][c] -= x[1][c], x[2][c] -= x[1][c];
      ms_angle_multiply(element, x[0], x[2], y[0], y[1]);
      for (int32_t c = 0; c < rows->dims; c++) {
        const double of[3] = {y[0][c], -(y[0][c] + y[1][c]), y[1][c]};
        sum += 2 * (x[0][c] * y[0][c] + x[2][c] * y[1][c]);
        for (int q = 0; q < 3; q++) want[c * rows->stride + row[q]] += 2 * of[q];
      }
    }
    for (int32_t r = 0; r < rows->nfree; r++)
      for (int32_t c = 0; c < rows->dims; c++)
        largest = fmax(largest, fabs(want[c * rows->stride + r]));
    for (int32_t r = 0; r < rows->nfree; r++)
      for (int32_t c = 0; c < rows->dims; c++)
        assert_close(m.f[c * rows->stride + r], want[c * rows->stride + r], 1e-13 * largest);
    assert_close(got, sum, 1e-12 * fabs(sum));
    ms_memory_free(&m.scene->data->alloc, want);
    destroy_mesh(&m);
  }
}

static void instruction_sets_give_the_same_bits(void **state) {
  (void)state;
  for (int i = 0; i < 16; i++) {
    mesh m = create_mesh(i % 4, i / 4 % 2, i / 8 ? 0.02 : 0);
    const size_t n = 9 * (size_t)m.model.angles.nslots;
    double *kept = malloc(3 * n * sizeof *kept), product = 0;
    for (int isa = ms_isa_choose(); isa >= MS_ISA_BASELINE; isa--) {
      const int first = isa == ms_isa_choose();
      m.model.isa = isa;
      for (int kind = 0; kind < 3; kind++) {
        double now = 0;
        if (kind == 0) ms_coefficients_compute(&m.model, m.x, 0.1, 0, &m.a);
        if (kind < 2) ms_angle_springs_add_forces(&m.model, m.x, kind ? m.v : NULL);
        else now = ms_angle_springs_apply(&m.model, &m.a, 1, (ms_operands){m.v, m.f, 0});
        if (first)
          memcpy(kept + (size_t)kind * n, m.model.angles.corner, n * sizeof *kept), product = now;
        assert_memory_equal(kept + (size_t)kind * n, m.model.angles.corner, n * sizeof *kept);
        if (kind == 2) assert_true(product == now);
      }
    }
    free(kept);
    destroy_mesh(&m);
  }
}

/* Entries of corners are at most 1.5 times as many as the longest row of their slice needs. */
static void irregular_meshes_need_few_entries(void **state) {
  (void)state;
  for (int order = 0; order < 4; order++) {
    mesh m = create_mesh(order, 0, 0);
    const ms_angles *g = &m.model.angles;
    for (int32_t r = 0; r < m.model.unknowns.nfree; r += MS_SLICE) {
      const int32_t *first = g->corners.first + r / MS_SLICE;
      int32_t longest = 0;
      for (int32_t row = r; row < r + MS_SLICE && row < m.model.unknowns.nfree; row++)
        if (g->of.first[row + 1] - g->of.first[row] > longest)
          longest = g->of.first[row + 1] - g->of.first[row];
      assert_true(2 * (first[1] - first[0]) <= 3 * longest);
    }
    destroy_mesh(&m);
  }
}

/* A cloth is read and summed up by vector loads but for its borders. */
static void meshes_in_order_need_few_gathers(void **state) {
  (void)state;
  for (int order = 0; order < 2; order++) {
    mesh m = create_mesh(order, 0, 0);
    const ms_angles *g = &m.model.angles;
    int32_t gathers = 0, entries = g->corners.first[g->corners.nslices], ends = 0;
    for (int32_t s = 0; s < g->nslots / MS_SLICE; s++)
      for (int c = 0; c < 3; c++) gathers += g->start[c][s] < 0;
    for (int32_t e = 0; e < entries; e++) ends += g->corners.start[e] < 0;
    assert_true(gathers <= 3 * g->nslots / MS_SLICE / 3);
    assert_true(MS_SLICE * entries <= 4 * g->n && ends <= entries / 3);
    destroy_mesh(&m);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(forces_are_those_of_one_angle),
                                     cmocka_unit_test(small_deviations_are_accurate),
                                     cmocka_unit_test(limits_are_those_of_one_angle),
                                     cmocka_unit_test(forces_of_meshes_agree_with_the_reference),
                                     cmocka_unit_test(products_are_those_of_the_elements),
                                     cmocka_unit_test(instruction_sets_give_the_same_bits),
                                     cmocka_unit_test(irregular_meshes_need_few_entries),
                                     cmocka_unit_test(meshes_in_order_need_few_gathers)};
  return cmocka_run_group_tests_name("angle_kernels", tests, NULL, NULL);
}
