/* Tests of forces and matrices on irregular graphs of springs (hubs, duplicates, isolated
 * particles, shuffled order, few unknowns) against plain loops over the springs, up to rounding. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "linear/sparse_matrix.h"
#include "physics/matrix_kernels.h"
#include "scenes.h"

enum { MOST = 4000, H_INVERSE = 20 };

typedef struct shape {
  int32_t n, springs, npins;
  int32_t ij[2 * MOST], pins[MOST];
  double x[3 * MOST], v[3 * MOST], mass[MOST], k[MOST], rest[MOST], damping[MOST];
} shape;

static double chance(void) { return rand() / (RAND_MAX + 1.0); }

static void join(shape *s, int32_t i, int32_t j) {
  if (i == j || s->springs == MOST) return;
  s->ij[2 * s->springs] = i;
  s->ij[2 * s->springs + 1] = j;
  s->k[s->springs] = 10 + 90 * chance();
  s->rest[s->springs] = chance();
  s->damping[s->springs++] = chance();
}

static void place(shape *s, int32_t n) {
  *s = (shape){.n = n};
  for (int32_t i = 0; i < 3 * n; i++) s->x[i] = chance(), s->v[i] = chance() - 0.5;
  for (int32_t i = 0; i < n; i++) s->mass[i] = 0.1 + chance();
}

static void pin(shape *s, int32_t i) {
  s->pins[s->npins++] = i;
  for (int c = 0; c < 3; c++) s->v[3 * i + c] = 0;
}

/* New indices for all particles, springs in a new order and with ends exchanged. */
static void shuffle(shape *s) {
  int32_t number[MOST];
  for (int32_t i = 0; i < s->n; i++) {
    const int32_t j = rand() % (i + 1);
    number[i] = number[j];
    number[j] = i;
  }
  for (int32_t e = 0; e < s->springs; e++) {
    const int32_t f = rand() % s->springs, i = s->ij[2 * e], j = s->ij[2 * e + 1];
    s->ij[2 * e] = s->ij[2 * f + 1], s->ij[2 * e + 1] = s->ij[2 * f];
    s->ij[2 * f] = i, s->ij[2 * f + 1] = j;
  }
  for (int32_t e = 0; e < 2 * s->springs; e++) s->ij[e] = number[s->ij[e]];
  const int32_t npins = s->npins;
  s->npins = 0;
  for (int32_t p = 0; p < npins; p++) pin(s, number[s->pins[p]]);
}

static msim_scene *scene_of(const shape *s) {
  const double gravity[3] = {0.3, 1, -9.81};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, s->n, s->x, s->v, s->mass, err));
  assert_ok(msim_scene_add_springs(scene, s->springs, s->ij, s->k, s->rest, s->damping, err));
  assert_ok(msim_scene_pin(scene, s->npins, s->pins, err));
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  assert_ok(msim_scene_set_drag(scene, 0.7, err));
  return scene;
}

/*------------------------------------- reference loops ------------------------------------------*/

/* A vector of 3 components per particle, and the sum of the magnitudes added to each entry. */
typedef struct total {
  double sum[3 * MOST], magnitude[3 * MOST];
} total;

static void add(total *to, int32_t i, const double d[3], double factor) {
  for (int32_t c = 0; c < 3; c++) {
    to->sum[3 * i + c] += factor * d[c];
    to->magnitude[3 * i + c] += fabs(factor * d[c]);
  }
}

static double difference(const shape *s, int32_t e, const double *x, double d[3]) {
  double l2 = 0;
  for (int c = 0; c < 3; c++) {
    d[c] = x[3 * s->ij[2 * e + 1] + c] - x[3 * s->ij[2 * e] + c];
    l2 += d[c] * d[c];
  }
  return sqrt(l2);
}

static void plain_force(const shape *s, const ms_scene *scene, total *f) {
  memset(f, 0, sizeof *f);
  for (int32_t i = 0; i < s->n; i++) {
    add(f, i, scene->external.gravity, s->mass[i]);
    add(f, i, s->v + 3 * i, -scene->external.drag);
  }
  for (int32_t e = 0; e < s->springs; e++) {
    double d[3], dv[3], rate = 0;
    const double l = difference(s, e, s->x, d);
    difference(s, e, s->v, dv);
    for (int c = 0; c < 3; c++) rate += d[c] * dv[c] / l;
    const double push = (s->k[e] * (l - s->rest[e]) + s->damping[e] * rate) / l;
    add(f, s->ij[2 * e], d, push);
    add(f, s->ij[2 * e + 1], d, -push);
  }
}

/* (M - h D - h^2 J) v: each spring subtracts t dv + (w.dv) w at i and adds it at j, dv = v_j -
 * v_i */
