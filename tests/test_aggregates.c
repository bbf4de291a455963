/* Tests of aggregates (connected clusters of unknowns) and their modes, on regular meshes and
 * irregular graphs. */
#include "linear/aggregates.h"

#include "linear/clusters.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "scene_check.h"
#include "scenes.h"

typedef struct aggregates {
  ms_model model;
  ms_aggregates a;
  int32_t size;
} aggregates;

static aggregates make(const msim_scene *scene, int32_t size) {
  aggregates g = {.size = size};
  assert_ok(ms_model_create(scene->data, 0, &g.model, err));
  assert_ok(ms_aggregates_create(&g.model, size, &g.a, err));
  return g;
}

static void clean(aggregates *g) {
  ms_aggregates_destroy(&g->model, &g->a);
  ms_model_destroy(&g->model);
}

/*------------------------------------- graphs ---------------------------------------------------*/

typedef struct graph {
  int32_t n, edges, most;
  int32_t *ij;
  double *k;
} graph;

static graph empty(int32_t n, int32_t most) {
  return (graph){.n = n,
                 .most = most,
                 .ij = calloc(2 * (size_t)most, sizeof(int32_t)),
                 .k = calloc((size_t)most, sizeof(double))};
}

static void edge(graph *g, int32_t i, int32_t j, double k) {
  assert_true(g->edges < g->most && i != j);
  g->ij[2 * g->edges] = i, g->ij[2 * g->edges + 1] = j, g->k[g->edges++] = k;
}

/* Aggregates depend on springs only. */
static msim_scene *scene_of(graph *g) {
  double *x = calloc(3 * (size_t)g->n, sizeof *x), *mass = calloc((size_t)g->n, sizeof *mass);
  msim_scene *scene;
  for (int32_t i = 0; i < g->n; i++) x[3 * i] = i, mass[i] = 1;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, g->n, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, g->edges, g->ij, g->k, NULL, NULL, err));
  free(x), free(mass), free(g->ij), free(g->k);
  return scene;
}

/* Bodies of `corners` particles each, with springs between all pairs. */
static msim_scene *bodies(int32_t count, int32_t corners) {
  graph g = empty(count * corners, count * corners * corners);
  for (int32_t b = 0; b < count; b++)
    for (int32_t i = 0; i < corners; i++)
      for (int32_t j = 0; j < i; j++) edge(&g, corners * b + i, corners * b + j, 100);
  return scene_of(&g);
}

/* Springs from particle 0 to all others; `rim`: also from each of these to the next. */
static msim_scene *hub(int32_t leaves, int rim) {
  graph g = empty(leaves + 1, 2 * leaves);
  for (int32_t i = 1; i <= leaves; i++) edge(&g, 0, i, 100);
  for (int32_t i = 1; i < leaves && rim; i++) edge(&g, i, i + 1, 100);
  return scene_of(&g);
}

/* A tree in which each particle is connected to one of the `back` before it, and some more
 * springs. */
static msim_scene *random_graph(int32_t n, int32_t back, int32_t more, unsigned seed) {
  graph g = empty(n, n + more);
  for (int32_t i = 1; i < n; i++) {
    const int32_t first = i > back ? i - back : 0;
    edge(&g, i, first + (int32_t)(uniform(&seed) * (i - first)), pow(10, 9 * uniform(&seed)));
  }
  for (int32_t e = 0; e < more; e++) {
    const int32_t i = (int32_t)(uniform(&seed) * n), j = (int32_t)(uniform(&seed) * (n - 1));
    edge(&g, i, j + (j >= i), pow(10, 9 * uniform(&seed)));
  }
  return scene_of(&g);
}

static msim_scene *solid(int32_t side) {
  const msim_lattice lattice = {
      .size = sizeof lattice, .n = {side, side, side}, .extent = {1, 1, 1}, .mass = 1, .k = 1000};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  return scene;
}

