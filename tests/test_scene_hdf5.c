/* Tests of scenes in HDF5 files: equal to the same scenes in JSON, unchanged bit by bit when
 * written and read back, refused with the same messages, and without access to other files. */
#define _POSIX_C_SOURCE 200809L /* mkdtemp */
#include <errno.h>
#include <hdf5.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <sys/resource.h>
#include <unistd.h>

#include "scene_check.h"
#include "scenes.h"

/* libhdf5 leaks memory of a file that it could not write. */
const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void) { return "leak:libhdf5"; }

/*------------------------------------- files ----------------------------------------------------*/

static char folder[] = "/tmp/msim_test_XXXXXX";

static int enter(void **state) {
  (void)state;
  H5Eset_auto2(H5E_DEFAULT, NULL, NULL); /* no messages where a missing link is looked up */
  return mkdtemp(folder) && chdir(folder) == 0 ? 0 : -1;
}

static int leave(void **state) {
  (void)state;
  remove("a.h5");
  return chdir("/") == 0 && rmdir(folder) == 0 ? 0 : -1;
}

/* A dataset from native numbers; a negative number ends dims. */
static void put(hid_t file, const char *path, hid_t type, const hssize_t *dims, const void *data) {
  hsize_t extent[4];
  int rank = 0;
  for (; dims[rank] >= 0; rank++) extent[rank] = (hsize_t)dims[rank];
  hid_t space = rank ? H5Screate_simple(rank, extent, NULL) : H5Screate(H5S_SCALAR);
  hid_t link = H5Pcreate(H5P_LINK_CREATE);
  H5Pset_create_intermediate_group(link, 1);
  if (H5Lexists(file, path, H5P_DEFAULT) > 0) H5Ldelete(file, path, H5P_DEFAULT);
  hid_t set = H5Dcreate2(file, path, type, space, link, H5P_DEFAULT, H5P_DEFAULT);
  assert_true(set >= 0);
  assert_true(H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) >= 0);
  H5Dclose(set), H5Pclose(link), H5Sclose(space);
}

#define DIMS(...)               ((const hssize_t[]){__VA_ARGS__, -1})
#define SCALAR                  ((const hssize_t[]){-1})
#define REALS(file, path, ...)  put(file, path, H5T_NATIVE_DOUBLE, __VA_ARGS__)
#define WHOLES(file, path, ...) put(file, path, H5T_NATIVE_INT, __VA_ARGS__)

static void put_text(hid_t file, const char *path, const char *text) {
  hid_t type = H5Tcopy(H5T_C_S1);
  H5Tset_size(type, strlen(text));
  put(file, path, type, SCALAR, text);
  H5Tclose(type);
}

/* Two particles and a spring. */
static void put_base(hid_t file) {
  WHOLES(file, "msim", SCALAR, (int[]){1});
  REALS(file, "particles/x", DIMS(2, 3), (double[]){0, 0, 2, 0.5, 0, 2});
  REALS(file, "particles/mass", DIMS(2), (double[]){1, 0.2});
  WHOLES(file, "springs/ij", DIMS(1, 2), (int[]){0, 1});
  REALS(file, "springs/k", SCALAR, (double[]){500});
}

typedef void mangler(hid_t file);