static void plain_product(const shape *s, const ms_scene *scene, total *y) {
  const double h = 1.0 / H_INVERSE;
  memset(y, 0, sizeof *y);
  for (int32_t i = 0; i < s->n; i++) add(y, i, s->v + 3 * i, s->mass[i] + h * scene->external.drag);
  for (int32_t e = 0; e < s->springs; e++) {
    double d[3], dv[3], along = 0;
    const double l = difference(s, e, s->x, d), hhk = h * h * s->k[e], ratio = s->rest[e] / l;
    difference(s, e, s->v, dv);
    for (int c = 0; c < 3; c++) along += d[c] * dv[c] / (l * l);
    const double factor = (hhk * ratio + h * s->damping[e]) * along;
    for (int32_t end = 0; end < 2; end++) {
      add(y, s->ij[2 * e + end], dv, (end ? 1 : -1) * hhk * (1 - ratio));
      add(y, s->ij[2 * e + end], d, (end ? 1 : -1) * factor);
    }
  }
}

/*------------------------------------- comparison -----------------------------------------------*/

static void assert_same(const ms_model *model, const double *vec, const total *expected) {
  static double flat[3 * MOST];
  ms_unknowns_scatter(&model->unknowns, vec, flat);
  for (int32_t i = 0; i < 3 * model->unknowns.n; i++)
    if (!model->scene->pinned[i / 3])
      assert_close(flat[i], expected->sum[i], 1e-13 * (100 + expected->magnitude[i]));
}

/* A v by the assembled matrix */
static void multiply(const ms_model *model, const ms_coefficients *a, const double *v, double *y) {
  ms_sparse_graph graph;
  ms_sparse_matrix m;
  static double from[3 * MOST], to[3 * MOST];
  assert_ok(ms_sparse_matrix_create_graph(model, &graph, err));
  const ms_sparse_layout layout = {MSIM_FORMAT_FULL, 3, NULL};
  assert_ok(ms_sparse_matrix_create(model, &graph, layout, &m, err));
  ms_sparse_matrix_assemble(model, a, &m);
  ms_sparse_matrix_pack(model, &m, v, from);
  for (int32_t r = 0; r < 3 * m.n; r++) {
    to[r] = 0;
    for (int32_t e = m.rowptr[r]; e < m.rowptr[r + 1]; e++) to[r] += m.val[e] * from[m.colind[e]];
  }
  ms_sparse_matrix_unpack(model, &m, to, y);
  ms_sparse_matrix_destroy(model, &m);
  ms_sparse_matrix_destroy_graph(model, &graph);
}

/* Every instruction set: accurate up to rounding. */
static void compare_kernels(ms_model *model, const shape *s) {
  static const char *const sets[] = {"baseline", "avx2", "avx512"};
  static total force, product, magnitude;
  const msim_allocator *alloc = &model->scene->alloc;
  double *vectors[3];
  for (int i = 0; i < 3; i++) vectors[i] = ms_unknowns_new_vector(model->scene, &model->unknowns);
  double *x = vectors[0], *v = vectors[1], *y = vectors[2];
  ms_unknowns_gather(&model->unknowns, s->x, x);
  ms_unknowns_gather(&model->unknowns, s->v, v);
  plain_force(s, model->scene, &force);
  plain_product(s, model->scene, &product);
  ms_coefficients a;
  assert_ok(ms_coefficients_create(model, &a, err));
  for (size_t i = 0; i < sizeof sets / sizeof *sets; i++) {
    model->isa = ms_isa_find(sets[i]);
    if (model->isa < 0) continue; /* not supported by this CPU */
    ms_force_compute(model, x, v, y);
    assert_same(model, y, &force);
    ms_coefficients_compute(model, x, 1.0 / H_INVERSE, 0, &a);
    ms_coefficients_apply(model, &a, v, y);
    assert_same(model, y, &product);
  }
  model->isa = ms_isa_choose();
  if (a.block == 3) { /* some rest length is not 0 */
    multiply(model, &a, v, y);
    assert_same(model, y, &product);
  }
  ms_coefficients_apply_abs(model, &a, v, y);
  ms_unknowns_scatter(&model->unknowns, y, magnitude.sum);
  for (int32_t i = 0; i < 3 * s->n; i++)
    if (!model->scene->pinned[i / 3])
      assert_true(magnitude.sum[i] >= fabs(product.sum[i]) * (1 - 1e-13));
  ms_coefficients_destroy(model, &a);
  for (int i = 0; i < 3; i++) ms_memory_free(alloc, vectors[i]);
}

/* A run in two parts, the second in a sim of its own. */
static void compare_restart(const msim_scene *scene) {
  msim_options opt = options("verlet", 1e-3);
  msim_sim *whole = make_sim(scene, &opt), *part = make_sim(scene, &opt);
  assert_ok(msim_sim_step(whole, 5, err));
  assert_ok(msim_sim_step(part, 3, err));
  msim_sim *rest = make_sim(scene, &opt);
  const msim_state middle = state_of(part);
  assert_ok(msim_sim_set_state(rest, &middle, err));
  assert_ok(msim_sim_step(rest, 2, err));
  const msim_state a = state_of(whole), b = state_of(rest);
  assert_memory_equal(a.x, b.x, 3 * (size_t)a.n * sizeof *a.x);
  assert_memory_equal(a.v, b.v, 3 * (size_t)a.n * sizeof *a.v);
  msim_sim_destroy(whole), msim_sim_destroy(part), msim_sim_destroy(rest);
}

