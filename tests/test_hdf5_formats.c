/* Tests of the recorder plugin hdf5 when it resumes a file of an earlier format, or with other pins
 * than it has: the file stays as it is, and goes on. */
#define _DEFAULT_SOURCE /* mkdtemp */
#include "trajectory.h"

enum { N = 20, NSPRINGS = 30, PLANNED = 12 };

static counting_host host;
static sample_trajectory s;

/* Record a file of `written` frames. */
static void begin(int64_t written) {
  host_init(&host);
  sample_init(&s, "a.vtkhdf", N, NSPRINGS, PLANNED);
  assert_int_equal(record(find_hdf5_recorder(), &host.host, &s, written), MSIM_OK);
}

/* Make a file one of format 2. */
static void remove_format_3(void) {
  hid_t file = H5Fopen("a.vtkhdf", H5F_ACC_RDWR, H5P_DEFAULT);
  assert_true(H5Ldelete(file, "/VTKHDF/PointData/Reaction", H5P_DEFAULT) >= 0);
  assert_true(H5Ldelete(file, "/VTKHDF/Steps/PointDataOffsets/Reaction", H5P_DEFAULT) >= 0);
  H5Fclose(file);
  set_trajectory_format("a.vtkhdf", 2);
}

/* Make a file without faces one of format 1. */
static void remove_format_2(void) {
  static const char *const added[] = {"/VTKHDF/CellData/Strain",
                                      "/VTKHDF/CellData/Tension",
                                      "/VTKHDF/CellData/Damping",
                                      "/VTKHDF/PointData/Pinned",
                                      "/VTKHDF/FieldData/ElasticEnergy",
                                      "/VTKHDF/FieldData/GravitationalEnergy",
                                      "/VTKHDF/Steps/CellDataOffsets/Strain",
                                      "/VTKHDF/Steps/CellDataOffsets/Tension",
                                      "/VTKHDF/Steps/CellDataOffsets/Damping",
                                      "/VTKHDF/Steps/PointDataOffsets/Pinned",
                                      "/VTKHDF/Steps/FieldDataOffsets/ElasticEnergy",
                                      "/VTKHDF/Steps/FieldDataOffsets/GravitationalEnergy",
                                      "/msim/frames/NCommitted",
                                      "/msim/planes"};
  remove_format_3();
  hid_t file = H5Fopen("a.vtkhdf", H5F_ACC_RDWR, H5P_DEFAULT);
  for (size_t i = 0; i < sizeof added / sizeof *added; i++)
    assert_true(H5Ldelete(file, added[i], H5P_DEFAULT) >= 0);
  H5Fclose(file);
  set_trajectory_format("a.vtkhdf", 1);
}

/* A file of format 1 has no faces, whatever the scene has, and goes on without what came later. */
static void format_1_is_resumed_as_it_is(void **state) {
  (void)state;
  int64_t kept;
  begin(0);
  const int32_t nfaces = s.what.nfaces;
  s.what.nfaces = 0;
  assert_int_equal(record(find_hdf5_recorder(), &host.host, &s, 5), MSIM_OK);
  remove_format_2();
  s.what.nfaces = nfaces;
  if (record_resumed(find_hdf5_recorder(), &host.host, &s, PLANNED, &kept) != MSIM_OK)
    fail_msg("%s", host.sentence);
  assert_int_equal(kept, 5);
  assert_trajectory_valid("a.vtkhdf", PLANNED, PLANNED);
  hid_t file = open_trajectory("a.vtkhdf");
  assert_int_equal(read_attribute(file, "/msim", "format"), 1);
  assert_int_equal(committed_count(file), -1);
  H5Fclose(file);
  assert_int_equal(host.live, 0);
  sample_free(&s);
  remove("a.vtkhdf");
}

static void format_2_is_resumed_as_it_is(void **state) {
  (void)state;
  int64_t kept;
  hsize_t dims[2];
  begin(5);
  remove_format_3();
  if (record_resumed(find_hdf5_recorder(), &host.host, &s, PLANNED, &kept) != MSIM_OK)
    fail_msg("%s", host.sentence);
  assert_int_equal(kept, 5);
  assert_trajectory_valid("a.vtkhdf", PLANNED, PLANNED);
  hid_t file = open_trajectory("a.vtkhdf");
  assert_int_equal(read_attribute(file, "/msim", "format"), 2);
  assert_int_equal(committed_count(file), PLANNED);
  assert_int_equal(dataset_extent(file, "/VTKHDF/PointData/Reaction", dims), -1);
  H5Fclose(file);
  assert_int_equal(host.live, 0);
  sample_free(&s);
  remove("a.vtkhdf");
}

/* The file decides whether it holds reactions, not the pins of the run that resumes it. */
static void reactions_are_resumed_with_other_pins(void **state) {
  (void)state;
  int64_t kept;
  for (int pinned = 0; pinned < 2; pinned++) {
    begin(0);
    memset(s.pinned, pinned, N);
    assert_int_equal(record(find_hdf5_recorder(), &host.host, &s, 5), MSIM_OK);
    memset(s.pinned, !pinned, N);
    if (record_resumed(find_hdf5_recorder(), &host.host, &s, PLANNED, &kept) != MSIM_OK)
      fail_msg("%s", host.sentence);
    assert_trajectory_valid("a.vtkhdf", PLANNED, PLANNED);
    sample_free(&s);
    remove("a.vtkhdf");
  }
}

int main(void) {
  if (!find_hdf5_recorder()) return missing_status("the recorder hdf5");
  const struct CMUnitTest tests[] = {cmocka_unit_test(format_1_is_resumed_as_it_is),
                                     cmocka_unit_test(format_2_is_resumed_as_it_is),
                                     cmocka_unit_test(reactions_are_resumed_with_other_pins)};
  return cmocka_run_group_tests(tests, enter_folder, leave_folder);
}
