/* Tests of scene files that ranks read in parts: the parts one behind the other are the file,
 * memory falls with the number of ranks, and each allocation may fail. */
#define _GNU_SOURCE /* mkdtemp */
#include <stdio.h>
#include <unistd.h>

#include "counting_allocator.h"
#include "drawn_scenes.h"
#include "peak_allocator.h"
#include "scene_part_file.h"
#include "scene/section.h"

/*------------------------------------- parts ----------------------------------------------------*/

/* Rows of a part behind those of the parts of lower ranks */
typedef struct rows_so_far {
  int64_t particles, springs, faces;
} rows_so_far;

static void check_rows(const ms_scene *part, const ms_scene *whole, rows_so_far *at) {
  const int64_t n = part->nparticles, m = part->nsprings, p = at->particles, e = at->springs;
  const size_t real = sizeof(double);
  assert_true(is_same(part->x, whole->x + 3 * p, 3 * n, real));
  assert_true(is_same(part->v, whole->v + 3 * p, 3 * n, real));
  assert_true(is_same(part->mass, whole->mass + p, n, real));
  assert_true(is_same(part->pinned, whole->pinned + p, n, 1));
  assert_int_equal(!part->force, !whole->force);
  if (part->force) assert_true(is_same(part->force, whole->force + 3 * p, 3 * n, real));
  assert_true(is_same(part->ij, whole->ij + 2 * e, 2 * m, sizeof *part->ij));
  assert_true(is_same(part->k, whole->k + e, m, real));
  assert_true(is_same(part->rest, whole->rest + e, m, real));
  assert_true(is_same(part->damping, whole->damping + e, m, real));
  assert_true(is_same(part->faces, whole->faces + 3 * at->faces, 3 * (int64_t)part->nfaces,
                      sizeof *part->faces));
  at->particles += n, at->springs += m, at->faces += part->nfaces;
}

static void check_parts(const msim_scene *whole, int32_t nranks) {
  rows_so_far at = {0};
  for (int32_t r = 0; r < nranks; r++) {
    msim_scene *part;
    assert_ok(msim_scene_load_part(NULL, path, r, nranks, &part, err));
    assert_non_null(part->part);
    assert_int_equal(part->data->nparticles, 0);
    assert_string_equal(part->data->name, whole->data->name);
    assert_memory_equal(&part->data->external, &whole->data->external,
                        sizeof whole->data->external);
    check_rows(part->part->rows, whole->data, &at);
    msim_scene_destroy(part);
  }
  assert_int_equal(at.particles, whole->data->nparticles);
  assert_int_equal(at.springs, whole->data->nsprings);
  assert_int_equal(at.faces, whole->data->nfaces);
}

/* Arrays that are longer than what is read at a time, 2^17 numbers */
static msim_scene *draw_large_scene(const msim_allocator *alloc) {
  enum { N = 60000, M = 140000, F = 50000 };
  double *x = malloc(3 * N * sizeof *x), *v = malloc(3 * N * sizeof *v),
         *mass = malloc(N * sizeof *mass), *k = malloc(M * sizeof *k);
  int32_t *ij = malloc(2 * M * sizeof *ij), *faces = malloc(3 * F * sizeof *faces);
  unsigned seed = 4;
  msim_scene *scene;
  for (int32_t i = 0; i < 3 * N; i++) x[i] = draw(&seed), v[i] = draw(&seed);
  for (int32_t i = 0; i < N; i++) mass[i] = 1.5 + draw(&seed);
  for (int32_t e = 0; e < M; e++) {
    ij[2 * e] = draw_index(&seed, N), ij[2 * e + 1] = (ij[2 * e] + 1 + e % 7) % N;
    k[e] = 2 + draw(&seed);
  }
  for (int32_t i = 0; i < F; i++)
    for (int32_t c = 0; c < 3; c++) faces[3 * i + c] = (i + c * (1 + i % 5)) % N;
  assert_ok(msim_scene_create(alloc, &scene, err));
  assert_ok(msim_scene_add_particles(scene, N, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, M, ij, k, k, NULL, err));
  assert_ok(msim_scene_add_faces(scene, F, faces, err));
  free(x), free(v), free(mass), free(k), free(ij), free(faces);
  return scene;
}

static void parts_are_the_file(void **state) {
  (void)state;
  for (unsigned seed = 1; seed <= 50; seed++) {
    msim_scene *scene = draw_scene(NULL, seed);
    save(scene);
    for (int32_t n = 2; n <= 8; n += 1 + (int32_t)seed % 3) check_parts(scene, n);
    msim_scene_destroy(scene);
  }
  msim_scene *scene = draw_large_scene(NULL);
  save(scene);
  for (int32_t n = 2; n <= 5; n++) check_parts(scene, n);
  msim_scene_destroy(scene);
}

