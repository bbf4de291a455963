/* Tests of ropes, cloths and lattices: which particles, where, which springs, in which order. */
#include <math.h>

#include "peak_allocator.h"
#include "scene_check.h"

static msim_rope a_rope(int32_t n) {
  return (msim_rope){.size = sizeof(msim_rope),
                     .n = n,
                     .from = {0.1, 0.2, 0.3},
                     .to = {0.7, 1, -2},
                     .mass = 0.6,
                     .k = 50,
                     .damping = 0.25};
}

static msim_cloth a_cloth(int32_t rows, int32_t columns) {
  return (msim_cloth){.size = sizeof(msim_cloth),
                      .rows = rows,
                      .columns = columns,
                      .origin = {1, 2, 3},
                      .row = {0, 0, -1},
                      .column = {2, 0, 0.5},
                      .mass = 3,
                      .k_structural = 100,
                      .k_shear = 10,
                      .k_bend = 1,
                      .damping = 0.5};
}

static msim_lattice a_lattice(int32_t nx, int32_t ny, int32_t nz) {
  return (msim_lattice){.size = sizeof(msim_lattice),
                        .n = {nx, ny, nz},
                        .origin = {-1, 0, 1},
                        .extent = {2, 3, 4},
                        .mass = 8,
                        .k = 7,
                        .damping = 0};
}

/* The springs are these pairs, counted from particle `first`, of stiffness k. */
static void assert_springs(const msim_scene *scene, int32_t first, int32_t n,
                           const int32_t (*pairs)[2], const double *k) {
  const msim_scene_view view = view_of(scene);
  assert_int_equal(view.nsprings, n);
  for (int32_t e = 0; e < n; e++) {
    assert_int_equal(view.ij[2 * e], first + pairs[e][0]);
    assert_int_equal(view.ij[2 * e + 1], first + pairs[e][1]);
    assert_true(view.k[e] == k[e]);
  }
}

/*------------------------------------- rope -----------------------------------------------------*/

static void a_rope_is_a_line(void **state) {
  (void)state;
  const int32_t pinned[2] = {0, 3}, pairs[3][2] = {{0, 1}, {1, 2}, {2, 3}};
  const double k[3] = {50, 50, 50};
  msim_scene *scene = make_started_scene();
  msim_rope rope = a_rope(4);
  rope.npinned = 2, rope.pinned = pinned;
  assert_ok(msim_scene_add_rope(scene, &rope, err));
  const msim_scene_view view = view_of(scene);
  assert_int_equal(view.nparticles, 5);
  assert_springs(scene, 1, 3, pairs, k);
  assert_memory_equal(view.x + 3, rope.from, sizeof rope.from);
  assert_memory_equal(view.x + 12, rope.to, sizeof rope.to);
  for (int c = 0; c < 3; c++)
    assert_close(view.x[6 + c], (2 * rope.from[c] + rope.to[c]) / 3, 1e-15);
  for (int i = 1; i < 5; i++) assert_true(view.mass[i] == 0.6 / 4);
  for (int e = 0; e < 3; e++) assert_true(view.damping[e] == 0.25);
  assert_close(view.rest[0] * 3, sqrt(0.36 + 0.64 + 5.29), 1e-14);
  const uint8_t held[5] = {0, 1, 0, 0, 1};
  assert_memory_equal(view.pinned, held, sizeof held);
  msim_scene_destroy(scene);
}

static void one_particle_stands_at_the_origin(void **state) {
  (void)state;
  msim_scene *scene = make_empty_scene();
  const msim_rope rope = a_rope(1);
  const msim_cloth cloth = a_cloth(1, 1);
  const msim_lattice lattice = a_lattice(1, 1, 1);
  assert_ok(msim_scene_add_rope(scene, &rope, err));
  assert_ok(msim_scene_add_cloth(scene, &cloth, err));
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  const msim_scene_view view = view_of(scene);
  assert_int_equal(view.nparticles, 3);
  assert_int_equal(view.nsprings, 0);
  assert_memory_equal(view.x, rope.from, sizeof rope.from);
  assert_memory_equal(view.x + 3, cloth.origin, sizeof cloth.origin);
  assert_memory_equal(view.x + 6, lattice.origin, sizeof lattice.origin);
  assert_true(view.mass[2] == 8);
  msim_scene_destroy(scene);
}

