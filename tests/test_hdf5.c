/* Tests of the recorder plugin hdf5: files hold what was recorded, in the layout of VTKHDF.
 *
 *   test_hdf5                           the tests
 *   test_hdf5 write BASE                BASE.vtkhdf, BASE.csv and BASE.json, for vtk_read.py
 *   test_hdf5 verify FILE               prints "GOOD of PLANNED"; status 1 if anything is wrong */
#define _DEFAULT_SOURCE /* mkdtemp */

#include <inttypes.h>
#include <pthread.h>

#include "trajectory.h"
#include "record/csv.h"

static counting_host host;

/*------------------------------------- content and layout ---------------------------------------*/

/* The file remains; the caller removes it. */
static void write_file(const char *path, int32_t n, int32_t nsprings, int64_t planned,
                       int64_t written) {
  const msim_recorder_type *hdf5 = find_hdf5_recorder();
  sample_trajectory s;
  host_init(&host);
  sample_init(&s, path, n, nsprings, planned);
  if (record(hdf5, &host.host, &s, written) != MSIM_OK) fail_msg("%s", host.sentence);
  assert_int_equal(host.live, 0);
  assert_trajectory_valid(path, written, planned);
  sample_free(&s);
}

static void write_and_verify(int32_t n, int32_t nsprings, int64_t planned, int64_t written) {
  write_file("a.vtkhdf", n, nsprings, planned, written);
  remove("a.vtkhdf");
}

static void all_planned_frames(void **state) {
  (void)state;
  write_and_verify(20, 30, 12, 12);
}

static void fewer_frames_than_planned(void **state) {
  (void)state;
  write_and_verify(20, 30, 12, 5);
  write_and_verify(20, 30, 12, 0);
}

static void one_frame(void **state) {
  (void)state;
  write_and_verify(2, 1, 1, 1);
}

static void no_springs(void **state) {
  (void)state;
  write_and_verify(7, 0, 3, 3);
}

static void no_particles(void **state) {
  (void)state;
  write_and_verify(0, 0, 3, 3);
}

/* More rows than a block of 256, and frames that are split into several chunks. */
static void many_frames_and_large_frames(void **state) {
  (void)state;
  write_and_verify(3, 2, 1000, 1000);
  write_and_verify(100001, 2000, 3, 3);
}

