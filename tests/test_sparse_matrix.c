/* Tests of the values of the matrix in compressed rows: bit by bit those of plain loops over the
 * half-edges of each row, in every format, order and dimension, on any number of threads. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/isa.h"
#include "linear/sparse_matrix.h"
#include "physics/angle_springs.h"
#include "scenes.h"

enum { MOST = 1500, SPRINGS = 3 * MOST, ANGLES = 40 };

/* What a scene has */
enum { PLANAR = 1, LINEAR = 2, ANGULAR = 4, REPEATED = 8, HUB = 16, PINS = 32 };

static double chance(void) { return rand() / (RAND_MAX + 1.0); }

static void add_particles(msim_scene *scene, int32_t n, int has) {
  static double x[3 * MOST], mass[MOST];
  for (int32_t i = 0; i < n; i++) {
    mass[i] = 0.1 + chance();
    for (int c = 0; c < 3; c++) x[3 * i + c] = c == 2 && has & PLANAR ? 0 : chance();
  }
  assert_ok(msim_scene_add_particles(scene, n, x, NULL, mass, err));
}

/* Springs between particles that are close in number, those of a hub, and repeated ones, each
 * between the ends of the one before, in either order */
static void add_springs(msim_scene *scene, int32_t n, int has) {
  static int32_t ij[2 * SPRINGS];
  static double k[SPRINGS], rest[SPRINGS], damping[SPRINGS];
  for (int32_t e = 0; e < 3 * n; e++) {
    int32_t *ends = ij + 2 * e;
    ends[0] = rand() % n, ends[1] = (ends[0] + 1 + rand() % 9) % n;
    if (has & HUB && e % 3 == 0 && e > 3) ends[0] = 1, ends[1] = e / 3;
    if (has & REPEATED && e % 4 > 0) ends[0] = ends[e % 2 - 2], ends[1] = ends[-1 - e % 2];
  }
  for (int32_t e = 0; e < 3 * n; e++) {
    k[e] = 10 + 90 * chance();
    rest[e] = has & LINEAR ? 0 : chance(), damping[e] = has & LINEAR ? 0 : chance();
  }
  assert_ok(msim_scene_add_springs(scene, 3 * n, ij, k, rest, damping, err));
}

static void add_angles(msim_scene *scene, int32_t n) {
  int32_t ijk[3 * ANGLES];
  double k[ANGLES];
  for (int32_t e = 0; e < ANGLES; e++) {
    const int32_t first = rand() % n, step = 1 + rand() % 3;
    for (int32_t c = 0; c < 3; c++) ijk[3 * e + c] = (first + c * step) % n;
    k[e] = 1 + chance();
  }
  assert_ok(msim_scene_add_angles(scene, ANGLES, ijk, k, NULL, NULL, err));
}

static msim_scene *make_scene(int32_t n, int has) {
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  add_particles(scene, n, has);
  add_springs(scene, n, has);
  if (has & ANGULAR) add_angles(scene, n);
  for (int32_t i = 0; i < n && has & PINS; i += 5) assert_ok(msim_scene_pin(scene, 1, &i, err));
  return scene;
}

/*------------------------------------- plain loops ----------------------------------------------*/

typedef struct problem {
  ms_model model;
  ms_coefficients a;
  ms_damping_derivative damping; /* v NULL: none */
  ms_constraint constraint[3];
  ms_sparse_matrix matrix;
  int32_t order[MOST], position[MOST];
  double *x, *v, *expected;
} problem;

/* Row `row` of a block of the expected matrix; NULL: the block is not stored. */
static double *row_of_block(const problem *p, int32_t r, int32_t c, int32_t row) {
  const ms_sparse_matrix *m = &p->matrix;
  if (c >= m->n || (m->format == MSIM_FORMAT_UPPER && p->position[c] < p->position[r])) return NULL;
  const int32_t scalar = m->block * p->position[r] + row;
  for (int32_t e = m->rowptr[scalar]; e < m->rowptr[scalar + 1]; e++)
    if (m->colind[e] == m->block * p->position[c]) return p->expected + e;
  fail_msg("block (%d, %d) is not in the pattern", r, c);
  return NULL;
}