/*------------------------------------- cloth ----------------------------------------------------*/

static void a_cloth_lists_springs_by_first_particle(void **state) {
  (void)state;
  /* right, down, down-right, down-left, two right, two down */
  const int32_t pairs[][2] = {{0, 1}, {0, 3}, {0, 4}, {0, 2}, {0, 6}, {1, 2}, {1, 4},
                              {1, 5}, {1, 3}, {1, 7}, {2, 5}, {2, 4}, {2, 8}, {3, 4},
                              {3, 6}, {3, 7}, {3, 5}, {4, 5}, {4, 7}, {4, 8}, {4, 6},
                              {5, 8}, {5, 7}, {6, 7}, {6, 8}, {7, 8}};
  const double k[] = {100, 100, 10, 1, 1,   100, 100, 10, 10,  1,  100, 10, 1,
                      100, 100, 10, 1, 100, 100, 10,  10, 100, 10, 100, 1,  100};
  msim_scene *scene = make_started_scene();
  const msim_cloth cloth = a_cloth(3, 3);
  assert_ok(msim_scene_add_cloth(scene, &cloth, err));
  assert_springs(scene, 1, sizeof pairs / sizeof *pairs, pairs, k);
  for (size_t e = 0; e < sizeof k / sizeof *k; e++) assert_true(view_of(scene).damping[e] == 0.5);
  msim_scene_destroy(scene);
}

static void a_cloth_counts_along_its_rows(void **state) {
  (void)state;
  const int32_t pinned[1] = {7};
  msim_scene *scene = make_empty_scene();
  msim_cloth cloth = a_cloth(3, 4);
  cloth.npinned = 1, cloth.pinned = pinned;
  assert_ok(msim_scene_add_cloth(scene, &cloth, err));
  const msim_scene_view view = view_of(scene);
  assert_int_equal(view.nparticles, 12);
  for (int r = 0; r < 3; r++)
    for (int c = 0; c < 4; c++) {
      const int p = r * 4 + c;
      for (int d = 0; d < 3; d++)
        assert_close(view.x[3 * p + d],
                     cloth.origin[d] + r / 2.0 * cloth.row[d] + c / 3.0 * cloth.column[d], 1e-15);
      assert_true(view.mass[p] == 0.25);
      assert_int_equal(view.pinned[p], p == 7);
    }
  msim_scene_destroy(scene);
}

static void k_0_leaves_springs_out(void **state) {
  (void)state;
  const int32_t shear[][2] = {{0, 3}, {1, 2}}, none[1][2] = {{0, 0}};
  const double k[2] = {10, 10};
  msim_scene *scene = make_empty_scene();
  msim_rope rope = a_rope(5);
  msim_cloth cloth = a_cloth(2, 2);
  msim_lattice lattice = a_lattice(2, 2, 2);
  rope.k = lattice.k = cloth.k_structural = cloth.k_bend = 0;
  assert_ok(msim_scene_add_rope(scene, &rope, err));
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  assert_springs(scene, 0, 0, none, k);
  assert_ok(msim_scene_add_cloth(scene, &cloth, err));
  assert_springs(scene, 13, 2, shear, k);
  msim_scene_destroy(scene);
}

/*------------------------------------- lattice --------------------------------------------------*/

static void a_cell_is_tied_in_all_directions(void **state) {
  (void)state;
  const int32_t pairs[28][2] = {{0, 4}, {0, 2}, {0, 1}, {0, 6}, {0, 5}, {0, 3}, {0, 7},
                                {1, 5}, {1, 3}, {1, 7}, {1, 4}, {1, 2}, {1, 6}, {2, 6},
                                {2, 3}, {2, 4}, {2, 7}, {2, 5}, {3, 7}, {3, 5}, {3, 6},
                                {3, 4}, {4, 6}, {4, 5}, {4, 7}, {5, 7}, {5, 6}, {6, 7}};
  double k[28];
  for (int e = 0; e < 28; e++) k[e] = 7;
  msim_scene *scene = make_started_scene();
  const msim_lattice lattice = a_lattice(2, 2, 2);
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  assert_springs(scene, 1, 28, pairs, k);
  assert_close(view_of(scene).rest[6], sqrt(4 + 9 + 16), 1e-15);
  msim_scene_destroy(scene);
}