static const struct {
  const char *path;
  int rank;
  hsize_t dims[2];
} layout[] = {
    /* 20 particles, 30 springs, 9 faces, 12 frames */
    {"/VTKHDF/NumberOfPoints", 1, {2, 0}},
    {"/VTKHDF/Points", 2, {240, 3}},
    {"/VTKHDF/PointData/Velocity", 2, {240, 3}},
    {"/VTKHDF/PointData/Mass", 1, {20, 0}},
    {"/VTKHDF/PointData/Pinned", 1, {20, 0}},
    {"/VTKHDF/CellData/Stiffness", 1, {39, 0}},
    {"/VTKHDF/CellData/RestLength", 1, {39, 0}},
    {"/VTKHDF/CellData/Damping", 1, {39, 0}},
    {"/VTKHDF/CellData/Strain", 1, {468, 0}},
    {"/VTKHDF/CellData/Tension", 1, {468, 0}},
    {"/VTKHDF/FieldData/KineticEnergy", 1, {12, 0}},
    {"/VTKHDF/FieldData/PotentialEnergy", 1, {12, 0}},
    {"/VTKHDF/FieldData/ElasticEnergy", 1, {12, 0}},
    {"/VTKHDF/FieldData/GravitationalEnergy", 1, {12, 0}},
    {"/VTKHDF/Lines/NumberOfCells", 1, {2, 0}},
    {"/VTKHDF/Lines/NumberOfConnectivityIds", 1, {2, 0}},
    {"/VTKHDF/Lines/Connectivity", 1, {60, 0}},
    {"/VTKHDF/Lines/Offsets", 1, {32, 0}},
    {"/VTKHDF/Vertices/NumberOfCells", 1, {2, 0}},
    {"/VTKHDF/Vertices/NumberOfConnectivityIds", 1, {2, 0}},
    {"/VTKHDF/Vertices/Connectivity", 1, {0, 0}},
    {"/VTKHDF/Vertices/Offsets", 1, {2, 0}},
    {"/VTKHDF/Polygons/NumberOfCells", 1, {2, 0}},
    {"/VTKHDF/Polygons/NumberOfConnectivityIds", 1, {2, 0}},
    {"/VTKHDF/Polygons/Connectivity", 1, {27, 0}},
    {"/VTKHDF/Polygons/Offsets", 1, {11, 0}},
    {"/VTKHDF/Strips/Offsets", 1, {2, 0}},
    {"/VTKHDF/Steps/Values", 1, {12, 0}},
    {"/VTKHDF/Steps/PartOffsets", 1, {12, 0}},
    {"/VTKHDF/Steps/NumberOfParts", 1, {12, 0}},
    {"/VTKHDF/Steps/PointOffsets", 1, {12, 0}},
    {"/VTKHDF/Steps/CellOffsets", 2, {12, 4}},
    {"/VTKHDF/Steps/ConnectivityIdOffsets", 2, {12, 4}},
    {"/VTKHDF/Steps/PointDataOffsets/Velocity", 1, {12, 0}},
    {"/VTKHDF/Steps/PointDataOffsets/Mass", 1, {12, 0}},
    {"/VTKHDF/Steps/PointDataOffsets/Pinned", 1, {12, 0}},
    {"/VTKHDF/Steps/CellDataOffsets/Stiffness", 1, {12, 0}},
    {"/VTKHDF/Steps/CellDataOffsets/RestLength", 1, {12, 0}},
    {"/VTKHDF/Steps/CellDataOffsets/Damping", 1, {12, 0}},
    {"/VTKHDF/Steps/CellDataOffsets/Strain", 1, {12, 0}},
    {"/VTKHDF/Steps/CellDataOffsets/Tension", 1, {12, 0}},
    {"/VTKHDF/Steps/FieldDataOffsets/KineticEnergy", 1, {12, 0}},
    {"/VTKHDF/Steps/FieldDataOffsets/PotentialEnergy", 1, {12, 0}},
    {"/VTKHDF/Steps/FieldDataOffsets/ElasticEnergy", 1, {12, 0}},
    {"/VTKHDF/Steps/FieldDataOffsets/GravitationalEnergy", 1, {12, 0}},
    {"/msim/frames/time", 1, {12, 0}},
    {"/msim/frames/step", 1, {12, 0}},
    {"/msim/frames/hash", 1, {12, 0}},
    {"/msim/frames/NCommitted", 1, {1, 0}},
    {"/msim/scene", 1, {30, 0}},
    {"/msim/planes", 2, {2, 6}},
    {"/msim/checkpoint/0", 1, {130, 0}}, /* 4 words, and 1003 bytes */
    {"/msim/checkpoint/1", 1, {130, 0}},
};

static void assert_text(hid_t file, const char *group, const char *name, const char *expected) {
  char text[64] = "";
  hid_t attribute = H5Aopen_by_name(file, group, name, H5P_DEFAULT, H5P_DEFAULT);
  hid_t type = H5Aget_type(attribute);
  assert_int_equal(H5Tis_variable_str(type), 0); /* VTK before 9.5 refuses anything else */
  assert_int_equal(H5Tget_cset(type), H5T_CSET_ASCII);
  assert_int_equal(H5Tget_strpad(type), H5T_STR_NULLPAD);
  assert_int_equal(H5Tget_size(type), strlen(expected));
  assert_true(H5Aread(attribute, type, text) >= 0);
  assert_string_equal(text, expected);
  H5Tclose(type);
  H5Aclose(attribute);
}

static void the_layout_is_that_of_vtkhdf(void **state) {
  (void)state;
  write_file("b.vtkhdf", 20, 30, 12, 12);
  hid_t file = open_trajectory("b.vtkhdf");
  for (size_t i = 0; i < sizeof layout / sizeof *layout; i++) {
    hsize_t dims[2];
    if (dataset_extent(file, layout[i].path, dims) != layout[i].rank ||
        dims[0] != layout[i].dims[0] || dims[1] != layout[i].dims[1])
      fail_msg("%s is %d x %d", layout[i].path, (int)dims[0], (int)dims[1]);
  }
  char creator[32];
  snprintf(creator, sizeof creator, "msim %d.%d.%d", MSIM_VERSION_MAJOR, MSIM_VERSION_MINOR,
           MSIM_VERSION_PATCH);
  assert_text(file, "/VTKHDF", "Type", "PolyData");
  assert_text(file, "/msim", "creator", creator);
  assert_int_equal(read_attribute(file, "/VTKHDF", "Version"), 2);
  assert_int_equal(read_attribute(file, "/msim", "format"), 3);
  H5F_info2_t info;
  assert_true(H5Fget_info2(file, &info) >= 0);
  assert_int_equal(info.super.version, 0); /* no mark "open for writing" remains */
  H5Fclose(file);
  remove("b.vtkhdf");
}