static msim_scene *chain(int32_t n) {
  graph g = empty(n, n);
  for (int32_t i = 1; i < n; i++) edge(&g, i - 1, i, 100);
  return scene_of(&g);
}

/*------------------------------------- checks ---------------------------------------------------*/

/* Every unknown is in no aggregate, or in the one that lists it, once. */
static void check_lists(const aggregates *g) {
  const ms_aggregates *a = &g->a;
  int32_t listed = 0;
  for (int32_t k = 0; k < a->n; k++) {
    assert_in_range(a->first[k + 1] - a->first[k], 4, 2 * g->size);
    for (int32_t i = a->first[k]; i < a->first[k + 1]; i++) {
      assert_int_equal(a->of[a->unknown[i]], k);
      if (i > a->first[k]) assert_true(a->unknown[i - 1] < a->unknown[i]);
    }
  }
  for (int32_t r = 0; r < g->model.unknowns.first_pinned; r++) {
    assert_true(a->of[r] >= -1 && a->of[r] < a->n);
    if (r >= g->model.unknowns.nfree) assert_int_equal(a->of[r], -1);
    listed += a->of[r] >= 0;
  }
  assert_int_equal(listed, a->first[a->n]);
}

static int32_t root_of(int32_t *parent, int32_t r) {
  while (parent[r] != r) r = parent[r] = parent[parent[r]];
  return r;
}

/* Springs between members connect all members of an aggregate. */
static void check_connected(const aggregates *g) {
  const ms_springs *s = &g->model.springs;
  const int32_t n = g->model.unknowns.nfree, *of = g->a.of;
  int32_t *parent = malloc((size_t)n * sizeof *parent), roots = 0;
  for (int32_t r = 0; r < n; r++) parent[r] = r;
  for (int32_t e = 0; e < s->n; e++)
    if (s->i[e] < n && s->j[e] < n && of[s->i[e]] == of[s->j[e]])
      parent[root_of(parent, s->i[e])] = root_of(parent, s->j[e]);
  for (int32_t r = 0; r < n; r++) roots += of[r] >= 0 && parent[r] == r;
  assert_int_equal(roots, g->a.n);
  free(parent);
}

static double dot(const ms_aggregates *a, int32_t k, int p, int q) {
  double sum = 0;
  for (int32_t i = a->first[k]; i < a->first[k + 1]; i++)
    sum += (double)a->weight[4 * a->unknown[i] + p] * (double)a->weight[4 * a->unknown[i] + q];
  return sum;
}

/* The norm of f on an aggregate without its part in the modes, over the norm of its deviation from
 * the mean, or of f if f is constant. */
static double left_over(const ms_aggregates *a, int32_t k, const double *f) {
  double part[4] = {0}, left = 0, mean = 0, ff = 0;
  const int32_t n = a->first[k + 1] - a->first[k], *row = a->unknown + a->first[k];
  for (int32_t i = 0; i < n; i++) {
    mean += f[row[i]] / n, ff += f[row[i]] * f[row[i]];
    for (int m = 0; m < 4; m++) part[m] += (double)a->weight[4 * row[i] + m] * f[row[i]];
  }
  const double deviation = ff - n * mean * mean;
  for (int32_t i = 0; i < n; i++) {
    double rest = f[row[i]];
    for (int m = 0; m < 4; m++) rest -= part[m] * (double)a->weight[4 * row[i] + m];
    left += rest * rest;
  }
  return sqrt(left / (deviation > 1e-12 * ff ? deviation : ff));
}

static void check_modes(const aggregates *g) {
  const size_t n = (size_t)g->model.unknowns.first_pinned;
  double *one = malloc(n * sizeof *one);
  for (size_t r = 0; r < n; r++) one[r] = 1;
  for (int32_t k = 0; k < g->a.n; k++) {
    for (int p = 0; p < 4; p++)
      for (int q = 0; q <= p; q++) assert_close(dot(&g->a, k, p, q), p == q, 1e-5);
    assert_close(left_over(&g->a, k, one), 0, 1e-6);
  }
  for (size_t i = 0; i < 4 * n; i++)
    if (g->a.of[i / 4] < 0) assert_true(g->a.weight[i] == 0);
  free(one);
}

