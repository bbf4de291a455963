/* Tests of the order of unknowns and of the sliced ELLPACK layout of half-edges: each occurs once,
 * neighbours are close in memory and consecutive where the mesh allows it, few lanes are empty. */
#include <stdlib.h>

#include "layout/layout.h"
#include "scenes.h"

typedef struct layout {
  ms_unknowns rows;
  ms_springs springs;
  ms_half_edges half_edges;
} layout;

static layout make(const msim_scene *scene) {
  layout l;
  ms_islands islands;
  assert_ok(ms_islands_create(scene->data, 1, &islands, err));
  const ms_island all = ms_islands_get(&islands, 0);
  assert_ok(ms_layout_create(scene->data, &all, &l.rows, &l.springs, &l.half_edges, err));
  ms_islands_destroy(scene->data, &islands);
  return l;
}

static void destroy(const msim_scene *scene, layout *l) {
  ms_layout_destroy(scene->data, &l->rows, &l->springs, &l->half_edges);
}

/* The half-edges of one unknown have the right neighbours, in ascending order. Returns their
 * number. */
static int32_t check_row(const layout *l, int32_t row, int *seen) {
  const ms_half_edges *h = &l->half_edges;
  const ms_half_edge_span span = ms_half_edges_of_row(h, row);
  int32_t count = 0, last = -1;
  for (int32_t at = span.begin; at < span.end; at += span.step) {
    const int32_t e = h->spring[at], neighbour = ms_half_edges_neighbour(h, at);
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

/* The invariants of entries: consecutive ones are marked as such, split rows have consecutive
 * parts, padding exerts no force. Returns the number of half-edges. */
static int32_t check_entries(const layout *l) {
  const ms_half_edges *h = &l->half_edges;
  int32_t count = 0, scattered = 0;
  assert_int_equal(h->first[0], 0);
  assert_int_equal(h->first[h->nslices + h->nparts], h->nentries);
  for (int32_t p = 0; p < h->nparts; p++) {
    const int32_t slots = h->first[h->nslices + p + 1] - h->first[h->nslices + p];
    assert_in_range(slots, 1, MS_PART_ENTRIES);
    assert_in_range(h->first_part[h->part_row[p]], 0, p);
  }
  for (int32_t at = 0; at < MS_SLICE * h->nentries; at++) {
    const int32_t start = h->entry[at / MS_SLICE].start;
    assert_in_range(ms_half_edges_neighbour(h, at), 0, l->rows.stride - 1);
    if (start < 0) assert_int_equal(~start, at % MS_SLICE ? scattered - 1 : scattered++);
    const size_t value = ms_half_edges_value(h, at);
    if (h->spring[at] < 0) assert_true(h->k[value] == 0 && h->damping[value] == 0);
    count += h->spring[at] >= 0;
  }
  assert_int_equal(scattered, h->nscattered);
  return count;
}

/* Each free particle has an unknown of its own; the pinned ones that springs touch follow. */
static void check_unknowns(const ms_scene *scene, const ms_unknowns *rows) {
  uint8_t *seen = calloc((size_t)scene->nparticles, 1);
  const int32_t last_pinned = rows->first_pinned + rows->n - rows->nfree;
  for (int32_t r = 0; r < rows->stride; r++) {
    const int32_t p = rows->particle[r];
    const int pinned = r >= rows->first_pinned;
    if (r < rows->nfree || (pinned && r < last_pinned)) {
      assert_int_equal(scene->pinned[p], pinned);
      assert_int_equal(seen[p]++, 0);
    } else {
      assert_int_equal(p, -1);
    }
  }
  for (int32_t p = 0; p < scene->nparticles; p++) assert_true(scene->pinned[p] || seen[p]);
  free(seen);
}

/* Every half-edge occurs once, at the right unknown. */
static void check(const msim_scene *scene, const layout *l) {
  check_unknowns(scene->data, &l->rows);
  int *seen = calloc(2 * (size_t)l->springs.n + 1, sizeof *seen);
  int32_t count = 0;
  assert_int_equal(l->half_edges.nslices * MS_SLICE, l->rows.first_pinned);
  for (int32_t r = 0; r < l->rows.nfree; r++) count += check_row(l, r, seen);
  assert_int_equal(check_entries(l), count);
  assert_in_range(2 * MS_SLICE * l->half_edges.nentries, 2 * count,
                  5 * count + 64 * l->half_edges.nslices);
  for (int32_t e = 0; e < l->springs.n; e++) {
    assert_int_equal(seen[2 * e], l->springs.i[e] < l->rows.nfree);
    assert_int_equal(seen[2 * e + 1], l->springs.j[e] < l->rows.nfree);
  }
  free(seen);
}

/* Random pairs, some of them several times, a hub, isolated and pinned particles. */
static void every_half_edge_occurs_once(void **state) {
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
    check(scene, &l);
    destroy(scene, &l);
    msim_scene_destroy(scene);
  }
}

static double share_of_consecutive(const layout *l) {
  int32_t runs = 0;
  for (int32_t s = 0; s < l->half_edges.nentries; s++) runs += l->half_edges.entry[s].start >= 0;
  return (double)runs / l->half_edges.nentries;
}

static double lanes_per_half_edge(const layout *l) {
  return (double)MS_SLICE * l->half_edges.nentries / (2.0 * l->springs.n);
}

static void grids_have_consecutive_neighbours(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(50, 100, 0);
  layout l = make(scene);
  check(scene, &l);
  assert_true(share_of_consecutive(&l) > 0.98);
  assert_true(lanes_per_half_edge(&l) < 1.1);
  /* the unknowns are in the order of the scene's particles */
  assert_true(l.rows.distance_reduction == 0 && !l.rows.sorted_by_degree);
  for (int32_t r = 1; r < l.rows.nfree; r++)
    assert_true(l.rows.particle[r] > l.rows.particle[r - 1]);
  destroy(scene, &l);
  msim_scene_destroy(scene);
}

/* The particles and springs of a mesh in random order; hub: one more particle with a spring to
 * each. */
static msim_scene *shuffled(const msim_scene *mesh, int hub) {
  const ms_scene *from = mesh->data;
  const int32_t n = from->nparticles, all = n + hub, springs = from->nsprings + (hub ? n : 0);
  double *x = calloc(3 * (size_t)all, sizeof *x), *ones = malloc((size_t)springs * sizeof *ones);
  int32_t *number = malloc((size_t)all * sizeof *number);
  int32_t *ij = malloc(2 * (size_t)springs * sizeof *ij);
  for (int32_t i = 0; i < all; i++) {
    const int32_t j = rand() % (i + 1);
    number[i] = number[j];
    number[j] = i;
  }
  for (int32_t e = 0; e < springs; e++) {
    const int32_t f = rand() % (e + 1), mine = e < from->nsprings;
    ones[e] = 1;
    ij[2 * e] = ij[2 * f], ij[2 * e + 1] = ij[2 * f + 1];
    ij[2 * f] = number[mine ? from->ij[2 * e] : n];
    ij[2 * f + 1] = number[mine ? from->ij[2 * e + 1] : e - from->nsprings];
  }
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, all, x, NULL, ones, err));
  assert_ok(msim_scene_add_springs(scene, springs, ij, ones, NULL, NULL, err));
  free(x), free(ones), free(number), free(ij);
  return scene;
}