static void assert_column(hid_t file, const char *path, int64_t first, int64_t stride) {
  int64_t count = 0;
  uint64_t *words = read_rows(file, path, 0, -1, &count);
  assert_non_null(words);
  for (int64_t i = 0; i < count; i++) assert_int_equal(words[i], first + i * stride);
  free(words);
}

static void assert_doubles(hid_t file, const char *path, const double *expected) {
  int64_t count = 0;
  uint64_t *words = read_rows(file, path, 0, -1, &count);
  assert_non_null(words);
  assert_memory_equal(words, expected, (size_t)count * sizeof *expected);
  free(words);
}

/* The first values of each frame of columns that have one row per frame or cell */
static void assert_values(hid_t file, const char *path, int64_t row, double expected) {
  int64_t count;
  double *found = (double *)read_rows(file, path, row, 1, &count);
  assert_non_null(found);
  assert_true(*found == expected);
  free(found);
}

static void assert_frame_data(hid_t file, sample_trajectory *s, int64_t frames) {
  const int64_t cells = s->what.nsprings + s->what.nfaces;
  for (int64_t i = 0; i < frames; i++) {
    const msim_frame frame = sample_frame(s, i);
    assert_values(file, "/VTKHDF/FieldData/ElasticEnergy", i, frame.elastic);
    assert_values(file, "/VTKHDF/FieldData/GravitationalEnergy", i, frame.gravitational);
    for (int64_t c = 0; c < cells; c++) {
      assert_values(file, "/VTKHDF/CellData/Strain", i * cells + c, (double)frame.strain[c]);
      assert_values(file, "/VTKHDF/CellData/Tension", i * cells + c, (double)frame.tension[c]);
    }
    int64_t count = 0;
    double *reaction =
        (double *)read_rows(file, "/VTKHDF/PointData/Reaction", i * s->what.n, s->what.n, &count);
    assert_int_equal(count, 3 * s->what.n);
    for (int64_t c = 0; c < count; c++) assert_true(reaction[c] == (double)frame.reaction[c]);
    free(reaction);
  }
}

static void columns_hold_what_was_given(void **state) {
  (void)state;
  write_file("c.vtkhdf", 4, 3, 600, 2);
  sample_trajectory s;
  sample_init(&s, "c.vtkhdf", 4, 3, 600);
  hid_t file = open_trajectory("c.vtkhdf");
  assert_doubles(file, "/VTKHDF/Steps/Values", s.times);
  assert_doubles(file, "/VTKHDF/PointData/Mass", s.mass);
  const double k[] = {s.k[0], s.k[1], s.k[2], 0}, rest[] = {s.rest[0], s.rest[1], s.rest[2], 0};
  const double damping[] = {s.damping[0], s.damping[1], s.damping[2], 0};
  assert_doubles(file, "/VTKHDF/CellData/Stiffness", k); /* 0 for the face */
  assert_doubles(file, "/VTKHDF/CellData/RestLength", rest);
  assert_doubles(file, "/VTKHDF/CellData/Damping", damping);
  assert_doubles(file, "/msim/planes", (const double *)s.what.planes);
  assert_column(file, "/VTKHDF/Polygons/Connectivity", 0, 1);
  assert_column(file, "/VTKHDF/Steps/CellDataOffsets/Strain", 0, 4);
  assert_column(file, "/VTKHDF/Steps/CellDataOffsets/Tension", 0, 4);
  assert_column(file, "/VTKHDF/Steps/FieldDataOffsets/ElasticEnergy", 0, 1);
  assert_column(file, "/msim/frames/NCommitted", 2, 0);
  assert_frame_data(file, &s, 2);
  assert_column(file, "/VTKHDF/Steps/NumberOfParts", 1, 0);
  assert_column(file, "/VTKHDF/Steps/PointOffsets", 0, 4);
  assert_column(file, "/VTKHDF/Steps/PointDataOffsets/Velocity", 0, 4);
  assert_column(file, "/VTKHDF/Steps/PointDataOffsets/Reaction", 0, 4);
  assert_column(file, "/VTKHDF/Steps/PointDataOffsets/Mass", 0, 0);
  assert_column(file, "/VTKHDF/Steps/CellOffsets", 0, 0);
  assert_column(file, "/VTKHDF/Steps/FieldDataOffsets/KineticEnergy", 0, 1);
  assert_column(file, "/VTKHDF/Steps/FieldDataOffsets/PotentialEnergy", 0, 1);
  H5Fclose(file);
  sample_free(&s);
  remove("c.vtkhdf");
}

