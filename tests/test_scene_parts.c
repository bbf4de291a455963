/* Tests of large scenes in HDF5 files, whose arrays are read in parts: the numbers of the whole,
 * errors that name their place, bytes counted, files that change while they are read. */
#define _POSIX_C_SOURCE 200809L /* mkdtemp */
#include <hdf5.h>
#include <stdio.h>
#include <unistd.h>

#include "counting_allocator.h"
#include "peak_allocator.h"
#include "scene_check.h"
#include "scenes.h"

/*------------------------------------- files ----------------------------------------------------*/

static char folder[] = "/tmp/msim_test_XXXXXX";
static msim_scene *whole;

/* Arrays of more than 2^17 numbers are read in parts: x, v, force, ij, k, rest and damping, while
 * masses and faces are not. */
enum { PARTICLES = 44000, SPRINGS = 140000, FACES = 40000 };

static msim_scene *make_net(void) {
  unsigned seed = 3;
  double *x = malloc(3 * PARTICLES * sizeof *x), *v = malloc(3 * PARTICLES * sizeof *v),
         *mass = malloc(PARTICLES * sizeof *mass),
         *of_springs = malloc(3 * SPRINGS * sizeof(double));
  int32_t *ij = malloc(2 * SPRINGS * sizeof *ij), *face = malloc(3 * FACES * sizeof *face);
  msim_scene *scene = make_empty_scene();
  assert_true(x && v && mass && of_springs && ij && face);
  for (int32_t i = 0; i < 3 * PARTICLES; i++) x[i] = uniform(&seed), v[i] = i < 3 ? 0 : x[i] - 0.5;
  for (int32_t i = 0; i < PARTICLES; i++) mass[i] = 1 + uniform(&seed);
  for (int32_t e = 0; e < SPRINGS; e++)
    ij[2 * e] = e % PARTICLES, ij[2 * e + 1] = (e + 1 + e / PARTICLES) % PARTICLES;
  for (int32_t e = 0; e < 3 * SPRINGS; e++) of_springs[e] = uniform(&seed);
  for (int32_t i = 0; i < 3 * FACES; i++) face[i] = (i / 3 + i % 3) % PARTICLES;
  assert_ok(msim_scene_add_particles(scene, PARTICLES, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, SPRINGS, ij, of_springs, of_springs + SPRINGS,
                                   of_springs + 2 * SPRINGS, err));
  assert_ok(msim_scene_add_faces(scene, FACES, face, err));
  assert_ok(msim_scene_set_forces(scene, v, err));
  assert_ok(msim_scene_pin(scene, 1, &(int32_t){0}, err));
  free(x), free(v), free(mass), free(of_springs), free(ij), free(face);
  return scene;
}

static int enter(void **state) {
  (void)state;
  H5Eset_auto2(H5E_DEFAULT, NULL, NULL);
  if (!mkdtemp(folder) || chdir(folder)) return -1;
  whole = make_net();
  return msim_scene_save(whole, "whole.h5", NULL);
}

static int leave(void **state) {
  (void)state;
  msim_scene_destroy(whole);
  const char *const names[] = {"a.h5", "b.h5", "b.json", "whole.h5", "other.h5"};
  for (size_t i = 0; i < sizeof names / sizeof *names; i++) remove(names[i]);
  return chdir("/") == 0 && rmdir(folder) == 0 ? 0 : -1;
}

static void copy_file(const char *from, const char *to) {
  static char bytes[1 << 16];
  FILE *in = fopen(from, "rb"), *out = fopen(to, "wb");
  assert_true(in && out);
  for (size_t n; (n = fread(bytes, 1, sizeof bytes, in)) > 0;)
    assert_int_equal(fwrite(bytes, 1, n, out), n);
  fclose(in);
  assert_int_equal(fclose(out), 0);
}