/* All checks, on two results with the same bits; returns the number of unknowns in aggregates. */
static int32_t check(msim_scene *scene, int32_t size) {
  aggregates g = make(scene, size), again = make(scene, size);
  check_lists(&g);
  check_connected(&g);
  check_modes(&g);
  const size_t n = (size_t)g.model.unknowns.first_pinned;
  assert_memory_equal(g.a.of, again.a.of, n * sizeof *g.a.of);
  assert_memory_equal(g.a.weight, again.a.weight, 4 * n * sizeof *g.a.weight);
  const int32_t covered = g.a.first[g.a.n];
  clean(&g), clean(&again);
  return covered;
}

static int32_t check_and_destroy(msim_scene *scene, int32_t size) {
  const int32_t covered = check(scene, size);
  msim_scene_destroy(scene);
  return covered;
}

/*------------------------------------- tests ----------------------------------------------------*/

static void meshes_are_covered(void **state) {
  (void)state;
  static const int32_t sizes[] = {4, 8, 16, 64, 128, 256};
  for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
    assert_in_range(check_and_destroy(hanging_cloth(40, 100, 0), sizes[i]), 0.95 * 1598, 1598);
    assert_in_range(check_and_destroy(solid(12), sizes[i]), 0.95 * 1728, 1728);
    assert_in_range(check_and_destroy(chain(1001), sizes[i]), 0.95 * 1001, 1001);
  }
}

/* The sum of the `count` least eigenvalues of the symmetric n x n matrix A, by Jacobi rotations. */
static double least_eigenvalues(int32_t n, double *A, int count) {
  for (int sweep = 0; sweep < 8; sweep++)
    for (int32_t p = 0; p < n; p++)
      for (int32_t q = p + 1; q < n; q++) {
        if (A[p * n + q] == 0) continue;
        const double theta = (A[q * n + q] - A[p * n + p]) / (2 * A[p * n + q]);
        const double t = (theta < 0 ? -1 : 1) / (fabs(theta) + sqrt(theta * theta + 1));
        const double c = 1 / sqrt(t * t + 1), s = t * c;
        for (int32_t at = 0; at < 2 * n; at++) { /* columns p, q, then rows */
          double *x = A + (at < n ? at * n + p : p * n + at - n), y = *x;
          double *z = A + (at < n ? at * n + q : q * n + at - n);
          *x = c * y - s * *z, *z = s * y + c * *z;
        }
      }
  double sum = 0;
  for (int rank = 0; rank < count; rank++) {
    int32_t least = 0;
    for (int32_t i = 1; i < n; i++)
      if (A[i * n + i] < A[least * n + least]) least = i;
    sum += A[least * n + least], A[least * n + least] = INFINITY;
  }
  return sum;
}

/* A = A^-1, by Gauss and Jordan; A is symmetric positive definite. */
static void invert(int32_t n, double *A) {
  for (int32_t k = 0; k < n; k++) {
    const double pivot = A[k * n + k];
    A[k * n + k] = 1;
    for (int32_t j = 0; j < n; j++) A[k * n + j] /= pivot;
    for (int32_t i = 0; i < n; i++) {
      const double by = A[i * n + k];
      if (i == k) continue;
      A[i * n + k] = 0;
      for (int32_t j = 0; j < n; j++) A[i * n + j] -= by * A[k * n + j];
    }
  }
}