/* Every pair of neighbours, along edges and diagonals, once. */
static void a_lattice_ties_all_neighbours(void **state) {
  (void)state;
  enum { NX = 3, NY = 4, NZ = 2, N = NX * NY * NZ };
  msim_scene *scene = make_empty_scene();
  const msim_lattice lattice = a_lattice(NX, NY, NZ);
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  const msim_scene_view view = view_of(scene);
  assert_int_equal(view.nparticles, N);
  const double step[3] = {1, 1, 4};
  int expected = 0;
  for (int p = 0; p < N; p++)
    for (int q = p + 1; q < N; q++) {
      int near = 1;
      for (int d = 0; d < 3; d++)
        near &= fabs(view.x[3 * p + d] - view.x[3 * q + d]) < 1.5 * step[d];
      expected += near;
    }
  assert_int_equal(view.nsprings, expected);
  for (int e = 0; e < view.nsprings; e++)
    for (int d = 0; d < 3; d++)
      assert_true(fabs(view.x[3 * view.ij[2 * e] + d] - view.x[3 * view.ij[2 * e + 1] + d]) <
                  1.5 * step[d]);
  const int p = (1 * NY + 2) * NZ + 1; /* ix 1, iy 2, iz 1 */
  const double at[3] = {0, 2, 5};
  assert_memory_equal(view.x + 3 * p, at, sizeof at);
  msim_scene_destroy(scene);
}

/*------------------------------------- refusals -------------------------------------------------*/