/* A dataset of native numbers, perhaps in place of another object */
static void put(hid_t file, const char *path, hid_t type, int rank, const hsize_t *dims,
                const hsize_t *chunk, const void *data) {
  hid_t space = H5Screate_simple(rank, dims, NULL), create = H5Pcreate(H5P_DATASET_CREATE);
  if (chunk) assert_true(H5Pset_chunk(create, rank, chunk) >= 0);
  if (H5Lexists(file, path, H5P_DEFAULT) > 0) H5Ldelete(file, path, H5P_DEFAULT);
  hid_t set = H5Dcreate2(file, path, type, space, H5P_DEFAULT, create, H5P_DEFAULT);
  assert_true(set >= 0);
  assert_true(H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) >= 0);
  H5Dclose(set), H5Pclose(create), H5Sclose(space);
}

typedef void mangler(hid_t file);

static void write_mangled(const char *path, mangler *mangle) {
  copy_file("whole.h5", path);
  hid_t file = H5Fopen(path, H5F_ACC_RDWR, H5P_DEFAULT);
  assert_true(file >= 0);
  mangle(file);
  assert_true(H5Fclose(file) >= 0);
}

/*------------------------------------- content --------------------------------------------------*/

/* h5py writes other types, and compressed datasets in chunks, which are read at once. */
static void put_other_types(hid_t file) {
  const ms_scene *s = whole->data;
  const hsize_t n = PARTICLES, springs = SPRINGS, chunk[2] = {1000, 3};
  put(file, "springs/ij", H5T_NATIVE_INT32, 2, (hsize_t[]){springs, 2}, NULL, s->ij);
  put(file, "particles/x", H5T_NATIVE_DOUBLE, 2, (hsize_t[]){n, 3}, chunk, s->x);
  put(file, "springs/rest", H5T_NATIVE_DOUBLE, 1, &springs, chunk, s->rest);
}

static void put_nothing(hid_t file) { (void)file; }

static void parts_make_the_whole(void **state) {
  (void)state;
  mangler *const kinds[] = {put_nothing, put_other_types};
  for (int i = 0; i < 2; i++) {
    msim_scene *read;
    write_mangled("a.h5", kinds[i]);
    assert_ok(msim_scene_load(NULL, "a.h5", &read, err));
    assert_same_bits(whole, read);
    assert_memory_equal(whole->data->force, read->data->force, 3 * PARTICLES * sizeof(double));
    msim_scene_destroy(read);
  }
}

/* 81 bytes a particle with forces, 32 a spring, 12 a face. The 7 arrays that are read in parts have
 * 1 MiB each, but not all at a time, which leaves room for those that are read at once. */
static void no_array_is_there_twice(void **state) {
  (void)state;
  peak_allocator m = {0};
  const msim_allocator alloc = {sizeof alloc, peak_allocator_alloc, peak_allocator_free, &m};
  msim_scene *read;
  assert_ok(msim_scene_load(&alloc, "whole.h5", &read, err));
  assert_in_range(m.peak, 1, 81 * PARTICLES + 32 * SPRINGS + 12 * FACES + (7 << 20) + 8192);
  msim_scene_destroy(read);
}

/* 57 bytes a particle, 32 a spring, and as much for the numbers of springs in a small file, which
 * are read at once and freed when the scene has them; faces wait. */
static void numbers_are_freed_when_they_are_read(void **state) {
  (void)state;
  peak_allocator m = {0};
  const msim_allocator alloc = {sizeof alloc, peak_allocator_alloc, peak_allocator_free, &m};
  msim_scene *scene = pinned_block(20, 1, 100, 0), *read;
  const ms_scene *s = scene->data;
  const int64_t bytes = 57 * s->nparticles + 64 * s->nsprings + 24 * s->nfaces + 8192;
  assert_ok(msim_scene_save(scene, "a.h5", err));
  assert_ok(msim_scene_load(&alloc, "a.h5", &read, err));
  assert_in_range(m.peak, 1, bytes);
  msim_scene_destroy(read), msim_scene_destroy(scene);
}

