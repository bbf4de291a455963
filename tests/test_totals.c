/* Tests of the totals of the energy monitor (energies, moments, bounding boxes), summed in one
 * force sweep, against plain loops over particles and springs, for every instruction set. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "physics/totals.h"
#include "testing.h"

/* More half-edges than one chunk of work holds; particle 0 has so many that its row is split. */
enum { N = 1500, NS = 4 * N };

static struct {
  double x[3 * N], v[3 * N], mass[N], k[NS], rest[NS];
  int32_t ij[2 * NS];
} s;

/* Every seventh particle is pinned. */
static int is_pinned(int32_t i) { return i % 7 == 3; }

/* Random numbers; z = 0 where the scene is planar. */
static msim_scene *random_scene(int dims) {
  unsigned seed = 5;
  msim_scene *scene;
  memset(&s, 0, sizeof s);
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int32_t i = 0; i < N; i++) {
    s.mass[i] = 0.1 + uniform(&seed);
    for (int c = 0; c < dims; c++) {
      s.x[3 * i + c] = uniform(&seed) + 3;
      s.v[3 * i + c] = is_pinned(i) ? 0 : uniform(&seed) - 0.5;
    }
  }
  for (int32_t e = 0; e < NS; e++) {
    const int32_t i = e < N ? 0 : e % N;
    s.ij[2 * e] = i;
    s.ij[2 * e + 1] = (i + 1 + (int32_t)(uniform(&seed) * (N - 1))) % N;
    s.k[e] = 10 + 90 * uniform(&seed), s.rest[e] = uniform(&seed);
  }
  assert_ok(msim_scene_add_particles(scene, N, s.x, s.v, s.mass, err));
  assert_ok(msim_scene_add_springs(scene, NS, s.ij, s.k, s.rest, NULL, err));
  for (int32_t i = 0; i < N; i++)
    if (is_pinned(i)) assert_ok(msim_scene_pin(scene, 1, &i, err));
  return scene;
}

/* Pinned particles have no kinetic energy, and springs between them none that changes. */
static ms_totals plain_totals(void) {
  ms_totals t = ms_totals_identity();
  for (int32_t i = 0; i < N; i++)
    for (int c = 0; c < 3 && !is_pinned(i); c++) {
      const double x = s.x[3 * i + c], v = s.v[3 * i + c];
      t.kinetic += s.mass[i] * v * v / 2;
      t.moment[c] += s.mass[i] * x;
      t.low[c] = fmin(t.low[c], x), t.high[c] = fmax(t.high[c], x);
    }
  for (int32_t e = 0; e < NS; e++) {
    const int32_t i = s.ij[2 * e], j = s.ij[2 * e + 1];
    const double *a = s.x + 3 * i, *b = s.x + 3 * j;
    const double stretch = hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]) - s.rest[e];
    if (!is_pinned(i) || !is_pinned(j)) t.elastic += s.k[e] * stretch * stretch / 2;
  }
  return t;
}

static void compare(const ms_totals *got, const ms_totals *want) {
  assert_close(got->kinetic, want->kinetic, 1e-13 * want->kinetic);
  assert_close(got->elastic, want->elastic, 1e-13 * want->elastic);
  for (int c = 0; c < 3; c++) {
    assert_close(got->moment[c], want->moment[c], 1e-13 * want->moment[c]);
    assert_true(got->low[c] == want->low[c]);
    assert_true(got->high[c] == want->high[c]);
  }
}

static void totals_are_those_of_plain_loops(void **state) {
  (void)state;
  static const char *const sets[] = {"baseline", "avx2", "avx512"};
  for (int dims = 2; dims <= 3; dims++) {
    msim_scene *scene = random_scene(dims);
    const ms_totals want = plain_totals();
    ms_model model;
    assert_ok(ms_model_create(scene->data, 0, &model, err));
    assert_int_equal(model.unknowns.dims, dims);
    assert_true(model.half_edges.nparts > 0);
    assert_true(ms_totals_count_parts(&model) > 1);
    ms_totals *parts = malloc((size_t)ms_totals_count_parts(&model) * sizeof *parts);
    double *vec[2];
    for (int i = 0; i < 2; i++) vec[i] = ms_unknowns_new_vector(scene->data, &model.unknowns);
    ms_unknowns_gather(&model.unknowns, s.x, vec[0]);
    ms_unknowns_gather(&model.unknowns, s.v, vec[1]);
    for (size_t i = 0; i < sizeof sets / sizeof *sets; i++) {
      model.isa = ms_isa_find(sets[i]);
      if (model.isa < 0) continue; /* not supported by this CPU */
      const ms_totals got = ms_totals_compute(&model, vec[0], vec[1], parts);
      compare(&got, &want);
    }
    for (int i = 0; i < 2; i++) ms_memory_free(&scene->data->alloc, vec[i]);
    free(parts);
    ms_model_destroy(&model);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(totals_are_those_of_plain_loops)};
  return cmocka_run_group_tests_name("totals", tests, NULL, NULL);
}