#define REFUSE(kind, value, member, bad, words)                       \
  do {                                                                \
    msim_##kind object = value;                                       \
    object.member = bad;                                              \
    assert_refused(s, msim_scene_add_##kind(s, &object, err), words); \
  } while (0)

static void objects_without_size_are_refused(void **state) {
  (void)state;
  msim_scene *s = make_started_scene();
  msim_error why;
  msim_rope rope = a_rope(4);
  msim_cloth cloth = a_cloth(2, 3);
  rope.size = 8, cloth.size = 0;
  assert_int_equal(msim_scene_add_rope(s, &rope, &why), MSIM_ERR_SIZE);
  assert_non_null(strstr(why.text, "rope.size is 8; it must be sizeof(msim_rope)"));
  assert_int_equal(msim_scene_add_cloth(s, &cloth, &why), MSIM_ERR_SIZE);
  assert_non_null(strstr(why.text, "cloth.size is 0"));
  msim_scene_destroy(s);
}

static void bad_objects_are_refused(void **state) {
  (void)state;
  msim_scene *s = make_started_scene();
  REFUSE(rope, a_rope(4), n, 0, "rope.n is 0; it must be a whole number from 1");
  REFUSE(rope, a_rope(4), n, 1000000000, "rope.n gives 1000000000 particles; the limit is");
  REFUSE(rope, a_rope(4), from[1], NAN, "rope.from[1] is nan; it must be a finite number");
  REFUSE(rope, a_rope(4), to[2], INFINITY, "rope.to[2] is inf");
  REFUSE(rope, a_rope(4), mass, 0, "rope.mass is 0; it must be a finite number > 0");
  REFUSE(rope, a_rope(4), mass, 5e-324, "which is 0 for each of 4 particles; it must be larger");
  REFUSE(rope, a_rope(4), k, -1, "rope.k is -1; it must be a finite number >= 0");
  REFUSE(rope, a_rope(4), damping, -1, "rope.damping is -1");
  REFUSE(rope, a_rope(4), npinned, -1, "rope.npinned is -1");
  REFUSE(rope, a_rope(4), npinned, 1, "rope.pinned is NULL");
  REFUSE(cloth, a_cloth(2, 3), rows, -2, "cloth.rows is -2");
  REFUSE(cloth, a_cloth(2, 3), columns, 0, "cloth.columns is 0");
  REFUSE(cloth, a_cloth(2, 1 << 30), rows, 1 << 30, "gives 1152921504606846976 particles");
  REFUSE(cloth, a_cloth(2, 3), column[0], INFINITY, "cloth.column[0] is inf");
  REFUSE(cloth, a_cloth(2, 3), k_structural, NAN, "cloth.k_structural is nan");
  REFUSE(cloth, a_cloth(2, 3), k_bend, -1, "cloth.k_bend is -1");
  REFUSE(lattice, a_lattice(2, 2, 2), n[2], 0, "lattice.n[2] is 0");
  REFUSE(lattice, a_lattice(600, 600, 1), n[2], 600,
         "lattice.n gives 2798290796 springs; the limit is");
  REFUSE(lattice, a_lattice(2, 2, 2), extent[1], -1, "lattice.extent[1] is -1");
  REFUSE(lattice, a_lattice(2, 2, 2), origin[0], -INFINITY, "lattice.origin[0] is -inf");
  assert_refused(s, msim_scene_add_cloth(s, NULL, err), "cloth is NULL");
  msim_scene_destroy(s);
}

static void bad_pins_of_objects_are_refused(void **state) {
  (void)state;
  const int32_t pinned[2] = {5, 6};
  msim_scene *s = make_started_scene();
  msim_cloth cloth = a_cloth(2, 3);
  cloth.npinned = 2, cloth.pinned = pinned;
  assert_refused(s, msim_scene_add_cloth(s, &cloth, err),
                 "cloth.pinned[1] is 6; it must be a whole number from 0 to 5");
  msim_scene_destroy(s);
}

static void *little(size_t bytes, void *user) {
  (void)user;
  return bytes < 1 << 20 ? malloc(bytes) : NULL;
}

static void release(void *block, void *user) {
  (void)user;
  free(block);
}

/* 700 million particles would need 20 GB: the limit is checked before memory is allocated, and a
 * scene may reach it. */
static void limits_hold_for_the_whole_scene(void **state) {
  (void)state;
  const msim_allocator alloc = {sizeof alloc, little, release, NULL};
  msim_scene *s;
  msim_rope rope = a_rope(INT32_MAX / 3);
  assert_ok(msim_scene_create(&alloc, &s, err));
  assert_int_equal(msim_scene_add_rope(s, &rope, NULL), MSIM_ERR_MEMORY);
  msim_scene_destroy(s);
  s = make_started_scene();
  assert_refused(s, msim_scene_add_rope(s, &rope, err),
                 "rope adds 715827882 particles to 1; the limit is 715827882");
  msim_scene_destroy(s);
}

/* 57 bytes a particle, 32 a spring, 12 a face */
static void no_array_is_there_twice(void **state) {
  (void)state;
  peak_allocator m = {0};
  const msim_allocator alloc = {sizeof alloc, peak_allocator_alloc, peak_allocator_free, &m};
  const msim_cloth cloth = a_cloth(60, 60);
  msim_error before = {MSIM_ERR_ARG, "of an earlier call"};
  msim_scene *s;
  assert_ok(msim_scene_create(&alloc, &s, err));
  assert_int_equal(msim_scene_add_cloth(s, &cloth, &before), MSIM_OK);
  assert_true(before.status == MSIM_OK && !*before.text);
  const msim_scene_view view = view_of(s);
  assert_in_range(m.peak, 1, 57 * view.nparticles + 32 * view.nsprings + 12 * view.nfaces + 4096);
  msim_scene_destroy(s);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_rope_is_a_line),
                                     cmocka_unit_test(one_particle_stands_at_the_origin),
                                     cmocka_unit_test(a_cloth_lists_springs_by_first_particle),
                                     cmocka_unit_test(a_cloth_counts_along_its_rows),
                                     cmocka_unit_test(k_0_leaves_springs_out),
                                     cmocka_unit_test(a_cell_is_tied_in_all_directions),
                                     cmocka_unit_test(a_lattice_ties_all_neighbours),
                                     cmocka_unit_test(objects_without_size_are_refused),
                                     cmocka_unit_test(bad_objects_are_refused),
                                     cmocka_unit_test(bad_pins_of_objects_are_refused),
                                     cmocka_unit_test(limits_hold_for_the_whole_scene),
                                     cmocka_unit_test(no_array_is_there_twice)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