/* A = -P A P, P = I - sum w w^T over the modes w before `known` at n unknowns */
static void project(const ms_aggregates *a, const int32_t *row, int32_t n, int known, double *A) {
  for (int side = 0; side < 2; side++)
    for (int32_t i = 0; i < n; i++)
      for (int m = 0; m < known; m++) {
        double *x = side ? A + i * n : A + i, dot = 0;
        const int32_t step = side ? 1 : n;
        for (int32_t j = 0; j < n; j++) dot += (double)a->weight[4 * row[j] + m] * x[j * step];
        for (int32_t j = 0; j < n; j++) x[j * step] -= dot * (double)a->weight[4 * row[j] + m];
      }
  for (int32_t i = 0; i < n * n; i++) A[i] = -A[i];
}

/* trace W^T L^-1 W of the modes W of an aggregate from `known` on, over its maximum where they are
 * orthogonal to the modes before: the share of what is smooth that they contain. */
static double smoothness(const aggregates *g, int32_t k, int known) {
  const ms_springs *s = &g->model.springs;
  const int32_t first = g->a.first[k], n = g->a.first[k + 1] - first, *of = g->a.of;
  const int32_t *row = g->a.unknown + first;
  int32_t *at = calloc((size_t)g->model.unknowns.stride, sizeof *at);
  double *L = calloc((size_t)(n * n), sizeof *L), sum = 0;
  for (int32_t i = 0; i < n; i++) at[row[i]] = i;
  for (int32_t e = 0; e < s->n; e++) {
    const int32_t i = s->i[e], j = s->j[e], p = at[i], q = at[j];
    if (i >= g->model.unknowns.nfree || j >= g->model.unknowns.nfree || of[i] != k || of[j] != k)
      continue;
    const double stiffness = g->model.scene->k[ms_springs_number(s, e)];
    L[p * n + p] += stiffness, L[q * n + q] += stiffness;
    L[p * n + q] -= stiffness, L[q * n + p] -= stiffness;
  }
  for (int32_t i = 0; i < n * n; i++) L[i] += 1; /* the translation, which P removes */
  invert(n, L);
  project(&g->a, row, n, known, L);
  for (int32_t i = 0; i < n; i++)
    for (int32_t j = 0; j < n; j++)
      for (int m = known; m < 4; m++)
        sum += L[i * n + j] * (double)g->a.weight[4 * row[i] + m] *
               (double)g->a.weight[4 * row[j] + m];
  const double ratio = sum / least_eigenvalues(n, L, 4 - known);
  free(at), free(L);
  return ratio;
}

/* Moves all particles of a scene far from the origin, with a rotation, and `noise`. */
static void move_anywhere(msim_scene *scene, double noise, unsigned seed) {
  const double a[3][3] = {{0.36, 0.48, -0.8}, {-0.8, 0.6, 0}, {0.48, 0.64, 0.6}};
  for (int32_t p = 0; p < scene->data->nparticles; p++) {
    double *x = scene->data->x + 3 * p;
    const double from[3] = {x[0], x[1], x[2]};
    for (int i = 0; i < 3; i++) {
      x[i] = 100 * (i + 1) + noise * (2 * uniform(&seed) - 1);
      for (int c = 0; c < 3; c++) x[i] += a[i][c] * from[c];
    }
  }
}

/* The largest share of a coordinate that the modes of an aggregate leave over */
static double coordinates_left_over(const aggregates *g) {
  const ms_unknowns *rows = &g->model.unknowns;
  double *f = calloc((size_t)rows->stride, sizeof *f), most = 0;
  for (int c = 0; c < 3; c++)
    for (int32_t k = 0; k < g->a.n; k++) {
      for (int32_t i = g->a.first[k]; i < g->a.first[k + 1]; i++) {
        const int32_t r = g->a.unknown[i];
        f[r] = g->model.scene->x[3 * rows->particle[r] + c] - 100 * (c + 1);
      }
      most = fmax(most, left_over(&g->a, k, f));
    }
  free(f);
  return most;
}