static void shuffled_grids_are_reordered(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(60, 100, 0);
  for (int round = 0; round < 10; round++) {
    const int hub = round % 2;
    msim_scene *scene = shuffled(cloth, hub);
    layout l = make(scene), again = make(scene);
    check(scene, &l);
    assert_true(share_of_consecutive(&l) >
                (hub ? 0.6 : 0.85)); /* hub: one gathered entry per row */
    assert_true(lanes_per_half_edge(&l) < 1.15);
    assert_true(l.rows.distance_reduction > 10);
    assert_memory_equal(l.rows.particle, again.rows.particle,
                        (size_t)l.rows.stride * sizeof *l.rows.particle);
    destroy(scene, &l), destroy(scene, &again);
    msim_scene_destroy(scene);
  }
  msim_scene_destroy(cloth);
}

/* Random points in a square, joined where they are close. */
static void irregular_meshes_have_near_neighbours_and_full_lanes(void **state) {
  (void)state;
  enum { N = 2000 };
  double x[3 * N], ones[20 * N], span = 0;
  int32_t ij[2 * 20 * N], springs = 0;
  for (int32_t i = 0; i < 3 * N; i++) x[i] = i % 3 == 2 ? 0 : rand() / (double)RAND_MAX;
  for (int32_t i = 0; i < N; i++)
    for (int32_t j = 0; j < i && springs < 20 * N; j++) {
      const double dx = x[3 * i] - x[3 * j], dy = x[3 * i + 1] - x[3 * j + 1];
      if (dx * dx + dy * dy > 2.5 / N) continue;
      ones[springs] = 1, ij[2 * springs] = i, ij[2 * springs++ + 1] = j;
    }
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, N, x, NULL, ones, err));
  assert_ok(msim_scene_add_springs(scene, springs, ij, ones, NULL, NULL, err));
  layout l = make(scene);
  check(scene, &l);
  for (int32_t e = 0; e < springs; e++) span += abs(l.springs.i[e] - l.springs.j[e]);
  assert_true(span / springs < N / 25);
  assert_true(l.rows.distance_reduction > 8 && l.rows.sorted_by_degree);
  assert_true(lanes_per_half_edge(&l) < 1.15);
  destroy(scene, &l);
  msim_scene_destroy(scene);
}

/* `stars` stars of `arms` springs each, whose centres form a star of their own. */
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

/* Hubs are not padded to the longest row: at most 2.5 lanes per half-edge. */
static void hubs_are_not_padded(void **state) {
  (void)state;
  const int32_t shapes[][2] = {{1, 100000}, {300, 300}, {3000, 30}, {9000, 9},  {10000, 4},
                               {10000, 3},  {50000, 1}, {1, 7},     {1, 20000}, {20000, 0}};
  for (size_t i = 0; i < sizeof shapes / sizeof *shapes; i++) {
    msim_scene *scene = star_of_stars(shapes[i][0], shapes[i][1]);
    layout l = make(scene);
    check(scene, &l);
    assert_in_range(MS_SLICE * l.half_edges.nentries, 0, 5 * l.springs.n + 24);
    destroy(scene, &l);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(every_half_edge_occurs_once),
      cmocka_unit_test(grids_have_consecutive_neighbours),
      cmocka_unit_test(shuffled_grids_are_reordered),
      cmocka_unit_test(irregular_meshes_have_near_neighbours_and_full_lanes),
      cmocka_unit_test(hubs_are_not_padded)};
  return cmocka_run_group_tests_name("layout", tests, NULL, NULL);
}