/* A mesh is read at once. */
static void meshes_have_all_vertices(void **state) {
  (void)state;
  enum { SIDE = 210, VERTICES = SIDE * SIDE };
  static const char text[] =
      "{\"msim\": 1,"
      " \"objects\": [{\"type\": \"mesh\", \"file\": \"a.h5\", \"mass\": 1, \"k\": 10}]}";
  const hsize_t dims[2] = {VERTICES, 3};
  double *x = calloc(3 * VERTICES, sizeof *x);
  int32_t *face = malloc(3 * VERTICES * sizeof *face);
  msim_scene *read;
  assert_true(x && face);
  for (int32_t i = 0; i < SIDE; i++)
    for (int32_t j = 0; j < SIDE; j++) x[3 * (SIDE * i + j)] = j, x[3 * (SIDE * i + j) + 1] = i;
  for (int32_t i = 0; i < VERTICES; i++) {
    const int32_t at = i % SIDE == SIDE - 1 ? i - 1 : i, up = at < VERTICES - SIDE ? SIDE : -SIDE;
    face[3 * i] = at, face[3 * i + 1] = at + 1, face[3 * i + 2] = at + up;
  }
  hid_t file = H5Fcreate("a.h5", H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  put(file, "vertices", H5T_NATIVE_DOUBLE, 2, dims, NULL, x);
  put(file, "faces", H5T_NATIVE_INT32, 2, dims, NULL, face);
  assert_true(H5Fclose(file) >= 0);
  FILE *scene = fopen("b.json", "w");
  assert_true(scene && fputs(text, scene) >= 0 && fclose(scene) == 0);
  assert_ok(msim_scene_load(NULL, "b.json", &read, err));
  assert_int_equal(read->data->nparticles, VERTICES);
  assert_memory_equal(read->data->x, x, 3 * VERTICES * sizeof *x);
  msim_scene_destroy(read);
  free(x), free(face);
}

/*------------------------------------- errors ---------------------------------------------------*/

enum { BAD = 139000 };

static void put_bad_stiffness(hid_t file) {
  double *k = malloc(SPRINGS * sizeof *k);
  assert_non_null(k);
  memcpy(k, whole->data->k, SPRINGS * sizeof *k);
  k[BAD] = -1;
  put(file, "springs/k", H5T_NATIVE_DOUBLE, 1, &(hsize_t){SPRINGS}, NULL, k);
  free(k);
}

static void put_bad_end(hid_t file) {
  int32_t *ij = malloc(2 * SPRINGS * sizeof *ij);
  assert_non_null(ij);
  memcpy(ij, whole->data->ij, 2 * SPRINGS * sizeof *ij);
  ij[2 * BAD + 1] = PARTICLES;
  put(file, "springs/ij", H5T_NATIVE_INT32, 2, (hsize_t[]){SPRINGS, 2}, NULL, ij);
  free(ij);
}

static void errors_name_the_place_in_the_whole(void **state) {
  (void)state;
  const struct {
    mangler *mangle;
    const char *text;
  } cases[] = {
      {put_bad_stiffness, "a.h5: springs.k[139000] is -1.0; it must be a finite number >= 0"},
      {put_bad_end,
       "a.h5: springs.ij[139000][1] is 44000; it must be a whole number from 0 to 43999"}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    msim_scene *read;
    msim_error err;
    write_mangled("a.h5", cases[i].mangle);
    assert_int_equal(msim_scene_load(NULL, "a.h5", &read, &err), MSIM_ERR_ARG);
    assert_null(read);
    assert_string_equal(err.text, cases[i].text);
  }
}

static msim_status load_whole(const msim_allocator *alloc, void *data) {
  msim_scene *read = data;
  const msim_status status = msim_scene_load(alloc, "whole.h5", &read, NULL);
  assert_true(!status == !!read);
  msim_scene_destroy(read);
  return status;
}

static void want_of_memory_leaves_nothing(void **state) {
  char any;
  (void)state;
  assert_true(expect_memory_errors(load_whole, &any) > 20);
}

/*------------------------------------- files that change ----------------------------------------*/

/* The file becomes another one in the allocation `fail_at`. */
static void *change_file(size_t bytes, void *user) {
  counting_allocator *m = user;
  if (m->calls++ == m->fail_at && rename("b.h5", "a.h5")) remove("a.h5"); /* without b.h5: gone */
  m->live++;
  return malloc(bytes);
}

static void put_fewer(hid_t file) {
  put(file, "springs/k", H5T_NATIVE_DOUBLE, 1, &(hsize_t){SPRINGS - 1}, NULL, whole->data->k);
}

static void put_group(hid_t file) {
  assert_true(H5Ldelete(file, "springs/k", H5P_DEFAULT) >= 0);
  H5Gclose(H5Gcreate2(file, "springs/k", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
}

static void put_soft_link(hid_t file) {
  assert_true(H5Ldelete(file, "springs/k", H5P_DEFAULT) >= 0);
  assert_true(H5Lcreate_soft("/springs/rest", file, "springs/k", H5P_DEFAULT, H5P_DEFAULT) >= 0);
}

static void put_chunks(hid_t file) {
  put(file, "springs/k", H5T_NATIVE_DOUBLE, 1, &(hsize_t){SPRINGS}, &(hsize_t){1000},
      whole->data->k);
}

static void put_dataset(hid_t file) {
  put(file, "springs", H5T_NATIVE_DOUBLE, 1, &(hsize_t){2}, NULL, (double[]){1, 2});
}

static void remove_it(hid_t file) { assert_true(H5Ldelete(file, "springs/k", H5P_DEFAULT) >= 0); }

/* Returns 1 if the error has these words. */
static int load_changing(int64_t at, const char *words, int64_t *calls) {
  counting_allocator m = {.fail_at = at};
  const msim_allocator alloc = {sizeof alloc, change_file, counting_allocator_free, &m};
  msim_scene *read;
  msim_error err;
  remove("a.h5");
  assert_int_equal(link("whole.h5", "a.h5"), 0);
  if (*words) assert_int_equal(link("other.h5", "b.h5"), 0);
  const msim_status status = msim_scene_load(&alloc, "a.h5", &read, &err);
  assert_true(!status == !!read);
  if (status) assert_int_equal(strncmp(err.text, "a.h5: ", 6), 0);
  msim_scene_destroy(read);
  assert_int_equal(m.live, 0);
  *calls = m.calls;
  remove("b.h5");
  return status && strstr(err.text, words);
}

static void a_file_that_changes_is_an_error(void **state) {
  (void)state;
  const struct {
    mangler *mangle;
    const char *words;
  } kinds[] = {{put_fewer, "springs/k has changed while the file was read"},
               {put_group, "springs/k has changed while the file was read"},
               {put_soft_link, "springs/k is a soft link"},
               {put_chunks, "springs/k has changed while the file was read"},
               {put_dataset, "springs has changed while the file was read"},
               {remove_it, "cannot read springs: "},
               {NULL, ""}}; /* the file is removed */
  for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
    int64_t calls = 1, errors = 0;
    remove("other.h5");
    if (kinds[i].mangle) write_mangled("other.h5", kinds[i].mangle);
    for (int64_t at = 0; at < calls; at += 5) errors += load_changing(at, kinds[i].words, &calls);
    if (errors == 0) fail_msg("kind %zu: no error has the words %s", i, kinds[i].words);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(parts_make_the_whole),
      cmocka_unit_test(no_array_is_there_twice),
      cmocka_unit_test(meshes_have_all_vertices),
      cmocka_unit_test(numbers_are_freed_when_they_are_read),
      cmocka_unit_test(errors_name_the_place_in_the_whole),
      cmocka_unit_test(want_of_memory_leaves_nothing),
      cmocka_unit_test(a_file_that_changes_is_an_error),
  };
  return cmocka_run_group_tests_name("scene_parts", tests, enter, leave);
}