static void add_to_block(const problem *p, int32_t r, int32_t c, double sign, double block[3][3]) {
  for (int32_t b = 0; b < p->matrix.block; b++) {
    double *row = row_of_block(p, r, c, b);
    for (int32_t q = 0; q < p->matrix.block && row; q++) row[q] += sign * block[b][q];
  }
}

/* block (r, j) -= g d d^T, and then t I */
static void subtract_half_edge(const problem *p, int32_t r, int32_t at) {
  const int32_t j = ms_half_edges_neighbour(&p->model.half_edges, at), size = p->a.block;
  const size_t stride = (size_t)p->model.unknowns.stride;
  double d[3] = {0};
  for (int32_t c = 0; c < size && size > 1; c++)
    d[c] = p->a.x[(size_t)c * stride + (size_t)j] - p->a.x[(size_t)c * stride + (size_t)r];
  for (int32_t b = 0; b < size; b++) {
    double *row = row_of_block(p, r, j, b);
    if (!row) return;
    for (int32_t c = 0; c < size && size > 1; c++) row[c] -= p->a.g[at] * (d[b] * d[c]);
    row[b] -= p->a.t[at];
  }
}

static void add_diagonal(const problem *p, int32_t r) {
  const size_t sd = (size_t)p->model.unknowns.first_pinned, size = (size_t)p->a.block;
  double block[3][3];
  for (size_t b = 0; b < size; b++)
    for (size_t c = 0; c < size; c++)
      block[b][c] = p->a.diagonal[ms_coefficients_diagonal_element(size, b, c) * sd + (size_t)r];
  add_to_block(p, r, r, 1, block);
}

static void add_angle(const problem *p, int32_t e) {
  double element[MS_ANGLE_ELEMENT], block[3][3];
  const int32_t *corner = p->model.angles.row + 3 * e;
  ms_angle_springs_get_element(&p->a, e, element);
  for (int at = 0; at < 9; at++) {
    if (corner[at / 3] >= p->matrix.n || at / 3 == at % 3) continue;
    ms_angle_block(element, at / 3, at % 3, block);
    add_to_block(p, corner[at / 3], corner[at % 3], 1, block);
  }
}

static void expect_matrix(const problem *p) {
  const ms_half_edges *h = &p->model.half_edges;
  memset(p->expected, 0, (size_t)p->matrix.rowptr[p->matrix.block * p->matrix.n] * sizeof(double));
  for (int pass = 0; pass < 2; pass++) { /* springs and angles; then the damping derivative */
    for (int32_t r = 0; r < p->matrix.n; r++) {
      const ms_half_edge_span span = ms_half_edges_of_row(h, r);
      if (pass == 0) add_diagonal(p, r);
      for (int32_t at = span.begin; at < span.end; at += span.step) {
        double block[3][3];
        if (h->spring[at] < 0) continue;
        if (pass == 0) subtract_half_edge(p, r, at);
        else if (ms_damping_derivative_block(&p->model, &p->damping, r, at, block)) {
          add_to_block(p, r, r, 1, block);
          add_to_block(p, r, ms_half_edges_neighbour(h, at), -1, block);
        }
      }
    }
    for (int32_t e = 0; e < p->model.angles.n && pass == 0; e++) add_angle(p, e);
    if (!p->damping.v) return;
  }
}

/*------------------------------------- comparison -----------------------------------------------*/

static void pose(const msim_scene *scene, int has, problem *p) {
  *p = (problem){0};
  assert_ok(ms_model_create(scene->data, has & PLANAR ? 0 : MSIM_SKIP_TWO_D, &p->model, err));
  assert_ok(ms_coefficients_create(&p->model, &p->a, err));
  assert_int_equal(p->a.block, has & LINEAR ? 1 : has & PLANAR ? 2 : 3);
  if (has & HUB) assert_true(p->model.half_edges.nparts > 0);
  assert_true(MS_NEW_VECTORS(scene->data, &p->model.unknowns, &p->x, &p->v));
  ms_unknowns_gather(&p->model.unknowns, scene->data->x, p->x);
  for (int32_t r = 0; r < p->model.unknowns.nfree; r++)
    for (int32_t c = 0; c < p->model.unknowns.dims; c++)
      p->v[c * p->model.unknowns.stride + r] = chance() - 0.5;
}