/* Files without pinned particles have no reactions; those of older hosts that give none have 0. */
static void reactions_are_recorded_where_particles_are_pinned(void **state) {
  (void)state;
  counting_host mine;
  sample_trajectory s;
  hsize_t dims[2];
  for (int pinned = 0; pinned < 2; pinned++) {
    host_init(&mine);
    sample_init(&s, "p.vtkhdf", 4, 3, 5);
    memset(s.pinned, pinned, 4);
    assert_int_equal(record(find_hdf5_recorder(), &mine.host, &s, 5), MSIM_OK);
    assert_trajectory_valid("p.vtkhdf", 5, 5);
    hid_t file = open_trajectory("p.vtkhdf");
    assert_int_equal(dataset_extent(file, "/VTKHDF/PointData/Reaction", dims), pinned ? 2 : -1);
    assert_int_equal(dataset_extent(file, "/VTKHDF/Steps/PointDataOffsets/Reaction", dims),
                     pinned ? 1 : -1);
    H5Fclose(file);
    sample_free(&s);
    remove("p.vtkhdf");
  }
}

static void equal_runs_give_equal_bytes(void **state) {
  (void)state;
  write_file("d.vtkhdf", 20, 30, 300, 290);
  sleep(1); /* a time of day in the file would now differ */
  write_file("e.vtkhdf", 20, 30, 300, 290);
  size_t first, second;
  char *d = read_file("d.vtkhdf", &first), *e = read_file("e.vtkhdf", &second);
  assert_int_equal(first, second);
  assert_memory_equal(d, e, first);
  free(d);
  free(e);
  remove("d.vtkhdf");
  remove("e.vtkhdf");
}

/* Flip a bit of what the hashes cover. */
static void damage_is_noticed(void **state) {
  (void)state;
  static const char *const paths[] = {"/VTKHDF/Points", "/VTKHDF/PointData/Velocity",
                                      "/msim/frames/step", "/VTKHDF/Lines/Connectivity",
                                      "/VTKHDF/PointData/Mass"};
  int64_t planned;
  for (size_t i = 0; i < sizeof paths / sizeof *paths; i++) {
    write_file("f.vtkhdf", 3, 2, 2, 2);
    hid_t file = H5Fopen("f.vtkhdf", H5F_ACC_RDWR, H5P_DEFAULT);
    hid_t dataset = H5Dopen2(file, paths[i], H5P_DEFAULT), type = H5Dget_type(dataset);
    uint64_t words[18];
    assert_true(H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, words) >= 0);
    words[1] ^= 1;
    assert_true(H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, words) >= 0);
    H5Tclose(type);
    H5Dclose(dataset);
    H5Fclose(file);
    assert_true(verify_trajectory("f.vtkhdf", &planned) < 0);
    remove("f.vtkhdf");
  }
}

/*------------------------------------- threads --------------------------------------------------*/

static void *record_in_thread(void *path) {
  sample_trajectory s;
  counting_host mine;
  host_init(&mine);
  sample_init(&s, path, 50, 40, 200);
  msim_status status = record(find_hdf5_recorder(), &mine.host, &s, 200);
  sample_free(&s);
  return status == MSIM_OK && mine.live == 0 ? path : NULL;
}

static void threads_record_side_by_side(void **state) {
  (void)state;
  static char paths[][16] = {"l.vtkhdf", "m.vtkhdf", "n.vtkhdf"};
  pthread_t threads[3];
  for (int i = 0; i < 3; i++) pthread_create(&threads[i], NULL, record_in_thread, paths[i]);
  for (int i = 0; i < 3; i++) {
    void *result;
    pthread_join(threads[i], &result);
    assert_ptr_equal(result, paths[i]);
  }
  for (int i = 0; i < 3; i++) {
    assert_trajectory_valid(paths[i], 200, 200);
    remove(paths[i]);
  }
}