static void write_with(mangler *mangle) {
  hid_t file = H5Fcreate("a.h5", H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  assert_true(file >= 0);
  put_base(file);
  if (mangle) mangle(file);
  assert_true(H5Fclose(file) >= 0);
}

/*------------------------------------- content --------------------------------------------------*/

/* Strings belong to the scenes, and are compared as strings. */
static void assert_same_run(const msim_scene *one, const msim_scene *other) {
  msim_options a, b;
  msim_options_init(&a, sizeof a);
  msim_options_init(&b, sizeof b);
  assert_ok(msim_options_from_scene(&a, one, err));
  assert_ok(msim_options_from_scene(&b, other, err));
  assert_string_equal(a.integrator, b.integrator);
  assert_string_equal(a.solver, b.solver);
  a.integrator = b.integrator, a.solver = b.solver;
  assert_memory_equal(&a, &b, sizeof a);
}

/* In a superblock of version 0 the 8 bytes at offset 40 are the address of the end. */
static void assert_ends_where_it_says(const char *path) {
  uint64_t end = 0;
  FILE *file = fopen(path, "rb");
  assert_int_equal(fseek(file, 40, SEEK_SET), 0);
  assert_int_equal(fread(&end, sizeof end, 1, file), 1);
  assert_int_equal(fseek(file, 0, SEEK_END), 0);
  assert_int_equal(ftell(file), end);
  fclose(file);
}

static void scenes_come_back_to_the_bit(void **state) {
  (void)state;
  msim_scene *json, *hdf5;
  for (size_t i = 0; (json = load_shipped_scene(i)) != NULL; i++) {
    assert_ok(msim_scene_save(json, "a.h5", err));
    assert_ends_where_it_says("a.h5");
    assert_ok(msim_scene_load(NULL, "a.h5", &hdf5, err));
    assert_int_equal(access("a.h5.part", F_OK), -1);
    assert_same_bits(json, hdf5);
    assert_same_run(json, hdf5);
    msim_scene_destroy(json);
    msim_scene_destroy(hdf5);
  }
}

/* One of each type, and one with none but the keys that are required */
static void colliders_come_back_to_the_bit(void **state) {
  (void)state;
  static const char text[] =
      "{\"msim\": 1, \"particles\": {\"x\": [[0,0,2]], \"mass\": 1}, \"planes_constrain\": true,"
      "\"colliders\": ["
      "{\"type\": \"sphere\", \"center\": [0.1,2,3], \"radius\": 0.3, \"inside\": true},"
      "{\"type\": \"capsule\", \"from\": [1,2,3], \"to\": [4,5,6], \"radius\": 0.3},"
      "{\"type\": \"cylinder\", \"from\": [1,2,3], \"to\": [4,5,6], \"radius\": 0.3,"
      "\"restitution\": 0.7, \"friction\": 0.1, \"inside\": false},"
      "{\"type\": \"box\", \"center\": [1,2,3], \"size\": [4,5,6], \"rotation\": [0.1,0.2,0.3]}]}";
  msim_scene *json, *hdf5;
  assert_ok(msim_scene_parse(NULL, "text", text, sizeof text - 1, &json, err));
  assert_ok(msim_scene_save(json, "a.h5", err));
  assert_ok(msim_scene_load(NULL, "a.h5", &hdf5, err));
  assert_same_bits(json, hdf5);
  msim_scene_destroy(json);
  msim_scene_destroy(hdf5);
}

/* Other number types than msim writes, lists as groups, a name among the pinned. */
static void mangle_other_types(hid_t file) {
  put(file, "gravity", H5T_NATIVE_FLOAT, DIMS(3), (float[]){0, 0, -10});
  put(file, "particles/pinned", H5T_NATIVE_UINT8, DIMS(1), (uint8_t[]){1});
  put_text(file, "objects/0/type", "cloth");
  WHOLES(file, "objects/0/n", DIMS(2), (int[]){3, 4});
  WHOLES(file, "objects/0/origin", DIMS(3), (int[]){0, 0, 1});
  WHOLES(file, "objects/0/row", DIMS(3), (int[]){1, 0, 0});
  WHOLES(file, "objects/0/column", DIMS(3), (int[]){0, 1, 0});
  WHOLES(file, "objects/0/mass", SCALAR, (int[]){1});
  REALS(file, "objects/0/k/shear", SCALAR, (double[]){10});
  put_text(file, "objects/0/pinned/0", "first_corners");
  WHOLES(file, "objects/0/pinned/1", SCALAR, (int[]){5});
  WHOLES(file, "planes/0/normal", DIMS(3), (int[]){0, 0, 2});
  WHOLES(file, "planes/0/offset", SCALAR, (int[]){-4});
  REALS(file, "run/h", SCALAR, (double[]){0.25});
  put_text(file, "run/integrator", "heun");
}

static void it_means_what_the_json_means(void **state) {
  (void)state;
  static const char text[] =
      "{\"msim\": 1, \"gravity\": [0, 0, -10], \"particles\": {\"x\": [[0,0,2],[0.5,0,2]],"
      "\"mass\": [1, 0.2], \"pinned\": [1]}, \"springs\": {\"ij\": [[0, 1]], \"k\": 500},"
      "\"objects\": [{\"type\": \"cloth\", \"n\": [3, 4], \"origin\": [0,0,1], \"row\": [1,0,0],"
      "\"column\": [0,1,0], \"mass\": 1, \"k\": {\"shear\": 10}, \"pinned\": [\"first_corners\", 5]"
      "}], \"planes\": [{\"normal\": [0,0,2], \"offset\": -4}],"
      "\"run\": {\"h\": 0.25, \"integrator\": \"heun\"}}";
  msim_scene *json, *hdf5;
  write_with(mangle_other_types);
  assert_ok(msim_scene_parse(NULL, "text", text, sizeof text - 1, &json, err));
  assert_ok(msim_scene_load(NULL, "a.h5", &hdf5, err));
  assert_same_bits(json, hdf5);
  assert_same_run(json, hdf5);
  msim_scene_destroy(json);
  msim_scene_destroy(hdf5);
}

/*------------------------------------- refusals -------------------------------------------------*/

static void no_version(hid_t f) { H5Ldelete(f, "msim", H5P_DEFAULT); }
static void unknown_key(hid_t f) { put_text(f, "gravitiy", "down"); }
static void infinite(hid_t f) {
  REALS(f, "particles/x", DIMS(2, 3), (double[]){0, 0, 2, HUGE_VAL, 0, 2});
}
static void bad_mass(hid_t f) { REALS(f, "particles/mass", DIMS(2), (double[]){1, -0.5}); }
static void no_list_of_rows(hid_t f) {
  REALS(f, "particles/x", DIMS(6), (double[]){0, 0, 2, 0.5, 0, 2});
}
static void narrow(hid_t f) { REALS(f, "particles/x", DIMS(3, 2), (double[]){0, 0, 2, 0.5, 0, 2}); }
static void out_of_range(hid_t f) { WHOLES(f, "springs/ij", DIMS(1, 2), (int[]){0, 2}); }
static void real_index(hid_t f) { REALS(f, "springs/ij", DIMS(1, 2), (double[]){0, 1}); }
static void scalar_list(hid_t f) { REALS(f, "particles/x", SCALAR, (double[]){1}); }
static void text_for_number(hid_t f) { put_text(f, "springs/k", "stiff"); }
static void gap_in_list(hid_t f) { WHOLES(f, "planes/1/offset", SCALAR, (int[]){0}); }
static void inside_two(hid_t f) {
  put_text(f, "colliders/0/type", "sphere");
  REALS(f, "colliders/0/center", DIMS(3), (double[]){0, 0, 0});
  REALS(f, "colliders/0/radius", SCALAR, (double[]){1});
  WHOLES(f, "colliders/0/inside", SCALAR, (int[]){2});
}
static void not_utf8(hid_t f) { put_text(f, "name", "a\xff"); }
static void plugin_path(hid_t f) { put_text(f, "run/plugin_path", "/tmp"); }
static void bad_option(hid_t f) { REALS(f, "run/h", SCALAR, (double[]){-1}); }

static void soft_link(hid_t f) {
  H5Lcreate_soft("/particles/x", f, "particles/v", H5P_DEFAULT, H5P_DEFAULT);
}
static void soft_cycle(hid_t f) {
  H5Lcreate_soft("/objects", f, "objects", H5P_DEFAULT, H5P_DEFAULT);
}
static void hard_cycle(hid_t f) { H5Lcreate_hard(f, "/", f, "objects", H5P_DEFAULT, H5P_DEFAULT); }
static void external_link(hid_t f) {
  H5Lcreate_external("/etc/passwd", "/", f, "objects", H5P_DEFAULT, H5P_DEFAULT);
}
static void named_type(hid_t f) {
  hid_t type = H5Tcopy(H5T_NATIVE_INT);
  H5Tcommit2(f, "name", type, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  H5Tclose(type);
}

/* One group under many names, on three levels. */
static void many_names(hid_t f) {
  hid_t group = f;
  for (int level = 0; level < 3; level++) {
    char name[24];
    hid_t inner = H5Gcreate2(group, "0", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    for (int i = 1; i < 100; i++) {
      snprintf(name, sizeof name, "%d", i);
      H5Lcreate_hard(group, "0", group, name, H5P_DEFAULT, H5P_DEFAULT);
    }
    if (group != f) H5Gclose(group);
    group = inner;
  }
  H5Gclose(group);
}

/* A dataset that is never written, with the creation properties `plan`. */
static void plan_only(hid_t f, const char *path, hid_t type, hid_t plan, const hssize_t *dims) {
  hsize_t extent[4];
  int rank = 0;
  for (; dims[rank] >= 0; rank++) extent[rank] = (hsize_t)dims[rank];
  hid_t space = H5Screate_simple(rank, extent, NULL);
  if (H5Lexists(f, path, H5P_DEFAULT) > 0) H5Ldelete(f, path, H5P_DEFAULT);
  hid_t set = H5Dcreate2(f, path, type, space, H5P_DEFAULT, plan, H5P_DEFAULT);
  assert_true(set >= 0);
  H5Dclose(set), H5Sclose(space), H5Pclose(plan);
}

static hid_t plan_chunks(hsize_t rows) {
  hid_t plan = H5Pcreate(H5P_DATASET_CREATE);
  H5Pset_chunk(plan, 2, (hsize_t[]){rows, 3});
  return plan;
}

static void external_data(hid_t f) {
  hid_t plan = H5Pcreate(H5P_DATASET_CREATE);
  H5Pset_external(plan, "/etc/passwd", 0, 48);
  plan_only(f, "particles/v", H5T_NATIVE_DOUBLE, plan, DIMS(2, 3));
}
static void virtual_data(hid_t f) {
  hid_t plan = H5Pcreate(H5P_DATASET_CREATE), space = H5Screate_simple(2, (hsize_t[]){2, 3}, NULL);
  H5Pset_virtual(plan, space, "/etc/passwd", "x", space);
  plan_only(f, "particles/v", H5T_NATIVE_DOUBLE, plan, DIMS(2, 3));
  H5Sclose(space);
}
static void other_filter(hid_t f) {
  hid_t plan = plan_chunks(1);
  H5Pset_fletcher32(plan);
  plan_only(f, "particles/v", H5T_NATIVE_DOUBLE, plan, DIMS(2, 3));
}
static void never_written(hid_t f) {
  plan_only(f, "particles/v", H5T_NATIVE_DOUBLE, H5Pcreate(H5P_DATASET_CREATE), DIMS(2, 3));
}
static void huge(hid_t f) {
  hid_t plan = plan_chunks(1000);
  H5Pset_deflate(plan, 9);
  plan_only(f, "particles/x", H5T_NATIVE_DOUBLE, plan, DIMS(INT64_C(1) << 60, 3));
}
static void texts(hid_t f) {
  hid_t type = H5Tcopy(H5T_C_S1);
  H5Tset_size(type, H5T_VARIABLE);
  put(f, "name", type, SCALAR, (const char *[]){"abc"});
  H5Tclose(type);
}
static void array_of_texts(hid_t f) { put(f, "name", H5T_C_S1, DIMS(3), "abc"); }
static void compound(hid_t f) {
  hid_t type = H5Tcreate(H5T_COMPOUND, 8);
  H5Tinsert(type, "a", 0, H5T_NATIVE_DOUBLE);
  put(f, "drag", type, SCALAR, (double[]){1});
  H5Tclose(type);
}
static void long_double(hid_t f) { put(f, "drag", H5T_NATIVE_LDOUBLE, SCALAR, (long double[]){1}); }
static void four_dimensions(hid_t f) {
  REALS(f, "particles/x", DIMS(1, 1, 2, 3), (double[]){0, 0, 2, 0.5, 0, 2});
}
static void cube_of_rows(hid_t f) { REALS(f, "particles/v", DIMS(2, 3, 1), (double[6]){0}); }
static void no_space(hid_t f) {
  hid_t space = H5Screate(H5S_NULL);
  H5Dclose(H5Dcreate2(f, "drag", H5T_NATIVE_DOUBLE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
  H5Sclose(space);
}
static void deep(hid_t f) { WHOLES(f, "objects/0/k/shear/deep/er", SCALAR, (int[]){1}); }
static void long_name(hid_t f) {
  char name[400] = {0};
  memset(name, 'a', sizeof name - 1);
  put_text(f, name, "b");
}

static const struct {
  mangler *mangle;
  const char *words;
} cases[] = {
    {no_version, "a.h5: msim is missing; it must be 1"},
    {unknown_key, "gravitiy is an unknown key (did you mean 'gravity'?); the keys are msim, name"},
    {infinite, "particles.x[1][0] is inf; it must be a finite number"},
    {bad_mass, "particles.mass[1] is -0.5; it must be a finite number > 0"},
    {no_list_of_rows, "particles.x[0] is 0.0; it must be an array of 3"},
    {narrow, "particles.x[0] is an array of 2; it must be an array of 3"},
    {out_of_range, "springs.ij[0][1] is 2; it must be a whole number from 0 to 1"},
    {real_index, "springs.ij[0][0] is 0.0; it must be a whole number"},
    {scalar_list, "particles.x is 1.0; it must be an array"},
    {text_for_number, "springs.k is \"stiff\"; it must be a finite number >= 0"},
    {gap_in_list, "planes is an object; it must be an array"},
    {inside_two, "colliders[0].inside is 2; it must be 0 or 1"},
    {not_utf8, "name is not valid UTF-8"},
    {plugin_path, "run.plugin_path is not allowed in scene files"},
    {bad_option, "run.h is '-1'; it must be"},
    {soft_link, "particles/v is a soft link"},
    {soft_cycle, "objects is a soft link"},
    {hard_cycle, "is nested too deeply"},
    {external_link, "objects is a link to another file"},
    {named_type, "name is neither a group nor a dataset"},
    {many_names, "exceeds the number of members possible in a file of this size"},
    {external_data, "particles/v has its data in another file"},
    {virtual_data, "particles/v is a virtual dataset"},
    {other_filter, "particles/v uses an unsupported filter"},
    {never_written, "particles/v has more data than the file contains"},
    {huge, "particles/x has more data than the file contains"},
    {texts, "name is a string of variable length; it must have a fixed length"},
    {array_of_texts, "name is an array of strings"},
    {compound, "drag has an unsupported type"},
    {long_double, "drag has an unsupported type"},
    {four_dimensions, "particles/x has more than three dimensions"},
    {cube_of_rows, "particles.v[0][0] is an array of 1; it must be a finite number"},
    {no_space, "drag is empty"},
    {deep, "objects/0/k/shear is nested too deeply"},
    {long_name, "is too long a path"},
};

static void what_is_wrong_is_named(void **state) {
  (void)state;
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    msim_error err;
    msim_scene *scene = (msim_scene *)&err;
    write_with(cases[i].mangle);
    const msim_status status = msim_scene_load(NULL, "a.h5", &scene, &err);
    if (status != MSIM_ERR_ARG || scene || !strstr(err.text, cases[i].words))
      fail_msg("status %d, \"%s\"; wanted \"%s\"", (int)status, err.text, cases[i].words);
  }
}

/*------------------------------------- memory and files -----------------------------------------*/

static msim_status load_and_save(const msim_allocator *alloc, void *data) {
  (void)data;
  msim_scene *scene;
  msim_status status = msim_scene_load(alloc, "a.h5", &scene, NULL);
  if (!status) status = msim_scene_save(scene, "a.h5", NULL);
  msim_scene_destroy(scene);
  return status;
}

static void want_of_memory_leaves_nothing(void **state) {
  (void)state;
  write_with(mangle_other_types);
  assert_true(expect_memory_errors(load_and_save, NULL) > 20);
}

static void what_is_no_hdf5_is_refused(void **state) {
  (void)state;
  msim_error err;
  msim_scene *scene;
  FILE *file = fopen("a.h5", "w");
  fputs("{\"msim\": 1}", file);
  fclose(file);
  assert_int_equal(msim_scene_load(NULL, "a.h5", &scene, &err), MSIM_ERR_BACKEND);
  assert_string_equal(err.text, "a.h5: cannot read it as HDF5: file signature not found");
}

/* The old file stays. */
static void a_full_disk_is_seen_before_anything_is_written(void **state) {
  (void)state;
  write_with(NULL);
  msim_error err;
  msim_scene *scene, *again;
  assert_int_equal(msim_scene_load(NULL, "a.h5", &scene, &err), MSIM_OK);
  struct rlimit limit, small;
  assert_int_equal(getrlimit(RLIMIT_FSIZE, &limit), 0);
  small = limit;
  small.rlim_cur = 10000;
  signal(SIGXFSZ, SIG_IGN);
  setrlimit(RLIMIT_FSIZE, &small);
  const msim_status status = msim_scene_save(scene, "a.h5", &err);
  setrlimit(RLIMIT_FSIZE, &limit);
  assert_int_equal(status, MSIM_ERR_IO);
  assert_string_equal(err.text, "a.h5: cannot be written: File too large");
  assert_int_equal(access("a.h5.part", F_OK), -1);
  assert_int_equal(msim_scene_load(NULL, "a.h5", &again, &err), MSIM_OK);
  assert_same_bits(scene, again);
  msim_scene_destroy(scene);
  msim_scene_destroy(again);
}

static void without_the_plugin_it_is_named(void **state) {
  (void)state;
  msim_error err;
  msim_scene *scene;
  msim_plugin_entry entry = {.size = sizeof entry};
  assert_int_equal(msim_importer_info(0, NULL, &entry, &err), 1);
  assert_string_equal(entry.name, "hdf5");
  assert_true(entry.available);
  const char *path = getenv("MSIM_PLUGIN_PATH");
  if (!path || strcmp(entry.note, "built in") == 0) return;
  char *kept = strdup(path);
  write_with(NULL);
  setenv("MSIM_PLUGIN_PATH", "/nowhere", 1);
  const msim_status status = msim_scene_load(NULL, "a.h5", &scene, &err);
  setenv("MSIM_PLUGIN_PATH", kept, 1);
  free(kept);
  if (status == MSIM_OK) { /* linked in */
    msim_scene_destroy(scene);
    return;
  }
  assert_int_equal(status, MSIM_ERR_NAME);
  assert_non_null(
      strstr(err.text, "a.h5: importer 'hdf5': msim_importer_hdf5.so was not found in /nowhere"));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(scenes_come_back_to_the_bit),
      cmocka_unit_test(colliders_come_back_to_the_bit),
      cmocka_unit_test(it_means_what_the_json_means),
      cmocka_unit_test(what_is_wrong_is_named),
      cmocka_unit_test(want_of_memory_leaves_nothing),
      cmocka_unit_test(what_is_no_hdf5_is_refused),
      cmocka_unit_test(a_full_disk_is_seen_before_anything_is_written),
      cmocka_unit_test(without_the_plugin_it_is_named),
  };
  return cmocka_run_group_tests_name("scene_hdf5", tests, enter, leave);
}