static void constrain(problem *p) {
  for (int32_t i = 0; i < 3; i++)
    p->constraint[i] =
        (ms_constraint){.row = 2 * i, .n = 1, .direction[0] = {0.6, 0.8, 0}, .friction = 0.1 * i};
  ms_coefficients_add_constraints(&p->model, p->constraint, 3, &p->a);
}

static void create_matrix(problem *p, int32_t format, int shuffled) {
  const int32_t n = p->model.unknowns.nfree;
  ms_sparse_graph graph;
  for (int32_t k = 0; k < n; k++) {
    const int32_t other = shuffled ? rand() % (k + 1) : k;
    p->order[k] = p->order[other], p->order[other] = k;
  }
  for (int32_t k = 0; k < n; k++) p->position[p->order[k]] = k;
  assert_ok(ms_sparse_matrix_create_graph(&p->model, &graph, err));
  assert_ok(ms_sparse_matrix_create(
      &p->model, &graph, (ms_sparse_layout){format, p->a.block, p->order}, &p->matrix, err));
  ms_sparse_matrix_destroy_graph(&p->model, &graph);
}

/* Whatever val held, all of it is written. */
static void compare_matrix(problem *p) {
  const size_t n = (size_t)p->matrix.rowptr[p->matrix.block * p->matrix.n];
  p->expected = malloc(n * sizeof *p->expected);
  expect_matrix(p);
  for (int32_t threads = 1; threads <= 3; threads++) {
    p->model.pool = ms_pool_create(&p->model.scene->alloc, threads);
    for (size_t i = 0; i < n; i++) p->matrix.val[i] = NAN;
    ms_sparse_matrix_assemble(&p->model, &p->a, &p->matrix);
    if (p->damping.v) ms_sparse_matrix_add_damping_derivative(&p->model, &p->damping, &p->matrix);
    assert_memory_equal(p->matrix.val, p->expected, n * sizeof *p->expected);
    ms_pool_destroy(p->model.pool);
  }
  p->model.pool = NULL;
  free(p->expected);
}

static void compare(const msim_scene *scene, int has) {
  static const char *const sets[] = {"baseline", "avx2", "avx512"};
  static problem p;
  pose(scene, has, &p);
  for (int round = 0; round < 12; round++) {
    const int isa = ms_isa_find(sets[round / 4]), full = round % 2;
    if (isa < 0) continue; /* not supported by this CPU */
    p.model.isa = isa;
    ms_coefficients_compute(&p.model, p.x, 0.05, round % 4 == 0, &p.a);
    if (p.a.block > 1) constrain(&p);
    const int damped = full && p.a.block > 1;
    p.damping = (ms_damping_derivative){p.a.x, damped ? p.v : NULL, 0.05};
    create_matrix(&p, full ? MSIM_FORMAT_FULL : MSIM_FORMAT_UPPER, round / 2 % 2);
    compare_matrix(&p);
    ms_sparse_matrix_destroy(&p.model, &p.matrix);
  }
  MS_FREE(&p.model.scene->alloc, p.x, p.v);
  ms_coefficients_destroy(&p.model, &p.a);
  ms_model_destroy(&p.model);
}

static void values_are_those_of_plain_loops(void **state) {
  (void)state;
  static const int features[] = {0, PINS, REPEATED, PINS | REPEATED, ANGULAR, ANGULAR | REPEATED};
  for (size_t f = 0; f < sizeof features / sizeof *features; f++)
    for (int kind = 0; kind <= LINEAR; kind++) {
      const int has = features[f] | kind;
      if (has & LINEAR && has & ANGULAR) continue; /* angular springs have directions */
      for (int32_t n = 12; n < 100; n += 29) {
        msim_scene *scene = make_scene(n, has);
        compare(scene, has);
        msim_scene_destroy(scene);
      }
    }
}

/* Several chunks of work, and split rows */
static void values_of_large_matrices_are_too(void **state) {
  (void)state;
  for (int kind = 0; kind <= LINEAR; kind++) {
    const int has = kind | HUB | PINS;
    msim_scene *scene = make_scene(MOST, has);
    compare(scene, has);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  srand(5);
  const struct CMUnitTest tests[] = {cmocka_unit_test(values_are_those_of_plain_loops),
                                     cmocka_unit_test(values_of_large_matrices_are_too)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