/* In each component a turn of an aggregate is an affine function of its coordinates, which must be
 * in the coarse space, to the accuracy of floats, or else turns would stretch springs. Other modes
 * are the smoothest ones beside it. */
static void turns_are_in_the_coarse_space(void **state) {
  (void)state;
  for (int32_t size = 16; size <= 128; size *= 2) {
    msim_scene *scenes[] = {solid(8), hanging_cloth(24, 100, 0), chain(300)};
    for (int i = 0; i < 3; i++) {
      move_anywhere(scenes[i], i == 0 ? 0.03 : 0, (unsigned)size);
      aggregates g = make(scenes[i], size);
      assert_close(coordinates_left_over(&g), 0, 1e-5);
      for (int32_t k = 0; k < g.a.n && i > 0; k++)
        assert_close(smoothness(&g, k, i == 1 ? 3 : 2), 1, 0.25);
      clean(&g);
      msim_scene_destroy(scenes[i]);
    }
  }
}

/* Noise across a tilted cloth is no mode, as it is rough: the coordinates leave it over. */
static void noise_is_not_in_the_coarse_space(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(24, 100, 0);
  move_anywhere(scene, 1e-3, 5);
  aggregates g = make(scene, 64);
  assert_in_range(1e6 * coordinates_left_over(&g), 1e2, 1e5);
  for (int32_t k = 0; k < g.a.n; k++) assert_close(smoothness(&g, k, 3), 1, 0.25);
  clean(&g);
  msim_scene_destroy(scene);
}

/* Where forces do not depend on directions, as with rest lengths of 0, the modes are the lowest of
 * the graph, wherever its particles are. */
static void modes_of_scalar_matrices_are_the_lowest(void **state) {
  (void)state;
  msim_scene *scenes[] = {hanging_cloth(24, 100, 0), solid(8), chain(300), hub(300, 1)};
  for (size_t i = 0; i < sizeof scenes / sizeof *scenes; i++) {
    const size_t bytes = (size_t)scenes[i]->data->nsprings * sizeof(double);
    memset(scenes[i]->data->rest, 0, bytes);
    move_anywhere(scenes[i], 1, 3);
    aggregates g = make(scenes[i], 64);
    for (int32_t k = 0; k < g.a.n; k++) assert_close(smoothness(&g, k, 1), 1, 0.1);
    clean(&g);
    msim_scene_destroy(scenes[i]);
  }
}

static void small_bodies(void **state) {
  (void)state;
  assert_int_equal(check_and_destroy(bodies(1000, 3), 64), 0);
  assert_int_equal(check_and_destroy(bodies(1000, 4), 64), 4000);
  assert_int_equal(check_and_destroy(bodies(1, 300), 64), 300);
}

static double seconds_for_hub(int32_t leaves, int rim) {
  msim_scene *scene = hub(leaves, rim);
  const clock_t start = clock();
  aggregates g = make(scene, 64);
  const double seconds = (double)(clock() - start) / CLOCKS_PER_SEC;
  clean(&g);
  msim_scene_destroy(scene);
  return seconds;
}

/* A hub with 1e5 leaves: the time is linear (16 times as many leaves take about 16 times as long,
 * not 256 times), although no aggregate is large enough for all of them. */
static void hubs_take_no_time(void **state) {
  (void)state;
  for (int rim = 0; rim < 2; rim++) {
    const double few = seconds_for_hub(6250, rim), many = seconds_for_hub(100000, rim);
    assert_close(many, 0, 64 * few + 0.1);
    const int32_t covered = check_and_destroy(hub(100000, rim), 64);
    if (rim) assert_true(covered > 90000);
  }
}

static void all_pinned_but_one(void **state) {
  (void)state;
  msim_scene *scene = bodies(1, 30);
  for (int32_t p = 0; p < 29; p++) assert_ok(msim_scene_pin(scene, 1, &p, err));
  assert_int_equal(check_and_destroy(scene, 64), 0);
}

