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

/* The halves of one row: with the right neighbours, in ascending order. Returns how many. */
static int32_t check_row(const layout *l, int32_t row, int *seen) {
  const ms_halves *h = &l->halves;
  const ms_span span = ms_halves_of(h, row);
  int32_t count = 0, last = -1;
  for (int32_t at = span.begin; at < span.end; at += span.step) {
    const int32_t e = h->spring[at], neighbour = h->neighbour[at];
    if (e < 0) continue;
    const int second = l->springs.j[e] == row;
    assert_int_equal(second ? l->springs.j[e] : l->springs.i[e], row);
    assert_int_equal(second ? l->springs.i[e] : l->springs.j[e], neighbour);
    assert_int_equal(seen[2 * e + second]++, 0);
    assert_true(neighbour >= last);
    last = neighbour;
    count++;
  }
  return count;
}

/* Slots as their comments say: runs are runs, parts belong to long rows, padding pulls nothing. */
static int32_t check_slots(const layout *l) {
  const ms_halves *h = &l->halves;
  int32_t count = 0;
  assert_int_equal(h->first[0], 0);
  assert_int_equal(h->first[h->ngroups + h->nparts], h->nslots);
  for (int32_t p = 0; p < h->nparts; p++) {
    const int32_t slots = h->first[h->ngroups + p + 1] - h->first[h->ngroups + p];
    assert_in_range(slots, 1, MS_PART);
    assert_in_range(h->part[h->part_row[p]], 0, p);
  }
  for (int32_t at = 0; at < MS_GROUP * h->nslots; at++) {
    const int32_t start = h->start[at / MS_GROUP];
    assert_in_range(h->neighbour[at], 0, l->rows.stride - 1);
    if (start >= 0) assert_int_equal(h->neighbour[at], start + at % MS_GROUP);
    if (h->spring[at] < 0) assert_true(h->k[at] == 0 && h->damping[at] == 0);
    count += h->spring[at] >= 0;
  }
  return count;
}

/* Every half spring is there once, at the right row. */
static void check(const layout *l) {
  int *seen = calloc(2 * (size_t)l->springs.n + 1, sizeof *seen);
  int32_t count = 0;
  assert_int_equal(l->halves.ngroups * MS_GROUP, l->rows.first_pinned);
  for (int32_t r = 0; r < l->rows.nfree; r++) count += check_row(l, r, seen);
  assert_int_equal(check_slots(l), count);
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

/* `stars` stars of `arms` springs each, their centres in a star of their own. */
static msim_scene *star_of_stars(int32_t stars, int32_t arms) {
  const int32_t n = 1 + stars * (1 + arms);
  double *x = calloc(3 * (size_t)n, sizeof *x), *ones = malloc((size_t)n * sizeof *ones);
  int32_t *ij = malloc(2 * (size_t)n * sizeof *ij), springs = 0;
  for (int32_t p = 0; p < n; p++) {
    ones[p] = 1;
    if (p == 0) continue;
    const int32_t centre = p - (p - 1) % (1 + arms);
    ij[2 * springs] = centre == p ? 0 : centre;
    ij[2 * springs++ + 1] = p;
  }
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, n, x, NULL, ones, err));
  assert_ok(msim_scene_add_springs(scene, springs, ij, ones, NULL, NULL, err));
  free(x), free(ones), free(ij);
  return scene;
}

/* Hubs cost as many lanes as the springs of a mesh, twice and a bit at most. */
static void hubs_are_not_padded(void **state) {
  (void)state;
  const int32_t shapes[][2] = {{1, 100000}, {300, 300}, {3000, 30}, {9000, 9},  {10000, 4},
                               {10000, 3},  {50000, 1}, {1, 7},     {1, 20000}, {20000, 0}};
  for (size_t i = 0; i < sizeof shapes / sizeof *shapes; i++) {
    msim_scene *scene = star_of_stars(shapes[i][0], shapes[i][1]);
    layout l = make(scene);
    check(&l);
    assert_in_range(MS_GROUP * l.halves.nslots, 0, 5 * l.springs.n + 32);
    destroy(scene, &l);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(every_half_is_there_once),
                                     cmocka_unit_test(grids_are_read_in_runs),
                                     cmocka_unit_test(hubs_are_not_padded)};
  return cmocka_run_group_tests_name("layout", tests, NULL, NULL);
}