/* Files that ranks read as a whole */
static void check_whole(const char *name, int32_t nranks) {
  msim_scene *whole, *scene;
  assert_ok(msim_scene_load(NULL, name, &whole, err));
  for (int32_t r = 0; r < nranks; r++) {
    assert_ok(msim_scene_load_part(NULL, name, r, nranks, &scene, err));
    assert_null(scene->part);
    assert_true(are_same_scenes(scene->data, whole->data));
    msim_scene_destroy(scene);
  }
  msim_scene_destroy(whole);
}

static void other_scenes_are_whole(void **state) {
  (void)state;
  const msim_law law = {.size = sizeof law, .kind = MSIM_LAW_DEAD_BAND, .half_width = 0.1};
  const int32_t end = 0, ijk[3] = {0, 1, 2};
  const double t[2] = {0, 1}, x[6] = {0}, k = 1;
  const msim_motion motion = {
      .size = sizeof motion, .n = 1, .particles = &end, .nt = 2, .t = t, .x = x};
  msim_scene *scene = hanging_cloth(5, 100, 0);
  save(scene);
  check_whole(path, 1);
  check_whole(path, 26);
  assert_ok(msim_scene_save(scene, "scene.json", err));
  check_whole("scene.json", 2);
  assert_ok(msim_scene_add_angles(scene, 1, ijk, &k, NULL, NULL, err));
  save(scene);
  check_whole(path, 2);
  msim_scene_destroy(scene);
  scene = hanging_cloth(5, 100, 0);
  assert_ok(msim_scene_add_motion(scene, &motion, err));
  save(scene);
  check_whole(path, 2);
  msim_scene_destroy(scene);
  scene = hanging_cloth(5, 100, 0);
  assert_ok(msim_scene_add_law(scene, &law, NULL, err));
  save(scene);
  check_whole(path, 2);
  msim_scene_destroy(scene);
}

/*------------------------------------- memory ---------------------------------------------------*/

/* A particle has 57 bytes and takes 80 while it is read, a spring 32, a face 12; a part of an array
 * 1 MiB. Shorter arrays, as that of masses, are read at once. */
static void memory_falls_with_ranks(void **state) {
  (void)state;
  msim_scene *scene = draw_large_scene(NULL);
  save(scene);
  for (int32_t n = 1; n <= 8; n *= 2)
    for (int32_t r = 0; r < n; r++) {
      const ms_section is = ms_section_of_rank(scene->data, r, n);
      const size_t rows = 57 * (size_t)is.n + 32 * (size_t)is.nsprings + 12 * (size_t)is.nfaces,
                   first = 137 * (size_t)is.n, rest = 1 << 14,
                   masses = 8 * (size_t)scene->data->nparticles;
      peak_allocator m = {0};
      const msim_allocator alloc = {sizeof alloc, peak_allocator_alloc, peak_allocator_free, &m};
      msim_scene *part;
      assert_ok(msim_scene_load_part(&alloc, path, r, n, &part, err));
      assert_true(m.live <= rows + rest);
      assert_true(m.peak <= (rows > first ? rows : first) + masses + (1 << 20) + rest);
      msim_scene_destroy(part);
      assert_int_equal(m.live, 0);
    }
  msim_scene_destroy(scene);
}

/*------------------------------------- failures -------------------------------------------------*/

static void each_allocation_of_a_load_fails(void **state) {
  (void)state;
  msim_scene *scene = draw_large_scene(NULL), *part;
  save(scene);
  counting_allocator count = {.fail_at = -1};
  const msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free,
                                &count};
  int64_t fail_at = 0;
  for (msim_status status = MSIM_ERR_MEMORY; status; fail_at++) {
    msim_error why;
    count.calls = 0, count.fail_at = fail_at;
    status = msim_scene_load_part(&alloc, path, 1, 3, &part, &why);
    if (!status) msim_scene_destroy(part);
    else assert_int_equal(status, MSIM_ERR_MEMORY);
    if (status) assert_non_null(strstr(why.text, "out of memory"));
    assert_int_equal(count.live, 0);
  }
  assert_true(fail_at > 30);
  msim_scene_destroy(scene);
}

int main(void) {
  char folder[] = "/tmp/msim_rank_load_XXXXXX";
  if (!mkdtemp(folder) || chdir(folder)) return 1;
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(parts_are_the_file),
      cmocka_unit_test(other_scenes_are_whole),
      cmocka_unit_test(memory_falls_with_ranks),
      cmocka_unit_test(each_allocation_of_a_load_fails),
  };
  const int failed = cmocka_run_group_tests(tests, NULL, NULL);
  for (const char *const *name = (const char *[]){path, "scene.json", NULL}; *name; name++)
    remove(*name);
  return chdir("/") || rmdir(folder) || failed;
}