static void compare(const shape *s) {
  msim_scene *scene = scene_of(s);
  ms_model model;
  assert_ok(ms_model_create(scene->data, 0, &model, err));
  if (model.unknowns.nfree) compare_kernels(&model, s);
  ms_model_destroy(&model);
  compare_restart(scene);
  msim_scene_destroy(scene);
}

static void compare_shuffled(shape *s) {
  compare(s);
  shuffle(s);
  compare(s);
}

/*------------------------------------- graphs ---------------------------------------------------*/

static shape s;

static void stars(void **state) {
  (void)state;
  for (int32_t n = 2; n <= MOST; n = 3 * n + 1) {
    place(&s, n);
    for (int32_t i = 1; i < n; i++) join(&s, 0, i);
    compare_shuffled(&s);
  }
  /* longer than a part of a split row */
  place(&s, MOST / 2);
  for (int32_t i = 1; i < s.n; i++) join(&s, 0, i), join(&s, i, 1);
  compare_shuffled(&s);
}

static void complete_graphs(void **state) {
  (void)state;
  for (int32_t n = 1; n < 90; n += 8) {
    place(&s, n);
    for (int32_t i = 0; i < n; i++)
      for (int32_t j = 0; j < i; j++) join(&s, i, j);
    compare_shuffled(&s);
  }
}

static void chains_and_grids(void **state) {
  (void)state;
  place(&s, 1000);
  for (int32_t i = 1; i < s.n; i++) join(&s, i - 1, i);
  compare_shuffled(&s);
  place(&s, 900);
  for (int32_t i = 0; i < s.n; i++) {
    if (i % 30) join(&s, i, i - 1);
    if (i >= 30) join(&s, i, i - 30);
    if (i % 100 == 0) pin(&s, i);
  }
  compare_shuffled(&s);
  for (int32_t i = 1; i < s.n; i++) join(&s, 0, i); /* and a hub */
  compare_shuffled(&s);
}

/* Hundreds of springs between one pair, and isolated particles. */
static void duplicates(void **state) {
  (void)state;
  for (int32_t times = 1; times < 500; times *= 5) {
    place(&s, 100);
    for (int32_t e = 0; e < times; e++) join(&s, 20, 21), join(&s, 22, 21), join(&s, 90, 20);
    compare_shuffled(&s);
  }
}

static void few_unknowns(void **state) {
  (void)state;
  for (int32_t unknown = 0; unknown < 3; unknown++) {
    place(&s, 200);
    for (int32_t i = 1; i < s.n; i++) join(&s, 0, i), join(&s, i, (i + 7) % s.n);
    for (int32_t i = 0; i < s.n; i++)
      if (i != unknown) pin(&s, i);
    compare_shuffled(&s);
  }
}

static void random_graphs(void **state) {
  (void)state;
  for (int32_t round = 0; round < 170; round++) {
    place(&s, 1 + round % 17 + (round < 68 ? 0 : 30 * (round % 5)));
    const int32_t springs = rand() % (8 * s.n);
    for (int32_t e = 0; e < springs; e++) join(&s, rand() % s.n, rand() % s.n);
    for (int32_t i = 0; i < s.n && round % 3 == 0; i++)
      if (rand() % 4 == 0) pin(&s, i);
    compare(&s);
  }
}

/* Messages name particles by their index in the scene, in whatever order the unknowns are. */
static void the_scene_names_particles(void **state) {
  (void)state;
  place(&s, 500);
  for (int32_t i = 1; i < s.n; i++) join(&s, i - 1, i);
  shuffle(&s);
  for (int32_t i = 0; i < 3 * s.n; i++) s.v[i] = 0;
  s.v[3 * 123] = 1e139;
  msim_scene *scene = scene_of(&s);
  msim_options opt = options("explicit-euler", 100);
  msim_sim *sim = make_sim(scene, &opt);
  msim_error why;
  const char *text;
  assert_int_equal(msim_sim_step(sim, 1, &why), MSIM_NOT_FINITE);
  assert_non_null(strstr(why.text, "particle 123"));
  assert_ok(msim_sim_explain(sim, &text, err));
  assert_non_null(strstr(text, "renumbered"));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  srand(11);
  const struct CMUnitTest tests[] = {cmocka_unit_test(stars),
                                     cmocka_unit_test(complete_graphs),
                                     cmocka_unit_test(chains_and_grids),
                                     cmocka_unit_test(duplicates),
                                     cmocka_unit_test(few_unknowns),
                                     cmocka_unit_test(random_graphs),
                                     cmocka_unit_test(the_scene_names_particles)};
  return cmocka_run_group_tests_name("spring_graphs", tests, NULL, NULL);
}
