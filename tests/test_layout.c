/* Half springs by row: each is there once, and runs of consecutive neighbours are found where the
 * mesh has them. */
#include <stdlib.h>

#include "layout/halves.h"
#include "scenes.h"

typedef struct layout {
  ms_rows rows;
  ms_springs springs;
  ms_halves halves;
} layout;

static layout make(const msim_scene *scene) {
  layout l;
  assert_ok(ms_rows_create(scene->data, &l.rows, err));
  assert_ok(ms_springs_create(scene->data, &l.rows, &l.springs, err));
  assert_ok(ms_halves_create(scene->data, &l.rows, &l.springs, &l.halves, err));
  return l;
}

static void destroy(const msim_scene *scene, layout *l) {
  ms_halves_destroy(scene->data, &l->halves);
  ms_springs_destroy(scene->data, &l->springs);
  ms_rows_destroy(scene->data, &l->rows);
}

/* Every half spring once, at the right row, with the right neighbour, in ascending order. */
static void check(const layout *l) {
  const ms_halves *h = &l->halves;
  int *seen = calloc(2 * (size_t)l->springs.n + 1, sizeof *seen);
  assert_int_equal(h->ngroups * MS_GROUP, l->rows.first_pinned);
  for (int32_t g = 0; g < h->ngroups; g++) {
    int32_t last[MS_GROUP];
    for (int32_t lane = 0; lane < MS_GROUP; lane++) last[lane] = -1;
    for (int32_t at = MS_GROUP * h->first[g]; at < MS_GROUP * h->first[g + 1]; at++) {
      const int32_t lane = at % MS_GROUP, row = MS_GROUP * g + lane, e = h->spring[at];
      const int32_t start = h->start[at / MS_GROUP], neighbour = h->neighbour[at];
      assert_in_range(neighbour, 0, l->rows.stride - 1);
      if (start >= 0) assert_int_equal(neighbour, start + lane);
      if (e < 0) continue;
      const int second = l->springs.j[e] == row;
      assert_int_equal(second ? l->springs.j[e] : l->springs.i[e], row);
      assert_int_equal(second ? l->springs.i[e] : l->springs.j[e], neighbour);
      assert_int_equal(seen[2 * e + second]++, 0);
      assert_true(neighbour >= last[lane]);
      last[lane] = neighbour;
    }
  }
  for (int32_t e = 0; e < l->springs.n; e++) {
    assert_int_equal(seen[2 * e], l->springs.i[e] < l->rows.nfree);
    assert_int_equal(seen[2 * e + 1], l->springs.j[e] < l->rows.nfree);
  }
  free(seen);
}

/* Random pairs, some of them several times, a hub, isolated and pinned particles. */
static void every_half_is_there_once(void **state) {
  (void)state;
  enum { MOST = 300 };
  srand(7);
  for (int round = 0; round < 60; round++) {
    const int32_t n = 2 + rand() % 40, springs = rand() % MOST, npins = rand() % n;
    double x[3 * 42], mass[42], k[MOST];
    int32_t ij[2 * MOST], pins[42];
    for (int32_t i = 0; i < 3 * n; i++) x[i] = rand() % 1000;
    for (int32_t i = 0; i < n; i++) mass[i] = 1, pins[i] = rand() % n;
    for (int32_t e = 0; e < springs; e++) {
      k[e] = 1;
      ij[2 * e] = round % 3 ? rand() % n : 0;
      ij[2 * e + 1] = (ij[2 * e] + 1 + rand() % (n - 1)) % n;
    }
    msim_scene *scene;
    assert_ok(msim_scene_create(NULL, &scene, err));
    assert_ok(msim_scene_add_particles(scene, n, x, NULL, mass, err));
    assert_ok(msim_scene_add_springs(scene, springs, ij, k, NULL, NULL, err));
    assert_ok(msim_scene_pin(scene, npins, pins, err));
    layout l = make(scene);
    check(&l);
    destroy(scene, &l);
    msim_scene_destroy(scene);
  }
}

static void grids_are_read_in_runs(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(50, 100, 0);
  layout l = make(scene);
  check(&l);
  int32_t runs = 0;
  for (int32_t s = 0; s < l.halves.nslots; s++) runs += l.halves.start[s] >= 0;
  assert_true(runs > 0.98 * l.halves.nslots);
  /* and few lanes stay empty */
  assert_true(2.0 * l.springs.n > 0.9 * MS_GROUP * l.halves.nslots);
  destroy(scene, &l);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(every_half_is_there_once),
                                     cmocka_unit_test(grids_are_read_in_runs)};
  return cmocka_run_group_tests_name("layout", tests, NULL, NULL);
}