/*------------------------------------- modes for the tests in Python ----------------------------*/

static int report_error(const char *sentence) {
  fprintf(stderr, "%s\n", sentence);
  return 1;
}

static void write_list(FILE *out, const char *key, const double *values, int64_t count) {
  fprintf(out, ",\n\"%s\": [", key);
  for (int64_t i = 0; i < count; i++) fprintf(out, "%s%.17g", i ? ", " : "", values[i]);
  fprintf(out, "]");
}

/* What the CSV file does not contain. */
static int write_json(const char *path, sample_trajectory *s, int64_t frames) {
  FILE *out = fopen(path, "w");
  if (!out) return report_error("cannot write the JSON file");
  double *kinetic = doubles(frames), *potential = doubles(frames),
         *ij = doubles(2 * s->what.nsprings), *faces = doubles(3 * s->what.nfaces);
  for (int64_t i = 0; i < frames; i++) {
    msim_frame frame = sample_frame(s, i);
    kinetic[i] = frame.kinetic;
    potential[i] = frame.potential;
  }
  for (int32_t i = 0; i < 2 * s->what.nsprings; i++) ij[i] = s->ij[i];
  for (int32_t i = 0; i < 3 * s->what.nfaces; i++) faces[i] = s->faces[i];
  fprintf(out, "{\"frames\": %" PRId64, frames);
  write_list(out, "times", s->times, s->what.nframes);
  write_list(out, "mass", s->mass, s->what.n);
  write_list(out, "k", s->k, s->what.nsprings);
  write_list(out, "rest", s->rest, s->what.nsprings);
  write_list(out, "ij", ij, 2 * s->what.nsprings);
  write_list(out, "damping", s->damping, s->what.nsprings);
  write_list(out, "faces", faces, 3 * s->what.nfaces);
  write_list(out, "kinetic", kinetic, frames);
  write_list(out, "potential", potential, frames);
  fprintf(out, "}\n");
  free(kinetic);
  free(potential);
  free(ij);
  free(faces);
  return fclose(out) == 0 ? 0 : report_error("cannot write the JSON file");
}

/* 40 frames planned, 36 written. */
static int write_mode(const char *base) {
  enum { N = 35, NSPRINGS = 60, PLANNED = 40, WRITTEN = 36 };
  const msim_recorder_type *hdf5 = find_hdf5_recorder();
  char path[3][1024];
  static const char *const endings[] = {"vtkhdf", "csv", "json"};
  for (int i = 0; i < 3; i++) snprintf(path[i], sizeof path[i], "%s.%s", base, endings[i]);
  sample_trajectory s;
  host_init(&host);
  sample_init(&s, path[0], N, NSPRINGS, PLANNED);
  msim_status status = record(hdf5, &host.host, &s, WRITTEN);
  s.what.path = path[1];
  if (status == MSIM_OK) status = record(ms_csv_recorder_type(), &host.host, &s, WRITTEN);
  int result = status == MSIM_OK ? write_json(path[2], &s, WRITTEN) : report_error(host.sentence);
  sample_free(&s);
  return result;
}

static int verify_mode(const char *path) {
  int64_t planned = -1, good = verify_trajectory(path, &planned);
  if (good < 0) return report_error("the file is damaged");
  printf("%" PRId64 " of %" PRId64 "\n", good, planned);
  return 0;
}

int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(all_planned_frames),
      cmocka_unit_test(fewer_frames_than_planned),
      cmocka_unit_test(one_frame),
      cmocka_unit_test(no_springs),
      cmocka_unit_test(no_particles),
      cmocka_unit_test(many_frames_and_large_frames),
      cmocka_unit_test(the_layout_is_that_of_vtkhdf),
      cmocka_unit_test(columns_hold_what_was_given),
      cmocka_unit_test(reactions_are_recorded_where_particles_are_pinned),
      cmocka_unit_test(equal_runs_give_equal_bytes),
      cmocka_unit_test(damage_is_noticed),
      cmocka_unit_test(threads_record_side_by_side),
  };
  if (argc == 3 && strcmp(argv[1], "verify") == 0) return verify_mode(argv[2]);
  if (!find_hdf5_recorder()) return missing_status("the recorder hdf5");
  if (argc == 3 && strcmp(argv[1], "write") == 0) return write_mode(argv[2]);
  return cmocka_run_group_tests(tests, enter_folder, leave_folder);
}