/* Trees, thin and bushy, and denser graphs; several springs between a pair; stiffnesses of 1 to
 * 1e9. */
static void any_graph(void **state) {
  (void)state;
  static const int32_t back[] = {1, 2, 5, 30, 1000}, more[] = {0, 30, 3000};
  for (unsigned seed = 0; seed < 60; seed++)
    check_and_destroy(random_graph(200 + 10 * (int32_t)seed, back[seed % 5], more[seed % 3], seed),
                      4 << seed % 5);
}

/* Springs of zero to very large stiffness: all those of an aggregate, or mixed with others. */
static void any_stiffness(void **state) {
  (void)state;
  static const double scales[] = {0, 5e-324, 1e-310, 1e-200, 1, 1e200, 1e307};
  for (size_t s = 0; s < sizeof scales / sizeof *scales; s++)
    for (int mixed = 0; mixed < 2; mixed++) {
      graph g = empty(300, 600);
      for (int32_t i = 1; i < 300; i++) {
        edge(&g, i - 1, i, scales[s]);
        if (i > 20 && mixed) edge(&g, i - 20, i, 100);
      }
      assert_in_range(check_and_destroy(scene_of(&g), 32), 270, 300);
    }
}

/* Nodes without edges are clusters of their own only where clusters of one are allowed. */
static void nodes_may_be_alone(void **state) {
  (void)state;
  const msim_allocator alloc = ms_memory_allocator(NULL);
  const ms_springs edges = {.n = 2, .i = (int32_t[]){4, 2}, .j = (int32_t[]){2, 1}};
  for (int32_t least = 1; least <= 2; least++) {
    const int32_t want[2][5] = {{0, 1, 1, 2, 1}, {-1, 0, 0, -1, 0}};
    int32_t of[5];
    ms_incidence joined;
    ms_buckets members = {0};
    assert_true(ms_incidence_create(&alloc, &edges, 5, &joined));
    const ms_cluster_size size = {.complete = 3, .least = least};
    assert_int_equal(ms_clusters_grow(&alloc, &joined, 5, size, of, &members), least == 1 ? 3 : 1);
    assert_memory_equal(of, want[least - 1], sizeof of);
    assert_int_equal(members.first[1] - members.first[0], least == 1 ? 1 : 3);
    ms_buckets_destroy(&alloc, &members);
    ms_incidence_destroy(&alloc, &joined);
  }
}

static msim_status create_aggregates(const msim_allocator *alloc, void *data) {
  ms_model model = *(ms_model *)data;
  ms_scene starved = *model.scene;
  ms_aggregates a;
  starved.alloc = *alloc, model.scene = &starved;
  const msim_status status = ms_aggregates_create(&model, 16, &a, NULL);
  ms_aggregates_destroy(&model, &a);
  return status;
}

static void memory_that_ends_is_reported(void **state) {
  (void)state;
  msim_scene *scene = bodies(20, 5);
  ms_model model;
  assert_ok(ms_model_create(scene->data, 0, &model, err));
  assert_true(expect_memory_errors(create_aggregates, &model) > 10);
  ms_model_destroy(&model);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(meshes_are_covered),
                                     cmocka_unit_test(turns_are_in_the_coarse_space),
                                     cmocka_unit_test(noise_is_not_in_the_coarse_space),
                                     cmocka_unit_test(modes_of_scalar_matrices_are_the_lowest),
                                     cmocka_unit_test(small_bodies),
                                     cmocka_unit_test(hubs_take_no_time),
                                     cmocka_unit_test(all_pinned_but_one),
                                     cmocka_unit_test(any_graph),
                                     cmocka_unit_test(any_stiffness),
                                     cmocka_unit_test(nodes_may_be_alone),
                                     cmocka_unit_test(memory_that_ends_is_reported)};
  return cmocka_run_group_tests_name("aggregates", tests, NULL, NULL);
}
